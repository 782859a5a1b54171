/** The page: two files in, a coloured part out. Where we are stands in the address (`#job-id`), so that it can be sent on. */

import * as api from './api.js';
import * as colours from './colours.js';

const $ = (id) => document.getElementById(id);
const PALETTE = ['#332288', '#ddcc77', '#cc6677', '#44aa99', '#882255', '#88ccee', '#117733', '#aa4499', '#999933'];
const MEANING = {
  ok: 'The pose is found and no other explains the scan as well.',
  ambiguous: 'More than one pose explains the scan as well. Do not use the pose unchecked.',
  under_constrained: 'The part can slide or turn along itself: the pose is one of a continuum.',
  units_suspect: 'The scan fits only when its numbers are taken in another unit. Send it again with the right unit.',
  mirrored: 'The scan is the mirror image of the design. There is no pose to stand by.',
  no_match: 'The scan does not fit the design anywhere.',
};
const MOOD = { ok: 'good', ambiguous: 'warn', under_constrained: 'warn', units_suspect: 'warn' };
const mm = (value) => (value === null || value === undefined ? '-' : `${value.toFixed(3)} mm`);
const signed = (value) => `${value >= 0 ? '+' : ''}${value.toFixed(3)} mm`;

let watching = new AbortController();
let viewer = null;

// --- start

$('key').value = api.key.get();
$('key').addEventListener('change', () => { api.key.set($('key').value.trim()); route(); });

for (const drop of document.querySelectorAll('.drop')) {
  const input = drop.querySelector('input');
  const said = drop.querySelector('output');
  const name = () => { said.textContent = input.files[0]?.name ?? 'Drop a file here or choose one'; };
  input.addEventListener('change', name);
  for (const kind of ['dragenter', 'dragover']) drop.addEventListener(kind, (event) => { event.preventDefault(); drop.classList.add('over'); });
  for (const kind of ['dragleave', 'drop']) drop.addEventListener(kind, () => drop.classList.remove('over'));
  drop.addEventListener('drop', (event) => { event.preventDefault(); input.files = event.dataTransfer.files; name(); });
}

$('form').addEventListener('submit', async (event) => {
  event.preventDefault();
  const form = event.target;
  const button = form.querySelector('button');
  const given = new FormData();
  const options = {};
  if (form.tolerance_mm.value) options.tolerance_mm = Number(form.tolerance_mm.value);
  if (form.label.value) options.label = form.label.value;
  if (form.unit.value !== 'auto') options.units = { scan: form.unit.value };
  given.append('options', JSON.stringify(options));
  for (const mesh of ['design', 'scan']) given.append(mesh, form[mesh].files[0]);
  button.disabled = true;
  $('refused').hidden = true;
  try {
    location.hash = (await api.json('/v1/jobs', { method: 'POST', body: given })).id;
  } catch (error) {
    say('refused', error);
  } finally {
    button.disabled = false;
  }
});

function say(id, error) {
  $(id).textContent = error.message;
  $(id).hidden = false;
  if (error.status === 401) $('key-box').open = true;
}

// --- list of jobs

let next = null;
async function list(isMore = false) {
  const words = new URLSearchParams({ limit: 20 });
  for (const name of ['status', 'type', 'label']) if ($(`filter-${name}`).value) words.set(name, $(`filter-${name}`).value);
  if (isMore && next) words.set('cursor', next);
  try {
    const page = await api.json(`/v1/jobs?${words}`);
    next = page.next;
    $('more').hidden = !next;
    if (!isMore) $('job-rows').replaceChildren();
    for (const job of page.jobs) {
      const row = document.createElement('tr');
      const link = document.createElement('a');
      link.href = `#${job.id}`;
      link.textContent = new Date(job.created).toLocaleString();
      for (const [k, content] of [link, job.label ?? '', job.type, job.status].entries()) {
        const cell = document.createElement('td');
        cell.append(k ? document.createTextNode(content) : content);
        row.append(cell);
      }
      $('job-rows').append(row);
    }
  } catch (error) {
    say('refused', error);
  }
}
for (const name of ['status', 'type', 'label']) $(`filter-${name}`).addEventListener('change', () => list());
$('more').addEventListener('click', () => list(true));

// --- one job

