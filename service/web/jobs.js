/** The list of jobs, by status, type and label; it stays true while something runs. */

import * as api from './api.js';
import { $, element, say } from './dom.js';
import { FINAL, meshes, time } from './words.js';

const LOOK_MS = 3000;
let next = null; // cursor of older ones
let asked = 0; // of answers that cross, the last question's is shown
let again;

for (const name of ['status', 'type', 'label']) $(`filter-${name}`).addEventListener('change', () => show());
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
  for (const name of ['status', 'type', 'label']) if ($(`filter-${name}`).value) words.set(name, $(`filter-${name}`).value);
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

function row(job) {
  const link = element('a', time(job.created), { href: `#${job.id}` });
  const status = job.status === 'running' ? `running, ${job.progress.toFixed(0)} %` : job.status;
  const cells = [link, job.label ?? '', meshes(job.inputs), job.type, element('span', status, { className: `status ${job.status}` })];
  return element('tr', cells.map((content) => element('td', content)));
}
