/** The legend of the deviation: colours in mm, the histogram over them, the tolerance, and the shares within, above, below. */

import * as colours from './colours.js';
import { $, element } from './dom.js';
import { percent } from './words.js';

const BINS = 81; // odd: one stands on zero
const SIGN = {
  closed: 'Blue: material is missing; red: too much.',
  open: 'Blue: below the design; red: above it, on the side of its face normals.',
  none: 'The face normals of the design are inconsistent: distances have no sign.',
};

let now = null; // {viewer, deviation, limit}

$('tolerance').addEventListener('input', () => { $('tolerance-mm').value = Number($('tolerance').value); recolour(); });
$('tolerance-mm').addEventListener('input', () => { $('tolerance').value = $('tolerance-mm').value; recolour(); });

/** viewer : with a scan and its values; deviation : of the results */
export function open(viewer, deviation) {
  const given = deviation.tolerance_mm ?? 0;
  const limit = colours.roundUp(Math.max(Math.abs(deviation.p01_mm), Math.abs(deviation.p99_mm), 2 * given));
  now = { viewer, deviation, limit };
  Object.assign($('tolerance'), { max: limit, step: limit / 200, value: given });
  Object.assign($('tolerance-mm'), { max: limit, step: 'any', value: given });
  recolour();
}

export function close() {
  now = null;
}

function recolour() {
  if (!now) return;
  const { viewer, limit } = now;
  const tolerance = Math.min(Math.max(Number($('tolerance-mm').value) || 0, 0), limit);
  viewer.recolour(limit, tolerance);
  drawScale(limit, tolerance);
  drawHistogram(viewer, limit, tolerance);
  $('ticks').replaceChildren(...[-1, -0.5, 0, 0.5, 1].map((share) => element('span', share ? `${share > 0 ? '+' : '−'}${Number((Math.abs(share) * limit).toPrecision(2))}` : '0 mm')));
  $('within').textContent = `${shares(tolerance)}${SIGN[now.deviation.sign]} Dark grey: on an open border, not counted.`;
}

/** As the results have them for the tolerance of the job; for another one, of the area of the surface that is shown. */
function shares(tolerance) {
  if (!tolerance) return '';
  const { viewer, deviation } = now;
  let { within, above, below } = deviation;
  if (tolerance !== deviation.tolerance_mm) {
    let sum = 0;
    [within, above, below] = [0, 0, 0];
    viewer.values.forEach((value, k) => {
      if (!colours.isCounted(value)) return;
      sum += viewer.areas[k];
      if (value > tolerance) above += viewer.areas[k];
      else if (value < -tolerance) below += viewer.areas[k];
      else within += viewer.areas[k];
    });
    [within, above, below] = [within, above, below].map((each) => each / (sum || 1));
  }
  return `${percent(within)} of the area lies within the tolerance, ${percent(above)} above, ${percent(below)} below. `;
}

function drawScale(limit, tolerance) {
  const { width, height } = $('scale');
  const pen = $('scale').getContext('2d');
  for (let x = 0; x < width; x += 1) {
    pen.fillStyle = `rgb(${colours.of((((x + 0.5) / width) * 2 - 1) * limit, limit, tolerance).map(Math.round)})`;
    pen.fillRect(x, 0, 1, height);
  }
}

/** Share of the area by deviation; what lies beyond stands in the last bars. */
function drawHistogram({ values, areas }, limit, tolerance) {
  const bins = new Float64Array(BINS);
  values.forEach((value, k) => {
    if (colours.isCounted(value)) bins[Math.min(BINS - 1, Math.max(0, Math.floor(((value / limit + 1) / 2) * BINS)))] += areas[k];
  });
  const { width, height } = $('histogram');
  const pen = $('histogram').getContext('2d');
  const most = bins.reduce((a, b) => Math.max(a, b), 0) || 1;
  pen.clearRect(0, 0, width, height);
  const step = width / BINS;
  bins.forEach((area, k) => {
    const tall = (area / most) * (height - 2);
    pen.fillStyle = `rgb(${colours.of((((k + 0.5) / BINS) * 2 - 1) * limit, limit, tolerance).map(Math.round)})`;
    pen.fillRect(k * step, height - tall, step - 0.5, tall);
    pen.strokeStyle = 'rgb(110 116 126)';
    pen.lineWidth = 0.5;
    pen.strokeRect(k * step, height - tall, step - 0.5, tall);
  });
  if (!tolerance) return;
  pen.fillStyle = getComputedStyle($('histogram')).color;
  for (const side of [-1, 1]) pen.fillRect(((side * tolerance) / limit + 1) * (width / 2) - 1, 0, 2, height);
}

export { recolour as redraw };