async function open(id) {
  $('result').hidden = true;
  $('failed').hidden = true;
  $('job-title').textContent = 'Job';
  $('cancel').onclick = () => api.remove(`/v1/jobs/${id}`).catch((error) => say('failed', error));
  try {
    for await (const job of api.watch(id, watching.signal)) {
      $('job-title').textContent = job.label ? `${job.type}: ${job.label}` : job.type;
      $('progress').value = job.progress;
      $('stage').textContent = job.message ?? job.status;
      const isFinal = ['successful', 'failed', 'dismissed'].includes(job.status);
      $('progress-box').hidden = isFinal;
      if (job.status === 'failed') say('failed', new Error(job.error.detail));
      if (job.status === 'dismissed') say('failed', new Error('This job was dismissed.'));
      if (job.status === 'successful') await show(id);
    }
  } catch (error) {
    if (error.name !== 'AbortError') say('failed', error);
  }
}

async function show(id) {
  const [results, listed] = await Promise.all([api.json(`/v1/jobs/${id}/results`), api.json(`/v1/jobs/${id}/files`)]);
  $('result').hidden = false;
  $('files').replaceChildren(...listed.files.map((file) => fileLink(file)));
  const isRegistration = results.type === 'registration';
  $('verdict').hidden = !isRegistration;
  $('viewer').hidden = !isRegistration;
  $('figures').replaceChildren();
  if (!isRegistration) return;
  const { verdict, deviation, metrics } = results;
  $('verdict').className = MOOD[verdict.status] ?? 'bad';
  $('status').textContent = verdict.status.replaceAll('_', ' ');
  $('confidence').textContent = verdict.confidence ? `confidence ${verdict.confidence.toFixed(2)}` : '';
  $('meaning').textContent = MEANING[verdict.status];
  $('findings').replaceChildren(...verdict.findings.map((each) => element('li', `${each.code}: ${each.detail}`)));
  const figures = deviation
    ? { 'RMS deviation': mm(deviation.rms_mm), mean: signed(deviation.mean_mm), SD: mm(deviation.sd_mm), 'from 1 % to 99 %': `${signed(deviation.p01_mm)} to ${signed(deviation.p99_mm)}` }
    : {};
  figures['landmarks matched'] = String(results.landmarks.matches.length);
  figures['K, landmarks against whole shape'] = metrics.k_ratio === null ? '-' : metrics.k_ratio.toPrecision(3);
  for (const [name, value] of Object.entries(figures)) {
    const box = document.createElement('div');
    box.append(element('dt', name), element('dd', value));
    $('figures').append(box);
  }
  await view(id, results, new Set(listed.files.map((file) => file.name)));
}

function fileLink(file) {
  const item = document.createElement('li');
  const link = element('a', file.name);
  link.href = file.href;
  if (file.name === 'report.html' && !api.key.get()) link.target = '_blank';
  else link.download = file.name;
  if (api.key.get()) {
    link.addEventListener('click', async (event) => { // a link cannot carry a key
      event.preventDefault();
      const address = URL.createObjectURL(await api.blob(file.href));
      Object.assign(document.createElement('a'), { href: address, download: file.name }).click();
      setTimeout(() => URL.revokeObjectURL(address), 60_000);
    });
  }
  item.append(link, document.createTextNode(` ${(file.size / 1024).toFixed(0)} KiB`));
  return item;
}

function element(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

// --- the part

async function view(id, results, names) {
  if (!names.has('design.glb')) { $('viewer').hidden = true; return; }
  const { Viewer } = await import('./viewer.js');
  const at = (name) => api.bytes(`/v1/jobs/${id}/files/${name}`);
  const scan = names.has('deviation.glb') ? 'deviation.glb' : null;
  const [designFile, scanFile] = await Promise.all([at('design.glb'), scan ? at(scan) : null]);
  viewer = new Viewer($('canvas'), (words) => { $('tip').textContent = words; $('tip').hidden = !words; });
  viewer.resize();
  await viewer.load(designFile, scanFile);
  const { deviation, landmarks, transform, alternatives } = results;
  const size = Math.hypot(...extent(landmarks.design.map((each) => each.position_mm)));
  viewer.landmarks(landmarks.design.map((each) => ({
    position: each.position_mm,
    colour: PALETTE[each.segment % PALETTE.length],
    words: `landmark ${each.id} of the design: segment ${each.segment}, T² ${each.t2.toFixed(1)}`,
  })), size);
  const moved = (matrix, p) => matrix.slice(0, 3).map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);
  if (transform) {
    const ofScan = new Map(landmarks.scan.map((each) => [each.id, each.position_mm]));
    const ofDesign = new Map(landmarks.design.map((each) => [each.id, each.position_mm]));
    viewer.matches(landmarks.matches.map((each) => [ofDesign.get(each.design), moved(transform.matrix, ofScan.get(each.scan))]));
  }

  const sides = ['+z', '-z', '+x', '-x', '+y', '-y', 'oblique'];
  options($('side'), sides.map((side) => [side, side]));
  $('side').onchange = () => viewer.frame($('side').value);
  for (const [box, what, isOn] of [['show-design', 'design', !scan], ['show-landmarks', 'marks', false], ['show-matches', 'lines', false]]) {
    $(box).checked = isOn;
    $(box).onchange = () => viewer.show(what, $(box).checked);
    viewer.show(what, isOn);
  }
  const poses = [['final', 'final pose']];
  if (transform) {
    poses.push(['before', 'as uploaded']);
    alternatives.forEach((each, k) => poses.push([String(k), `${each.symmetry_of_design ? 'symmetry' : 'rival'} ${k + 1}`]));
  }
  options($('pose'), poses);
  $('pose').onchange = () => {
    const chosen = $('pose').value;
    const target = chosen === 'before' ? IDENTITY : chosen === 'final' ? transform?.matrix : alternatives[Number(chosen)].matrix;
    if (transform) viewer.pose(chosen === 'final' ? IDENTITY : times(target, inverse(transform.matrix)));
  };

  $('legend').hidden = !deviation;
  $('tolerance').closest('label').hidden = !deviation;
  if (deviation) {
    const given = deviation.tolerance_mm ?? 0;
    const limit = colours.roundUp(Math.max(Math.abs(deviation.p01_mm), Math.abs(deviation.p99_mm), 2 * given));
    $('tolerance').max = limit;
    $('tolerance').step = limit / 200;
    $('tolerance').value = given;
    $('tolerance').oninput = () => recolour(limit);
    recolour(limit);
  }
}

