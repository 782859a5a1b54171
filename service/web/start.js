/** A new job: its meshes as files or as what was sent before, and what matters of its options. */

import * as api from './api.js';
import { $, say } from './dom.js';
import * as acceptance from './acceptance.js';
import * as earlier from './earlier.js';
import * as reading from './reading.js';
import * as study from './study_form.js';

const MESHES = { registration: ['design', 'scan'], landmarks: ['mesh'], study: ['mesh'] };
const ACTION = { registration: 'Register', landmarks: 'Find landmarks', study: 'Start the study' };
const HINT = 'Drop a file here, or choose one';
const slots = Object.fromEntries([...document.querySelectorAll('.slot')].map((slot) => [slot.dataset.mesh, {
  box: slot,
  file: slot.querySelector('input'),
  said: slot.querySelector('output'),
  before: slot.querySelector('[data-what=earlier]'),
  unit: slot.querySelector('[data-what=unit]'),
}]));

for (const slot of Object.values(slots)) {
  const { box, file, before } = slot;
  file.addEventListener('change', () => { if (file.files.length) before.value = ''; renew(slot); });
  before.addEventListener('change', () => { if (before.value) file.value = ''; renew(slot); });
  for (const kind of ['dragenter', 'dragover']) box.addEventListener(kind, () => box.classList.add('over'));
  for (const kind of ['dragleave', 'drop']) box.addEventListener(kind, () => box.classList.remove('over'));
}
// A file that is dropped beside the slots must not replace the page.
for (const kind of ['dragover', 'drop']) addEventListener(kind, (event) => { if (isFiles(event)) event.preventDefault(); });
addEventListener('drop', (event) => { if (isFiles(event) && !$('start').hidden) drop(event.dataTransfer, event.target.closest?.('.slot')?.dataset.mesh); });
for (const radio of $('form').elements.type) radio.addEventListener('change', dress);
$('form').addEventListener('submit', submit);
dress();

/** Offer what was sent before; `job`: choose its meshes. */
export async function show(job = null) {
  acceptance.clear();
  await earlier.offer(Object.fromEntries(Object.entries(slots).map(([name, { before }]) => [name, before])));
  reading.clear();
  if (!job) return;
  $('form').reset();
  $('form').elements.type.value = job.type in MESHES ? job.type : 'landmarks';
  $('form').elements.label.value = job.label ?? '';
  $('form').elements.serial.value = job.reference?.serial ?? '';
  for (const [name, given] of Object.entries(job.inputs)) {
    if (!given) continue;
    slots[name].file.value = '';
    slots[name].before.value = given.blob;
    tell(slots[name]);
  }
  dress();
  const [asked, results] = await Promise.all([
    api.json(`/v1/jobs/${job.id}/options`),
    job.status === 'successful' ? api.json(`/v1/jobs/${job.id}/results`) : null,
  ]);
  remember(job.type, asked, results);
  reading.show(job, asked, results);
  acceptance.show(job, asked.acceptance, $('form').elements);
}

/** What was asked of a job; units as its files were read, where they were. */
function remember(type, asked, results) {
  const { elements } = $('form');
  for (const [name, { unit }] of Object.entries(slots)) {
    const read = results?.provenance.inputs[name]?.unit ?? asked.units[name];
    if ([...unit.options].some(({ value }) => value === read)) unit.value = read;
  }
  elements.preset.value = asked.preset;
  if (type === 'study' && results) study.remember(results.provenance.settings.study);
  if (type !== 'registration') return;
  elements.tolerance_mm.value = asked.tolerance_mm ?? '';
  elements.scan_accuracy_mm.value = asked.scan_accuracy_mm ?? results?.scan?.accuracy_mm ?? '';
}

const isFiles = (event) => event.dataTransfer?.types.includes('Files') ?? false;

