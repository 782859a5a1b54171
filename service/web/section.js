/** A cross-section: the plane, its handle on the part, and the outlines of design and scan in it, the deviation of the scan drawn larger. */

import * as colours from './colours.js';
import { $ } from './dom.js';
import * as legend from './legend.js';
import * as plot from './section_plot.js';

export const NAMES = 'xyz';
const ALONG = 0.2; // of a mm on the screen: an axis that is seen shorter is dragged upwards
const STEPS = 500; // of the slider
const LEAP = 10; // steps of a page key
const GREY = [128, 128, 128];

let now = null; // {viewer, isFinal: the scan is in the final pose}
let due = 0;

for (const id of ['section-axis', 'section-times', 'clip']) $(id).addEventListener('change', () => { if (id === 'section-axis') reach(); draw(); });
$('section-slider').addEventListener('input', () => move(Number($('section-slider').value)));
$('section-mm').addEventListener('input', () => { $('section-slider').value = $('section-mm').value; draw(); });
$('section').addEventListener('toggle', () => { if (now) draw(); });
document.addEventListener('recoloured', () => { if (now) draw(); });
$('section-handle').addEventListener('pointerdown', grip);
$('section-handle').addEventListener('keydown', (event) => {
  const { min, max, step } = $('section-slider');
  const by = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: LEAP, PageDown: -LEAP }[event.key];
  const ends = { Home: Number(min), End: Number(max) };
  if (!by && !(event.key in ends)) return;
  event.preventDefault();
  move(by ? offset() + by * Number(step) : ends[event.key]);
});

const axisOf = () => NAMES.indexOf($('section-axis').value);
const offset = () => Number($('section-mm').value);
const times = () => Number($('section-times').value);

/** The plane begins at the place of the largest deviation. at : {position, normal or null} in the frame of the design */
export function open(viewer, at) {
  now = { viewer, isFinal: true };
  const sizes = (at.normal ?? [0, 0, 1]).map(Math.abs);
  $('section-axis').value = NAMES[sizes.indexOf(Math.min(...sizes))]; // the plane has the normal in it: it shows the deviation in full
  $('section-times').value = '1';
  $('clip').checked = false;
  reach(at.position);
  if ($('section').open) draw();
}

export function close() {
  cancelAnimationFrame(due);
  due = 0;
  now = null;
  plot.clear();
  $('section-handle').hidden = true;
}

/** Deviations are those of the final pose: in another one the part has no outline of the scan. */
export function posed(isFinal) {
  if (!now || now.isFinal === isFinal) return;
  now.isFinal = isFinal;
  draw();
}

/** Another part of it is shown. */
export function redraw() {
  if (now) draw();
}

/** The ends of the slider. */
function reach(position) {
  if (!now) return;
  const axis = axisOf();
  const box = now.viewer.box();
  const [low, high] = [box.min.getComponent(axis), box.max.getComponent(axis)];
  const value = position ? position[axis] : (low + high) / 2;
  Object.assign($('section-slider'), { min: low, max: high, step: (high - low) / STEPS, value });
  $('section-mm').value = Number(value.toFixed(3));
}

function move(mm) {
  const { min, max } = $('section-slider');
  const value = Math.min(Number(max), Math.max(Number(min), mm));
  $('section-slider').value = value;
  $('section-mm').value = Number(value.toFixed(3));
  draw();
}

/** In the next frame, once for all calls until then. */
function draw() {
  due ||= requestAnimationFrame(() => {
    due = 0;
    if (now) drawNow();
  });
}

function drawNow() {
  const { viewer, isFinal } = now;
  const axis = axisOf();
  const isOpen = $('section').open;
  viewer.clip(axis, isOpen && $('clip').checked ? offset() : null);
  const outlines = isOpen ? cuts(viewer, axis) : { design: [], scan: [], points: [] };
  viewer.marks.outlines.design.material.color.setStyle(getComputedStyle($('section-plot')).color);
  viewer.marks.outline('design', outlines.design.flatMap(({ ends }) => ends.flatMap(({ at }) => at)));
  const drawn = isFinal ? outlines.scan : [];
  viewer.marks.outline('scan', drawn.flatMap(({ ends }) => ends.flatMap(({ at }) => at)), drawn.flatMap(({ ends }) => ends.flatMap(({ mm }) => colour(mm))));
  viewer.draw();
  if (!isOpen) return;
  plot.show(outlines, axis, colour);
  const isEmpty = !outlines.design.length && !outlines.scan.length && !outlines.points.length;
  $('section-note').textContent = isEmpty ? 'The plane misses the part.'
    : `Black: design. Coloured: scan${times() > 1 && !viewer.isCloud ? `, its deviation drawn ${times()} times as large` : ''}. Wheel zooms, drag moves, a double click shows all. The handle on the part moves the plane.`;
}

