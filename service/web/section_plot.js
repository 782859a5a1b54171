/** The drawing of a cross-section: outlines in the plane, zoomed and moved by hand. */

import { $ } from './dom.js';
import { below } from './overlay.js';

const NAMES = 'xyz';
export const ACROSS = [[1, 2], [0, 2], [0, 1]]; // the axes of the drawing, of a plane across x, y, z
const MARGIN = 40; // pixels

let now = null; // {outlines: {design, scan, points} of section.js, axis, colour: of a deviation in mm, view: {u, v, scale}}

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
$('section-plot').addEventListener('dblclick', () => { if (now) show(now.outlines, now.axis, now.colour); });

/** All of the outlines. colour : deviation in mm -> [r, g, b] of 255 */
export function show(outlines, axis, colour) {
  now = { outlines, axis, colour, view: null };
  now.view = fitting();
  paint();
}

export function clear() {
  now = null;
}

function fitting() {
  const { outlines: { design, scan, points }, axis } = now;
  const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
  const take = (at) => ACROSS[axis].forEach((part, k) => {
    low[k] = Math.min(low[k], at[part]);
    high[k] = Math.max(high[k], at[part]);
  });
  for (const { ends } of [...design, ...scan]) for (const { at } of ends) take(at);
  for (const { at } of points) take(at);
  if (low[0] === Infinity) return null;
  const { width, height } = $('section-plot');
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
  const { view, outlines, axis, colour } = now;
  const [u, v] = ACROSS[axis];
  const ink = getComputedStyle(plot).color;
  const place = (at) => [plot.width / 2 + (at[u] - view.u) * view.scale, plot.height / 2 - (at[v] - view.v) * view.scale];
  const css = (mm) => `rgb(${colour(mm)})`;
  const line = (from, to) => {
    pen.beginPath();
    pen.moveTo(...place(from));
    pen.lineTo(...place(to));
    pen.stroke();
  };
  pen.lineCap = 'round';
  pen.strokeStyle = ink;
  pen.lineWidth = 1.6;
  for (const { ends: [a, b] } of outlines.design) line(a.at, b.at);
  pen.lineWidth = 3;
  for (const { ends: [a, b] } of outlines.scan) {
    pen.strokeStyle = css(a.mm === null || b.mm === null ? null : (a.mm + b.mm) / 2);
    line(a.at, b.at);
  }
  for (const { at, mm } of outlines.points) {
    pen.fillStyle = css(mm);
    const [x, y] = place(at);
    pen.fillRect(x - 2, y - 2, 4, 4);
  }
  furniture(pen, plot, view, ink, NAMES[u], NAMES[v]);
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
