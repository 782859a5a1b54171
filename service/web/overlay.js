/** What is drawn over the part, sharp at any zoom: axes, scale bar, pins with their labels, the measured distance. */

import { plain } from './words.js';

const SVG = 'http://www.w3.org/2000/svg';
const AXES = [['x', [1, 0, 0]], ['y', [0, 1, 0]], ['z', [0, 0, 1]]];
const TRIAD = 30; // pixels
const BAR = 110; // pixels, at most
const LINE = 20; // height of a label
const LETTER = 7.1; // width of a letter of the label's font
const EDGE = 8;

/** viewer : of which the svg lies on the canvas; pins : {words, position, normal or null}; points : of the measured distance;
 *  plane : corners of the section, or null */
export function draw(svg, viewer, pins, points, plane) {
  const { clientWidth: width, clientHeight: height } = viewer.canvas;
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  svg.replaceChildren();
  const put = (tag, attributes, words) => {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (words !== undefined) made.textContent = words;
    svg.append(made);
  };
  if (plane) put('polygon', { points: plane.map((each) => viewer.view.toScreen(each).slice(0, 2).join()).join(' '), class: 'plane' });
  drawPins(put, viewer, pins, width, height);
  drawDistance(put, viewer, points);
  drawTriad(put, viewer, height);
  drawBar(put, viewer, width, height);
}

function drawTriad(put, viewer, height) {
  const turn = viewer.view.camera.matrixWorldInverse.elements;
  const at = [TRIAD + 16, height - TRIAD - 16];
  const ends = AXES.map(([name, [x, y, z]]) => [name, turn[0] * x + turn[4] * y + turn[8] * z, turn[1] * x + turn[5] * y + turn[9] * z, turn[2] * x + turn[6] * y + turn[10] * z]);
  for (const [name, x, y] of ends.sort((a, b) => a[3] - b[3])) { // the axis nearest to the eye last
    put('line', { x1: at[0], y1: at[1], x2: at[0] + TRIAD * x, y2: at[1] - TRIAD * y, class: `axis ${name}` });
    put('text', { x: at[0] + 1.32 * TRIAD * x, y: at[1] - 1.32 * TRIAD * y + 4, 'text-anchor': 'middle', class: 'label' }, name);
  }
}

/** A round length in mm; in a perspective it is true at the centre of the part. */
function drawBar(put, viewer, width, height) {
  const length = below(BAR * viewer.view.mmPerPixel());
  const pixels = length / viewer.view.mmPerPixel();
  const [left, y] = [width - pixels - 16, height - 16];
  put('path', { d: `M${left} ${y - 5}v5h${pixels}v-5`, class: 'bar' });
  put('text', { x: left + pixels / 2, y: y - 6, 'text-anchor': 'middle', class: 'label' }, `${Number(length.toPrecision(3))} mm`);
}

/** The largest of 1, 2, 5 times a power of ten that is no larger. */
export function below(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [5, 2, 1].find((step) => step * power <= value) * power;
}

/** Labels stand in two columns at the edges, in the order of their places, so that none covers another or the part's middle. */
function drawPins(put, viewer, pins, width, height) {
  const eye = viewer.view.eye();
  const placed = pins.map((pin) => {
    const [x, y] = viewer.view.toScreen(pin.position);
    const isHidden = pin.normal && pin.normal.reduce((sum, part, k) => sum + part * eye[k], 0) < 0;
    return { ...pin, x, y, isHidden };
  });
  const middle = placed.reduce((sum, { x }) => sum + x, 0) / (placed.length || 1);
  const isLeft = ({ x }) => (placed.length > 1 ? x <= Math.max(0.3 * width, Math.min(middle, 0.7 * width)) : x <= width / 2);
  for (const side of [true, false]) {
    const column = placed.filter((pin) => isLeft(pin) === side).sort((a, b) => a.y - b.y);
    const tops = spread(column.map(({ y }) => y), EDGE + LINE, height - 2 * TRIAD - 40);
    column.forEach(({ words, x, y, isHidden, mood }, k) => {
      const wide = LETTER * words.length + 12;
      const left = side ? EDGE : width - wide - EDGE;
      const end = side ? left + wide : left;
      put('path', { d: `M${x} ${y}L${end} ${tops[k]}`, class: isHidden ? 'lead hidden' : 'lead' });
      put('circle', { cx: x, cy: y, r: 4.5, class: isHidden ? 'pin hidden' : 'pin' });
      put('rect', { x: left, y: tops[k] - LINE / 2, width: wide, height: LINE - 2, rx: 3, class: `plate ${mood ?? ''}` });
      put('text', { x: left + wide / 2, y: tops[k] + 3.5, 'text-anchor': 'middle', class: 'words' }, words);
    });
  }
}

/** Heights near the wanted ones, at least a line apart, between the ends. */
export function spread(wanted, first, last) {
  const found = [];
  wanted.forEach((y, k) => found.push(Math.max(y, first, k ? found[k - 1] + LINE : first)));
  for (let k = found.length - 1, end = last; k >= 0; k -= 1, end -= LINE) if (found[k] > end) found[k] = end;
  return found;
}

function drawDistance(put, viewer, points) {
  const at = points.map((each) => viewer.view.toScreen(each));
  if (at.length === 2) {
    put('line', { x1: at[0][0], y1: at[0][1], x2: at[1][0], y2: at[1][1], class: 'ruler' });
    const words = `${plain(Math.hypot(...points[0].map((part, k) => part - points[1][k]))).replace('+', '')} mm`;
    put('text', { x: (at[0][0] + at[1][0]) / 2, y: (at[0][1] + at[1][1]) / 2 - 6, 'text-anchor': 'middle', class: 'label' }, words);
  }
  for (const [x, y] of at) put('circle', { cx: x, cy: y, r: 4, class: 'ruler' });
}