function cuts(viewer, axis) {
  const { design, scan } = viewer;
  return {
    design: design?.cut(axis, offset()) ?? [],
    scan: scan && !scan.isCloud ? scan.cut(axis, offset()).map(({ ends }) => ({ ends: ends.map(exaggerated) })) : [],
    points: scan?.isCloud ? scan.slab(axis, offset(), scan.spacing / 2) : [],
  };
}

/** A point of the scan where it is drawn: its way from the nearest place of the design is so many times as long. */
function exaggerated({ at, mm }) {
  const { design } = now.viewer;
  if (mm === null || times() === 1 || !design.bvh) return { at, mm };
  const foot = design.foot(at);
  const way = Math.hypot(...at.map((part, k) => part - foot[k]));
  const more = way > 0 ? ((times() - 1) * Math.abs(mm)) / way : 0;
  return { at: at.map((part, k) => part + more * (part - foot[k])), mm };
}

function colour(mm) {
  const scale = legend.current();
  return mm === null || !scale ? GREY : strong(colours.of(mm, scale));
}

/** Neutral grey would not show beside a grey page: darker, the more neutral. */
function strong(rgb) {
  const spread = Math.max(...rgb) - Math.min(...rgb);
  return rgb.map((part) => Math.round(part * (spread > 60 ? 0.9 : 0.55)));
}

// --- the plane on the part

/** Corners of the plane in the box of the part, or null while it is not shown. */
export function plane() {
  if (!now || !$('section').open) return null;
  const axis = axisOf();
  const { min, max } = now.viewer.box();
  const [u, v] = plot.ACROSS[axis];
  return [[min, min], [max, min], [max, max], [min, max]].map(([a, b]) => {
    const corner = [0, 0, 0];
    corner[axis] = offset();
    corner[u] = a.getComponent(u);
    corner[v] = b.getComponent(v);
    return corner;
  });
}

/** After each frame: the handle stands at the corner of the plane that is farthest from the middle of the screen, where no pin is. */
export function placeHandle() {
  const corners = plane();
  const handle = $('section-handle');
  handle.hidden = !corners;
  if (!corners) return;
  const { canvas, view } = now.viewer;
  const off = ([x, y]) => Math.hypot(x - canvas.clientWidth / 2, y - canvas.clientHeight / 2);
  const [x, y] = corners.map((each) => view.toScreen(each)).reduce((best, each) => (off(each) > off(best) + 1 ? each : best));
  const inside = (value, size) => Math.min(size - handle.offsetWidth / 2, Math.max(handle.offsetWidth / 2, value));
  handle.style.left = `${canvas.offsetLeft + canvas.clientLeft + inside(x, canvas.clientWidth)}px`;
  handle.style.top = `${canvas.offsetTop + canvas.clientTop + inside(y, canvas.clientHeight)}px`;
  const { min, max } = $('section-slider');
  const said = { valuemin: min, valuemax: max, valuenow: offset(), valuetext: `${$('section-axis').value} ${offset()} mm` };
  for (const [name, value] of Object.entries(said)) handle.setAttribute(`aria-${name}`, value);
}

function grip(event) {
  if (!now) return;
  event.preventDefault();
  const handle = $('section-handle');
  handle.focus();
  handle.setPointerCapture(event.pointerId);
  const { view } = now.viewer;
  const at = plane()[0];
  const beside = [...at];
  beside[axisOf()] += 1;
  const [a, b] = [at, beside].map((each) => view.toScreen(each));
  const pixels = [b[0] - a[0], b[1] - a[1]]; // of a millimetre along the axis
  const size = Math.hypot(...pixels);
  const isAlong = size * view.mmPerPixel() > ALONG;
  const from = { mm: offset(), x: event.clientX, y: event.clientY };
  const drag = ({ clientX, clientY }) => {
    const [x, y] = [clientX - from.x, clientY - from.y];
    move(from.mm + (isAlong ? (x * pixels[0] + y * pixels[1]) / size ** 2 : -y * view.mmPerPixel()));
  };
  handle.addEventListener('pointermove', drag);
  const release = () => handle.removeEventListener('pointermove', drag);
  for (const kind of ['pointerup', 'pointercancel']) handle.addEventListener(kind, release, { once: true });
}
