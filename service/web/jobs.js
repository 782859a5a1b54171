/** The list of jobs, by status, type, label, verdict and decision; it stays true while something runs. */

import * as api from './api.js';
import { $, element, say } from './dom.js';
import { DECISION, DECISION_MOOD, FINAL, MOOD, meshes, time } from './words.js';

const LOOK_MS = 3000;
const FILTERS = ['status', 'type', 'label', 'verdict', 'decision'];
let next = null; // cursor of older ones
let asked = 0; // of answers that cross, the last question's is shown
let again;

for (const name of FILTERS) $(`filter-${name}`).addEventListener('change', () => show());
$('more').addEventListener('click', () => list(true));

export function show() {
  return list(false);
}

/** Look no more. */
export function leave() {
  asked += 1;
  clearTimeout(again);
}

async function list(isMore) {
  leave();
  const mine = asked;
  const words = new URLSearchParams({ limit: 20 });
  for (const name of FILTERS) if ($(`filter-${name}`).value) words.set(name, $(`filter-${name}`).value);
  if (isMore && next) words.set('cursor', next);
  try {
    const page = await api.json(`/v1/jobs?${words}`);
    if (mine !== asked) return;
    next = page.next;
    $('more').hidden = !next;
    const rows = page.jobs.map(row);
    if (isMore) $('job-rows').append(...rows);
    else $('job-rows').replaceChildren(...rows);
    $('no-jobs').hidden = $('job-rows').rows.length > 0;
    if (!isMore && page.jobs.some((job) => !FINAL.includes(job.status))) again = setTimeout(() => show(), LOOK_MS);
  } catch (error) {
    if (mine === asked) say('refused', error);
  }
}

const coloured = (words, mood) => element('span', words, { className: `status ${mood}` });

function row(job) {
  const link = element('a', time(job.created), { href: `#${job.id}` });
  const status = job.status === 'running' ? `running, ${job.progress.toFixed(0)} %` : job.status;
  const cells = [
    link, job.label ?? '', meshes(job.inputs), job.type, coloured(status, job.status),
    job.verdict ? coloured(job.verdict.replaceAll('_', ' '), MOOD[job.verdict] ?? 'bad') : '',
    job.decision ? coloured(DECISION[job.decision], DECISION_MOOD[job.decision]) : '',
  ];
  return element('tr', cells.map((content) => element('td', content)));
}
