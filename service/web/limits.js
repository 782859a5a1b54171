/** Limits of a next job set on the design of this one: a place is clicked, or typed; the result is `options.acceptance`. Frame: that of the design, mm. */

import * as acceptance from './acceptance.js';
import { $, element, fill } from './dom.js';
import { box, sphere } from './wireframes.js';
import { below } from './overlay.js';
import { plain } from './words.js';

const REACH = 0.01; // of the diagonal: radius that is offered, at most
const DECIMALS = 4; // of places and normals: 0.1 um
const HINT = { point: 'Click the point on the design.', sphere: 'Click the centre on the design.', box: 'Click two opposite corners on the design.' };
const REACH_WORDS = { point: 'Radius, mm', sphere: 'Radius, mm', box: 'Margin, mm' };
const PLACES = ['limit-place-1', 'limit-place-2'];

let now = null; // {viewer, blob: of the design, items: [{kind, name, places, normal, reach, lower, upper}], normal: of the place that was clicked last, isSecond: the next click is the second corner}

$('limit-kind').addEventListener('change', dress);
$('limit-add').addEventListener('click', add);
$('limits').addEventListener('toggle', () => { if (now) draw(); });
$('limits-copy').addEventListener('click', copy);
for (const id of PLACES) $(id).addEventListener('input', () => { if (now) Object.assign(now, { normal: null }); });

/** isMeasured : the job has deviations */
export function open(viewer, job, isMeasured) {
  now = { viewer, blob: job.inputs.design.blob, items: [], normal: null, isSecond: false };
  $('limits').hidden = false;
  $('limits-unjudged').hidden = isMeasured;
  $('limit-reach').value = below(REACH * viewer.diagonal());
  $('limits-use').href = `#again-${job.id}`;
  for (const id of ['limit-name', 'limit-lower', 'limit-upper', ...PLACES]) $(id).value = '';
  dress();
  tell();
}

export function close() {
  now = null;
  $('limits').hidden = true;
}

export const isOpen = () => Boolean(now) && $('limits').open;

/** The places that were set, as pins. */
export function pins() {
  if (!isOpen()) return [];
  const chosen = place($('limit-place-1').value);
  const fresh = chosen ? [{ words: $('limit-name').value.trim() || 'here', position: chosen, normal: now.normal }] : [];
  return [...now.items.map(({ name, places, normal }) => ({ words: name, position: places[0], normal })), ...fresh];
}

/** event : a click on the canvas. Whether it was for this panel. */
export function pick(event) {
  if (!isOpen()) return false;
  const found = now.viewer.onDesign(event);
  if (!found) {
    $('limit-hint').textContent = `No surface of the design there. ${HINT[$('limit-kind').value]}`;
    return true;
  }
  const isSecond = $('limit-kind').value === 'box' && now.isSecond;
  $(PLACES[isSecond ? 1 : 0]).value = found.position.map(rounded).join(', ');
  if (!isSecond) now.normal = found.normal?.map(rounded) ?? null;
  now.isSecond = !isSecond;
  $('limit-hint').textContent = `${isSecond || $('limit-kind').value !== 'box' ? 'Place' : 'First corner'} at ${found.position.map((part) => plain(part).replace('+', '')).join(', ')} mm.`;
  draw();
  return true;
}

const rounded = (value) => Number(value.toFixed(DECIMALS));

/** `1, 2, 3` -> [1, 2, 3]; null where it is something else */
function place(text) {
  const found = text.split(/[\s,;]+/).filter(Boolean).map(Number);
  return found.length === 3 && found.every(Number.isFinite) ? found : null;
}

const number = (id) => ($(id).value === '' ? null : Number($(id).value));

function add() {
  const kind = $('limit-kind').value;
  const item = { kind, name: $('limit-name').value.trim(), places: PLACES.slice(0, kind === 'box' ? 2 : 1).map((id) => place($(id).value)), normal: now.normal, reach: number('limit-reach'), lower: number('limit-lower'), upper: number('limit-upper') };
  const wrong = problem(item);
  $('limit-refused').textContent = wrong ?? '';
  $('limit-refused').hidden = !wrong;
  if (wrong) return;
  now.items.push(item);
  for (const id of ['limit-name', ...PLACES]) $(id).value = '';
  Object.assign(now, { normal: null, isSecond: false });
  dress();
  tell();
}

