/** A cross-section: the outlines of design and scan in a plane, the deviation of the scan drawn larger. */

import * as colours from './colours.js';
import { $ } from './dom.js';
import * as legend from './legend.js';
import { below } from './overlay.js';

const NAMES = 'xyz';
const ACROSS = [[1, 2], [0, 2], [0, 1]]; // the axes of the drawing, of a plane across x, y, z
const MARGIN = 40; // pixels

let now = null; // {viewer, view: {u, v, scale} of the drawing, drawn: its outlines}

for (const id of ['section-axis', 'section-times', 'clip']) $(id).addEventListener('change', () => { if (id === 'section-axis') reach(); draw(); });
$('section-slider').addEventListener('input', () => { $('section-mm').value = Number(Number($('section-slider').value).toFixed(3)); draw(); });
$('section-mm').addEventListener('input', () => { $('section-slider').value = $('section-mm').value; draw(); });
$('section').addEventListener('toggle', () => { if (now) draw(); });
document.addEventListener('recoloured', () => { if (now) draw(); });
$('section-plot').addEventListener('wheel', (event) => {
  if (!now?.view) return;
  event.preventDefault();
  zoom(event, event.deltaY < 0 ? 1.25 : 0.8);
}, { passive: false });
$('section-plot').addEventListener('pointermove', (event) => {
  if (!now?.view || !event.buttons) return;
  const ratio = $('section-plot').width / $('section-plot').clientWidth;
  now.view.u -= (event.movementX * ratio) / now.view.scale;
  now.view.v += (event.movementY * ratio) / now.view.scale;
  paint();
});
$('section-plot').addEventListener('dblclick', () => { if (now) draw(); });

/** The plane begins at the place of the largest deviation. at : {position, normal or null} in the frame of the design */
export function open(viewer, at) {
  now = { viewer, view: null, drawn: null };
  const sizes = (at.normal ?? [0, 0, 1]).map(Math.abs);
  $('section-axis').value = NAMES[sizes.indexOf(Math.min(...sizes))]; // the plane has the normal in it: it shows the deviation in full
  $('section-times').value = '1';
  $('clip').checked = false;
  reach(at.position);
  if ($('section').open) draw();
}

export function close() {
  now = null;
}

/** The ends of the slider. */
function reach(position) {
  if (!now) return;
  const axis = NAMES.indexOf($('section-axis').value);
  const box = now.viewer.box();
  const [low, high] = [box.min.getComponent(axis), box.max.getComponent(axis)];
  const value = position ? position[axis] : (low + high) / 2;
  Object.assign($('section-slider'), { min: low, max: high, step: (high - low) / 500, value });
  $('section-mm').value = Number(value.toFixed(3));
}

function draw() {
  if (!now) return;
  const { viewer } = now;
  const axis = NAMES.indexOf($('section-axis').value);
  const offset = Number($('section-mm').value);
  const isOpen = $('section').open;
  viewer.clip(axis, isOpen && $('clip').checked ? offset : null);
  if (!isOpen) {
    viewer.drawOutline([]);
    return;
  }
  const design = viewer.design.children[0];
  const scan = viewer.scan.children[0];
  const outlines = {
    design: design ? cut(design.geometry, axis, offset) : [],
    scan: scan && !scan.isPoints ? cut(scan.geometry, axis, offset, viewer.values, viewer.scanSide()) : [],
    points: scan?.isPoints ? slab(scan.geometry, axis, offset, viewer.spacing, viewer.values) : [],
  };
  viewer.drawOutline(outlines.design.flatMap(({ ends }) => ends.flatMap(({ at }) => at)));
  now.drawn = outlines;
  now.view = fitting(outlines, axis);
  paint();
  const isEmpty = !outlines.design.length && !outlines.scan.length && !outlines.points.length;
  const times = Number($('section-times').value);
  $('section-note').textContent = isEmpty ? 'The plane misses the part.'
    : `Black: design. Coloured: scan${times > 1 && !scan?.isPoints ? `, its deviation drawn ${times} times as large` : ''}. Wheel zooms, drag moves, a double click shows all.`;
}

/** The segments in which a surface meets the plane: [{ends: [{at, mm, normal}, ...]}], in the frame of its geometry.
 *  values : deviation of each vertex; side : as `Viewer.scanSide` */
export function cut(geometry, axis, offset, values = null, side = 1) {
  const at = geometry.attributes.position.array;
  const normals = geometry.attributes.normal?.array;
  const index = geometry.index?.array;
  const count = index ? index.length : at.length / 3;
  const found = [];
  for (let k = 0; k < count; k += 3) {
    const i0 = index ? index[k] : k;
    const i1 = index ? index[k + 1] : k + 1;
    const i2 = index ? index[k + 2] : k + 2;
    const a = at[3 * i0 + axis] - offset;
    const b = at[3 * i1 + axis] - offset;
    const c = at[3 * i2 + axis] - offset;
    if ((a > 0) === (b > 0) && (b > 0) === (c > 0)) continue; // most of a million: nothing is made for them
    const corners = [i0, i1, i2];
    const ends = [];
    for (const [i, j, from, to] of [[0, 1, a, b], [1, 2, b, c], [2, 0, c, a]]) {
      if ((from > 0) === (to > 0)) continue;
      const share = from / (from - to);
      const mix = (array, part, width) => (1 - share) * array[width * corners[i] + part] + share * array[width * corners[j] + part];
      const isBoth = values && colours.isCounted(values[corners[i]]) && colours.isCounted(values[corners[j]]);
      ends.push({ at: [0, 1, 2].map((part) => mix(at, part, 3)), mm: isBoth ? mix(values, 0, 1) : null, normal: normals ? [0, 1, 2].map((part) => side * mix(normals, part, 3)) : [0, 0, 0] });
    }
    if (ends.length === 2) found.push({ ends });
  }
  return found;
}

