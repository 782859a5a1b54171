/** The list of jobs, by status, type, part of a name, serial number, verdict, decision and date; it stays true while something runs. */

import * as api from './api.js';
import { $, element, say } from './dom.js';
import { DECISION, DECISION_MOOD, FINAL, MOOD, meshes, percent, time } from './words.js';

const LOOK_MS = 3000;
const FILTERS = ['status', 'type', 'name', 'serial', 'verdict', 'decision'];
const DAY_MS = 86_400_000;
let next = null; // cursor of older ones
let asked = 0; // of answers that cross, the last question's is shown
let again;

for (const name of [...FILTERS, 'from', 'to']) $(`filter-${name}`).addEventListener('change', () => show());
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
  const [from, to] = ['from', 'to'].map((name) => startOf($(`filter-${name}`).value));
  if (isMore && next) words.set('cursor', next);
  else if (to !== null) words.set('cursor', firstId(to + DAY_MS));
  try {
    const page = await api.json(`/v1/jobs?${words}`);
    if (mine !== asked) return;
    const wanted = from === null ? page.jobs : page.jobs.filter((job) => new Date(job.created) >= from);
    next = wanted.length === page.jobs.length ? page.next : null; // the rest is older
    $('more').hidden = !next;
    const rows = wanted.map(row);
    if (isMore) $('job-rows').append(...rows);
    else $('job-rows').replaceChildren(...rows);
    $('no-jobs').hidden = $('job-rows').rows.length > 0;
    if (!isMore && page.jobs.some((job) => !FINAL.includes(job.status))) again = setTimeout(() => show(), LOOK_MS);
  } catch (error) {
    if (mine === asked) say('refused', error);
  }
}

/** Milliseconds at which a day begins here; null without one. */
const startOf = (day) => (day ? new Date(`${day}T00:00`).getTime() : null);

/** Ids sort by time (UUIDv7): no job that was created before `ms` has this id or a later one. */
function firstId(ms) {
  const hex = Math.max(0, ms).toString(16).padStart(12, '0');
  return `${hex.slice(0, 8)}-${hex.slice(8)}-7000-8000-000000000000`;
}

const coloured = (words, mood) => element('span', words, { className: `status ${mood}` });

const identity = (reference) => [reference?.part_number, reference?.serial, reference?.batch].filter(Boolean).join(' · ');

function row(job) {
  const link = element('a', time(job.created), { href: `#${job.id}` });
  const status = job.status === 'running' ? `running, ${job.progress.toFixed(0)} %` : job.status;
  const cells = [
    link, job.label ?? '', identity(job.reference), meshes(job.inputs), job.type, coloured(status, job.status),
    job.verdict ? coloured(job.verdict.replaceAll('_', ' '), MOOD[job.verdict] ?? 'bad') : '',
    job.decision ? coloured(DECISION[job.decision], DECISION_MOOD[job.decision]) : '',
  ];
  const within = element('td', job.within === null ? '' : percent(job.within), { className: 'number' });
  return element('tr', [...cells.map((content) => element('td', content)), within]);
}