/** name : of the slot, none beside them: then the one file goes to the one slot that is empty */
function drop({ files }, name) {
  $('refused').hidden = true;
  const wanted = MESHES[$('form').elements.type.value];
  const empty = wanted.filter((each) => !isFilled(slots[each]));
  const target = name ?? (empty.length === 1 ? empty[0] : null);
  if (files.length !== 1) say('refused', new Error(`${files.length} files were dropped. Drop one file on each of: ${wanted.join(', ')}.`));
  else if (!target) say('refused', new Error(`Drop the file on one of: ${wanted.join(', ')}.`));
  else {
    slots[target].file.files = files;
    slots[target].before.value = '';
    renew(slots[target]);
  }
}

/** Another mesh: the unit of the one before does not count for it. */
function renew(slot) {
  slot.unit.value = 'auto';
  tell(slot);
}

const isFilled = ({ file, before }) => Boolean(file.files.length || before.value);

function tell({ file, said, before, box }) {
  said.textContent = file.files[0]?.name ?? (before.value ? before.selectedOptions[0].textContent : HINT);
  box.classList.toggle('filled', isFilled({ file, before }));
}

function dress() {
  const wanted = MESHES[$('form').elements.type.value];
  for (const [name, { box }] of Object.entries(slots)) box.hidden = !wanted.includes(name);
  for (const field of ['tolerance-field', 'accuracy-field', 'within-field', 'serial-field', 'acceptance-box', 'reading']) $(field).hidden = !wanted.includes('scan');
  study.dress($('form').elements.type.value);
  $('go').textContent = ACTION[$('form').elements.type.value];
}

async function submit(event) {
  event.preventDefault();
  const form = event.target;
  const type = form.elements.type.value;
  $('refused').hidden = true;
  const missing = MESHES[type].find((name) => !slots[name].file.files.length && !slots[name].before.value);
  if (missing) {
    say('refused', new Error(`${missing}: choose a file, or one that was sent before.`));
    slots[missing].file.focus();
    return;
  }
  $('go').disabled = true;
  try {
    location.hash = (await sent(type, options(form, type))).id;
    form.reset();
    reading.clear();
    acceptance.clear();
    for (const slot of Object.values(slots)) tell(slot);
    dress();
  } catch (error) {
    say('refused', error);
    reading.refused(error);
  } finally {
    $('go').disabled = false;
    $('sending').hidden = true;
  }
}

function options(form, type) {
  const units = Object.fromEntries(MESHES[type].map((name) => [name, slots[name].unit.value]).filter(([, unit]) => unit !== 'auto'));
  const { tolerance_mm: tolerance, scan_accuracy_mm: accuracy, serial, label, preset } = form.elements;
  return {
    ...(Object.keys(units).length ? { units } : {}),
    ...(type === 'registration' && tolerance.value ? { tolerance_mm: Number(tolerance.value) } : {}),
    ...(type === 'registration' && accuracy.value ? { scan_accuracy_mm: Number(accuracy.value) } : {}),
    ...(type === 'registration' ? acceptance.read(form.elements) : {}),
    ...(type === 'registration' && serial.value ? { reference: { serial: serial.value } } : {}),
    ...(type === 'registration' ? reading.options() : {}),
    ...(type === 'study' ? { study: study.options() } : {}),
    ...(label.value ? { label: label.value } : {}),
    ...(preset.value === 'default' ? {} : { preset: preset.value }),
  };
}

/** One form where all meshes are files; else what is new goes first, and the job names blobs. */
async function sent(type, given) {
  const names = MESHES[type];
  if (names.every((name) => slots[name].file.files.length)) {
    const form = new FormData();
    form.append('type', type);
    form.append('options', JSON.stringify(given));
    for (const name of names) form.append(name, slots[name].file.files[0]);
    return api.send('POST', '/v1/jobs', form, progress(names.join(' and ')));
  }
  const request = { type, options: given };
  for (const name of names) {
    const file = slots[name].file.files[0];
    request[name] = file
      ? { blob: (await api.send('PUT', `/v1/blobs?filename=${encodeURIComponent(file.name)}`, file, progress(name))).id, filename: file.name }
      : earlier.reference(name, slots[name].before.value);
  }
  return api.start(request);
}

const progress = (what) => (share) => {
  $('sending').hidden = false;
  $('sent').value = 100 * share;
  $('sent-words').textContent = share < 1 ? `sending ${what}` : 'checking';
};
