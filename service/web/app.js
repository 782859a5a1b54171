/** The page: two files in, a coloured part out. Where we are stands in the address (`#job-id`), so that it can be sent on. */

import * as api from './api.js';
import { $, say } from './dom.js';
import * as job from './job.js';
import * as jobs from './jobs.js';
import * as centres from './centres.js';
import * as part from './part.js';
import * as start from './start.js';

const THEME = 'cusp-theme';
const AGAIN = 'again-'; // before a job's id: a new job on its meshes
let leaving = new AbortController();

async function route() {
  leaving.abort();
  leaving = new AbortController();
  job.close();
  jobs.leave();
  document.title = 'Cusp';
  const where = location.hash.slice(1);
  const isJob = where && !where.startsWith(AGAIN);
  $('start').hidden = isJob;
  $('jobs').hidden = isJob;
  $('job').hidden = !isJob;
  if (isJob) {
    await job.open(where, leaving.signal);
    return;
  }
  $('refused').hidden = true;
  try {
    const before = where ? await api.json(`/v1/jobs/${where.slice(AGAIN.length)}`) : null;
    await Promise.all([start.show(before), jobs.show()]);
    if (before && !$('start').contains(document.activeElement)) $('start-title').focus();
  } catch (error) {
    say('refused', error);
  }
}

function dress(theme) {
  document.documentElement.dataset.theme = theme;
  $('theme').textContent = theme === 'dark' ? 'Light' : 'Dark';
  part.redraw();
  centres.redraw();
}

$('theme').addEventListener('click', () => {
  const theme = document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark';
  localStorage.setItem(THEME, theme);
  dress(theme);
});
$('key').value = api.key.get();
$('key').addEventListener('change', () => { api.key.set($('key').value.trim()); route(); });
dress(localStorage.getItem(THEME) ?? (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light'));
addEventListener('hashchange', route);
route();
