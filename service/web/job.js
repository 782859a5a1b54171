/** One job: how far it is, and when it is done what it found. */

import * as api from './api.js';
import * as centres from './centres.js';
import { $, element, say } from './dom.js';
import * as files from './files.js';
import * as part from './part.js';
import * as reading from './reading.js';
import { meshes, time } from './words.js';

const BOTH = ['load', 'clean', 'resample', 'geodesics', 'segmentation', 'features', 'landmarks'];
const STAGES = {
  registration: [...BOTH, 'matching', 'registration', 'deviation', 'inspection', 'report'],
  landmarks: [...BOTH, 'report'],
  study: ['load', 'clean', 'study', 'report'],
};
const TICK_MS = 1000;
const QUEUE_MS = 5000; // between two questions for the place in the queue and the time left
const FEW = 3; // jobs alike, below which the service gives no estimate
let ticking;
let said = { of: '' }; // what the service said last of the queue and the time left, and of which job and status

const PAGES = { registration: './registration.js', landmarks: './landmarks.js', study: './study.js' };

/** signal : aborted when people go elsewhere */
export async function open(id, signal) {
  for (const box of ['result', 'failed', 'offer', 'decision', 'checks', 'verdict', 'identity', 'viewer', 'measure', 'how', 'graph', 'others', 'by-segment', 'study', 'progress-box']) $(box).hidden = true;
  delete $('result').dataset.shown;
  $('job-title').textContent = 'Job';
  $('job-made').textContent = '';
  $('stage').textContent = '';
  $('new-again').href = `#again-${id}`;
  $('cancel').onclick = () => api.cancel(id).catch((error) => say('failed', error));
  $('remove').onclick = () => remove(id);
  $('job-title').focus();
  try {
    for await (const job of api.watch(id, signal)) {
      tell(job);
      if (job.status === 'failed') {
        say('failed', new api.Refused(job.error, 0));
        reading.offer(job, [job.error]);
      }
      if (job.status === 'dismissed') say('failed', new Error('This job was cancelled (status: dismissed).'));
      if (job.status === 'successful') await show(job, signal);
    }
  } catch (error) {
    if (!signal.aborted) say('failed', error);
  }
}

export function close() {
  clearInterval(ticking);
  part.close();
  centres.close();
}

async function remove(id) {
  if (!confirm('Remove this job with its results?')) return;
  try {
    await api.remove(`/v1/jobs/${id}`);
    location.hash = '';
  } catch (error) {
    say('failed', error);
  }
}

function tell(job) {
  const isFinal = job.finished !== null;
  $('job-title').textContent = job.label ? `${job.type}: ${job.label}` : job.type;
  document.title = `${isFinal ? job.status : `${Math.floor(job.progress)} %`} · ${job.label ?? job.type} · Cusp`;
  const took = job.started && job.finished ? ` · ${((new Date(job.finished) - new Date(job.started)) / 1000).toFixed(1)} s` : '';
  $('job-made').textContent = `${meshes(job.inputs)} · sent ${time(job.created)}${took} · job ${job.id}`;
  tick(job);
  $('progress-box').hidden = isFinal;
  $('remove').hidden = !isFinal;
  $('progress').value = job.progress;
  const words = isFinal ? job.status : job.status === 'accepted' ? 'waiting in the queue' : job.message ?? job.status;
  $('stage').classList.toggle('unseen', isFinal);
  if ($('stage').textContent !== words) $('stage').textContent = words; // told once by screen readers
  $('percent').textContent = `${job.progress.toFixed(0)} %`;
  const stages = STAGES[job.type];
  const at = stages.indexOf(job.stage);
  $('stages').replaceChildren(...stages.map((stage, k) => {
    const item = element('li', stage, { className: k < at ? 'done' : '' });
    if (k === at) item.setAttribute('aria-current', 'step');
    return item;
  }));
}

/** How long it has waited or run, its place in the queue, and how long it may take. */
function tick(job) {
  clearInterval(ticking);
  $('elapsed').textContent = '';
  if (job.finished) return;
  const isWaiting = job.status === 'accepted';
  const of = `${job.id} ${job.status} ${job.attempt}`;
  if (said.of !== of) said = { of, ahead: '', left: null, asked: -Infinity };
  const mine = said;
  const tell = () => {
    const seconds = Math.max(0, Math.round((Date.now() - new Date(isWaiting ? job.created : job.started ?? job.created)) / 1000));
    $('elapsed').textContent = `${isWaiting ? 'waiting' : 'running'} for ${duration(seconds)}${mine.ahead}${expected(mine.left)}`;
    if (performance.now() - mine.asked < QUEUE_MS) return;
    mine.asked = performance.now();
    api.json(`/v1/jobs/${job.id}/forecast`).then(({ place, remaining_s: remaining, based_on: count }) => {
      mine.ahead = place === null ? '' : `, place ${place} in the queue`;
      mine.left = { remaining, count, at: performance.now() };
    }, () => {});
  };
  tell();
  ticking = setInterval(tell, TICK_MS);
}

/** An estimate that has run out is renewed, not counted below zero. */
function expected(left) {
  if (left === null) return '';
  if (left.remaining === null) return left.count < FEW ? ', no estimate of the time left yet' : ', longer than the jobs like it so far';
  return `, about ${duration(Math.max(1, Math.round(left.remaining - (performance.now() - left.at) / 1000)))} left`;
}

const duration = (seconds) => (seconds < 90 ? `${seconds} s` : `${Math.floor(seconds / 60)} min ${seconds % 60} s`);

async function show(job, signal) {
  const [results, listed, page] = await Promise.all([
    api.json(`/v1/jobs/${job.id}/results`),
    api.json(`/v1/jobs/${job.id}/files`),
    import(PAGES[job.type]),
  ]);
  if (signal.aborted) return;
  $('result').hidden = false;
  $('files').replaceChildren(...files.list(listed.files));
  const notes = [...(byHand(results) ?? []), ...results.warnings.map((each) => each.detail)];
  $('warnings').replaceChildren(...notes.map((each) => element('li', each)));
  reading.offer(job, results.warnings);
  const sizes = new Map(listed.files.map((file) => [file.name, file.size]));
  await page.show(job, results, sizes, signal);
  if (!signal.aborted) $('result').dataset.shown = job.id;
}

/** What tells this job from one with the same label. */
function byHand({ type, provenance }) {
  const { rho_min: rho, delta_min_mm: delta, n_centres: count } = provenance.settings.segmentation;
  if (type === 'study') return null;
  if (rho !== null || delta !== null) return [`Centres were chosen by hand: ρ at least ${rho ?? 0}, δ at least ${delta ?? 0} mm.`];
  return count === null ? null : [`The number of centres was chosen by hand: ${count}.`];
}