/** What is missing, in words; null for nothing. */
function problem({ kind, name, places, reach, lower, upper }) {
  if (places.includes(null)) return `${HINT[kind]} Or type x, y, z in mm.`;
  if (!name) return 'Give it a name.';
  if (now.items.some((each) => each.name === name)) return `The name ${name} is taken.`;
  if (lower === null && upper === null) return 'Give a lower or an upper limit.';
  if (lower !== null && upper !== null && lower >= upper) return 'The lower limit must be below the upper limit.';
  if (!(reach > 0)) return `${REACH_WORDS[kind].split(',')[0]}: give a length above 0.`;
  return null;
}

const corners = ({ places: [a, b], reach }) => [a.map((part, k) => rounded(Math.min(part, b[k]) - reach)), a.map((part, k) => rounded(Math.max(part, b[k]) + reach))];

function region(item) {
  if (item.kind === 'sphere') return { kind: 'sphere', centre_mm: item.places[0], radius_mm: item.reach };
  const [low, high] = corners(item);
  return { kind: 'box', min_mm: low, max_mm: high };
}

/** As `options.acceptance`. */
function asAcceptance() {
  const limits = ({ lower, upper }) => ({ ...(lower === null ? {} : { lower_mm: lower }), ...(upper === null ? {} : { upper_mm: upper }) });
  const points = now.items.filter(({ kind }) => kind === 'point').map((item) => ({
    name: item.name, position_mm: item.places[0], ...(item.normal ? { normal: item.normal } : {}), radius_mm: item.reach, ...limits(item),
  }));
  const regions = now.items.filter(({ kind }) => kind !== 'point').map((item) => ({ name: item.name, region: region(item), ...limits(item) }));
  return { ...(points.length ? { points } : {}), ...(regions.length ? { regions } : {}) };
}

function dress() {
  const kind = $('limit-kind').value;
  $('limit-hint').textContent = HINT[kind];
  $('limit-reach-words').textContent = REACH_WORDS[kind];
  $('limit-place-2').closest('label').hidden = kind !== 'box';
  if (now) now.isSecond = false;
}

function tell() {
  const isAny = now.items.length > 0;
  const text = isAny ? acceptance.written(asAcceptance()) : '';
  for (const id of ['limits-made', 'limit-table']) $(id).hidden = !isAny;
  $('limits-json').value = text;
  $('limits-copied').textContent = '';
  acceptance.keep(now.blob, text);
  fill($('limit-table'), ['Name', 'Kind', 'At x, y, z, mm', 'Lower', 'Upper', ''], now.items.map((item, k) => [
    item.name, item.kind, item.places.map((at) => at.map((part) => part.toFixed(2).replace('-', '−')).join(', ')).join(' to '),
    ...[item.lower, item.upper].map((limit) => (limit === null ? '-' : plain(limit))),
    element('button', 'Remove', { type: 'button', ariaLabel: `remove ${item.name}`, onclick: () => { now.items.splice(k, 1); tell(); } }),
  ]), [3, 4]);
  draw();
}

/** The regions as wires. */
function draw() {
  const { viewer, items } = now;
  const wires = isOpen() ? items.flatMap((item) => (item.kind === 'sphere' ? sphere(item.places[0], item.reach) : item.kind === 'box' ? box(...corners(item)) : [])) : [];
  viewer.marks.outline('limits', wires);
  viewer.draw();
}

async function copy() {
  try {
    await navigator.clipboard.writeText($('limits-json').value);
    $('limits-copied').textContent = 'Copied.';
  } catch { // a page that is not served by HTTPS, nor from this machine, may not write to the clipboard
    $('limits-json').focus();
    $('limits-json').select();
    $('limits-copied').textContent = 'Selected: copy it with the keyboard.';
  }
}