/** The points of a cloud within `spacing` / 2 of the plane: [{at, mm}]. */
function slab(geometry, axis, offset, spacing, values) {
  const at = geometry.attributes.position.array;
  const found = [];
  for (let k = 0; k < at.length / 3; k += 1) {
    if (Math.abs(at[3 * k + axis] - offset) < spacing / 2) found.push({ at: [at[3 * k], at[3 * k + 1], at[3 * k + 2]], mm: values && colours.isCounted(values[k]) ? values[k] : null });
  }
  return found;
}

/** Where a point of the scan is drawn, its deviation so many times as large. */
function drawnAt({ at, mm, normal }) {
  const times = Number($('section-times').value);
  return mm === null ? at : at.map((part, k) => part + (times - 1) * mm * normal[k]);
}

function fitting({ design, scan, points }, axis) {
  const [u, v] = ACROSS[axis];
  const apart = scan.flatMap(({ ends }) => ends.map((end) => ({ at: drawnAt(end) })));
  const all = [...design.flatMap(({ ends }) => ends), ...apart, ...points];
  if (!all.length) return null;
  const { width, height } = $('section-plot');
  const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
  for (const { at } of all) {
    [u, v].forEach((part, k) => {
      low[k] = Math.min(low[k], at[part]);
      high[k] = Math.max(high[k], at[part]);
    });
  }
  const scale = Math.min((width - 2 * MARGIN) / Math.max(high[0] - low[0], 1e-6), (height - 2 * MARGIN) / Math.max(high[1] - low[1], 1e-6));
  return { u: (low[0] + high[0]) / 2, v: (low[1] + high[1]) / 2, scale };
}

function zoom(event, by) {
  const plot = $('section-plot');
  const ratio = plot.width / plot.clientWidth;
  const { view } = now;
  const du = (event.offsetX * ratio - plot.width / 2) / view.scale;
  const dv = (plot.height / 2 - event.offsetY * ratio) / view.scale;
  view.u += du * (1 - 1 / by);
  view.v += dv * (1 - 1 / by);
  view.scale *= by;
  paint();
}

function paint() {
  const plot = $('section-plot');
  const pen = plot.getContext('2d');
  pen.clearRect(0, 0, plot.width, plot.height);
  if (!now?.view) return;
  const { view, drawn } = now;
  const axis = NAMES.indexOf($('section-axis').value);
  const [u, v] = ACROSS[axis];
  const ink = getComputedStyle(plot).color;
  const scale = legend.current();
  const place = (at) => [plot.width / 2 + (at[u] - view.u) * view.scale, plot.height / 2 - (at[v] - view.v) * view.scale];
  const colour = (mm) => (mm === null || !scale ? 'rgb(128 128 128)' : `rgb(${strong(colours.of(mm, scale))})`);
  const line = (from, to) => {
    pen.beginPath();
    pen.moveTo(...place(from));
    pen.lineTo(...place(to));
    pen.stroke();
  };
  pen.lineCap = 'round';
  pen.strokeStyle = ink;
  pen.lineWidth = 1.6;
  for (const { ends: [a, b] } of drawn.design) line(a.at, b.at);
  pen.lineWidth = 3;
  for (const { ends: [a, b] } of drawn.scan) {
    pen.strokeStyle = colour(a.mm === null || b.mm === null ? null : (a.mm + b.mm) / 2);
    line(drawnAt(a), drawnAt(b));
  }
  for (const { at, mm } of drawn.points) {
    pen.fillStyle = colour(mm);
    const [x, y] = place(at);
    pen.fillRect(x - 2, y - 2, 4, 4);
  }
  furniture(pen, plot, view, ink, NAMES[u], NAMES[v]);
}

/** Neutral grey would not show beside a grey page: darker, the more neutral. */
function strong(rgb) {
  const spread = Math.max(...rgb) - Math.min(...rgb);
  return rgb.map((part) => Math.round(part * (spread > 60 ? 0.9 : 0.55)));
}

function furniture(pen, plot, view, ink, across, up) {
  const length = below(160 / view.scale);
  const pixels = length * view.scale;
  const [x, y] = [plot.width - pixels - 20, plot.height - 16];
  pen.strokeStyle = ink;
  pen.fillStyle = ink;
  pen.lineWidth = 1.6;
  pen.font = '20px system-ui, sans-serif';
  pen.beginPath();
  pen.moveTo(x, y - 8);
  pen.lineTo(x, y);
  pen.lineTo(x + pixels, y);
  pen.lineTo(x + pixels, y - 8);
  pen.moveTo(24, y - 60);
  pen.lineTo(24, y);
  pen.lineTo(84, y);
  pen.stroke();
  pen.textAlign = 'center';
  pen.fillText(`${Number(length.toPrecision(3))} mm`, x + pixels / 2, y - 12);
  pen.fillText(across, 98, y + 6);
  pen.fillText(up, 24, y - 68);
}