function recolour(limit) {
  const tolerance = Number($('tolerance').value);
  $('tolerance-mm').textContent = tolerance ? `±${tolerance.toFixed(3)} mm` : 'none';
  viewer.recolour(limit, tolerance);
  const canvas = $('scale');
  const pen = canvas.getContext('2d');
  for (let x = 0; x < canvas.width; x += 1) {
    pen.fillStyle = `rgb(${colours.of(((x + 0.5) / canvas.width * 2 - 1) * limit, limit, tolerance).map(Math.round)})`;
    pen.fillRect(x, 0, 1, canvas.height);
  }
  $('ticks').replaceChildren(...[-1, -0.5, 0, 0.5, 1].map((share) => element('span', share ? `${share > 0 ? '+' : ''}${(share * limit).toPrecision(2)} mm` : '0')));
  const values = viewer.values ? Array.from(viewer.values.array).filter((each) => each < 1e30) : [];
  const inside = values.filter((each) => Math.abs(each) <= tolerance).length;
  $('within').textContent = tolerance && values.length
    ? `${((100 * inside) / values.length).toFixed(1)} % of the shown vertices lie within the tolerance. Blue: material is missing, red: too much.`
    : 'Blue: material is missing, red: too much. Dark grey: on an open border, not counted.';
}

const IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
const times = (a, b) => a.map((row) => b[0].map((_, k) => row.reduce((sum, part, n) => sum + part * b[n][k], 0)));
function inverse(m) { // of a rigid motion
  const r = [0, 1, 2].map((k) => [m[0][k], m[1][k], m[2][k]]);
  const t = [m[0][3], m[1][3], m[2][3]];
  return [...r.map((row) => [...row, -row.reduce((sum, part, k) => sum + part * t[k], 0)]), [0, 0, 0, 1]];
}
function extent(points) {
  if (!points.length) return [1, 1, 1];
  return [0, 1, 2].map((k) => Math.max(...points.map((p) => p[k])) - Math.min(...points.map((p) => p[k])) || 1);
}
function options(select, pairs) {
  select.replaceChildren(...pairs.map(([value, text]) => Object.assign(document.createElement('option'), { value, textContent: text })));
}

// --- where we are

function route() {
  watching.abort();
  watching = new AbortController();
  viewer?.close();
  viewer = null;
  const id = location.hash.slice(1);
  $('start').hidden = Boolean(id);
  $('jobs').hidden = Boolean(id);
  $('job').hidden = !id;
  if (id) open(id);
  else list();
}

const THEME = 'cusp-theme';
function dress(theme) {
  document.documentElement.dataset.theme = theme;
  $('theme').textContent = theme === 'dark' ? 'Light' : 'Dark';
  $('theme').setAttribute('aria-pressed', String(theme === 'dark'));
  viewer?.draw();
}
$('theme').addEventListener('click', () => {
  const theme = document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark';
  localStorage.setItem(THEME, theme);
  dress(theme);
});
dress(localStorage.getItem(THEME) ?? (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light'));
addEventListener('hashchange', route);
route();
