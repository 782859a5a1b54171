/** The legend of the deviation: colours in mm, the histogram over them, the tolerance, and the shares within, above, below. */

import * as colours from './colours.js';
import { $, element } from './dom.js';
import { percent, plain } from './words.js';

const BINS = 81; // odd: one stands on zero
const SIGN = {
  closed: 'Blue: material is missing; red: too much.',
  open: 'Blue: below the surface of the design; red: above it, on the side that its normals point to. The back of a face is shaded.',
  none: 'The faces of the design have no consistent orientation: distances have no sign.',
};

let now = null; // {viewer, deviation, ends: the automatic end of the scale, edited: what was typed, or null}

const typed = (id) => ($(id).value === '' ? NaN : Number($(id).value));
$('tolerance').addEventListener('input', () => symmetric(Number($('tolerance').value)));
$('tolerance-mm').addEventListener('input', () => symmetric(typed('tolerance-mm')));
for (const id of ['scale-low', 'scale-high', 'tolerance-low', 'tolerance-high', 'scale-kind']) $(id).addEventListener('input', edit);
$('scale-reset').addEventListener('click', () => now && open(now.viewer, now.results));

/** viewer : with a scan and its values */
export function open(viewer, results) {
  const { deviation } = results;
  const tolerance = deviation.tolerance_mm ?? 0;
  const least = colours.resolution(results.scan, viewer.diagonal(), deviation.sd_mm);
  const needed = Math.max(Math.abs(deviation.p01_mm), Math.abs(deviation.p99_mm), least);
  now = { viewer, results, deviation, needed, lower: -tolerance, upper: tolerance, low: null, high: null, bands: 0 };
  $('scale-kind').value = '0';
  $('sign').textContent = `${SIGN[deviation.sign]} Dark grey: on an open border, not counted.`;
  recolour();
}

export function close() {
  now = null;
}

function symmetric(tolerance) {
  if (!now) return;
  const size = tolerance > 0 ? tolerance : 0;
  Object.assign(now, { lower: -size, upper: size });
  recolour();
}

function edit() {
  if (!now) return;
  const or = (value, before, isRight) => (Number.isFinite(value) && isRight(value) ? value : before);
  const isNegative = (value) => value <= 0;
  const isPositive = (value) => value >= 0;
  const active = document.activeElement?.id;
  if (active === 'scale-low') now.low = or(typed('scale-low'), now.low, (value) => value < 0);
  if (active === 'scale-high') now.high = or(typed('scale-high'), now.high, (value) => value > 0);
  now.lower = or(typed('tolerance-low'), now.lower, isNegative);
  now.upper = or(typed('tolerance-high'), now.upper, isPositive);
  now.bands = Number($('scale-kind').value);
  recolour();
}

/** The ends take in the tolerance twice, whatever was typed: beyond it there must be room for colour. */
function scale() {
  const { needed, lower, upper, bands } = now;
  const end = colours.roundUp(Math.max(needed, 2 * upper, -2 * lower));
  const low = now.low !== null && now.low < lower ? now.low : -end;
  const high = now.high !== null && now.high > upper ? now.high : end;
  return { low, high, lower, upper, bands };
}

/** The colour scale that is shown, of any panel that draws deviations; null without one. */
export const current = () => (now ? scale() : null);

function recolour() {
  if (!now) return;
  const shown = scale();
  dress(shown);
  now.viewer.recolour(shown);
  drawScale(shown);
  drawHistogram(now.viewer.scan, shown);
  const { low, high, lower, upper } = shown;
  $('ticks').replaceChildren(...ticks(shown).map((mm) => {
    const tick = element('span', mm === 0 ? '0 mm' : plain(mm, Math.max(high, -low)));
    tick.style.left = `${(100 * (mm - low)) / (high - low)}%`;
    return tick;
  }));
  $('within').textContent = shares(lower, upper);
  document.dispatchEvent(new CustomEvent('recoloured'));
}

function dress({ low, high, lower, upper }) {
  const write = (id, value) => { if (document.activeElement !== $(id)) $(id).value = value; };
  const isSymmetric = Math.abs(upper + lower) < 1e-12;
  Object.assign($('tolerance'), { max: Math.max(high, -low), step: Math.max(high, -low) / 200 });
  write('tolerance', Math.max(upper, -lower));
  write('tolerance-mm', isSymmetric ? upper : '');
  write('scale-low', low);
  write('scale-high', high);
  write('tolerance-low', lower);
  write('tolerance-high', upper);
}

/** The ends, zero and what lies between without crowding: the limits of the tolerance first. */
function ticks({ low, high, lower, upper }) {
  const room = 0.14 * (high - low);
  const found = [low, high, 0];
  for (const mm of [lower, upper, low / 2, high / 2]) if (found.every((each) => Math.abs(each - mm) > room)) found.push(mm);
  return found.sort((a, b) => a - b);
}

/** As the results have them for the tolerance of the job; for another one, of the area of the surface that is shown. */
function shares(lower, upper) {
  if (!upper && !lower) return '';
  const { viewer, deviation } = now;
  let { within, above, below } = deviation;
  if (upper !== deviation.tolerance_mm || lower !== -deviation.tolerance_mm) {
    let sum = 0;
    [within, above, below] = [0, 0, 0];
    const { values, areas } = viewer.scan;
    for (let k = 0; k < values.length; k += 1) {
      if (!colours.isCounted(values[k])) continue;
      sum += areas[k];
      if (values[k] > upper) above += areas[k];
      else if (values[k] < lower) below += areas[k];
      else within += areas[k];
    }
    [within, above, below] = [within, above, below].map((each) => each / (sum || 1));
  }
  const what = viewer.isCloud ? 'points lie' : 'area lies';
  return `${percent(within)} of the ${what} within the tolerance, ${percent(above)} above, ${percent(below)} below.`;
}

const middle = (k, count, { low, high }) => low + ((k + 0.5) / count) * (high - low);
const css = (mm, shown) => `rgb(${colours.of(mm, shown).map(Math.round)})`;

function drawScale(shown) {
  const { width, height } = $('scale');
  const pen = $('scale').getContext('2d');
  for (let x = 0; x < width; x += 1) {
    pen.fillStyle = css(middle(x, width, shown), shown);
    pen.fillRect(x, 0, 1, height);
  }
}

/** Share of the area by deviation; what lies beyond stands in the last bars. */
function drawHistogram({ values, areas }, shown) {
  const { low, high, lower, upper } = shown;
  const bins = new Float64Array(BINS);
  for (let k = 0; k < values.length; k += 1) {
    if (colours.isCounted(values[k])) bins[Math.min(BINS - 1, Math.max(0, Math.floor(((values[k] - low) / (high - low)) * BINS)))] += areas[k];
  }
  const { width, height } = $('histogram');
  const pen = $('histogram').getContext('2d');
  const most = bins.reduce((a, b) => Math.max(a, b), 0) || 1;
  pen.clearRect(0, 0, width, height);
  const step = width / BINS;
  bins.forEach((area, k) => {
    const tall = (area / most) * (height - 2);
    pen.fillStyle = css(middle(k, BINS, shown), shown);
    pen.fillRect(k * step, height - tall, step - 0.5, tall);
    pen.strokeStyle = 'rgb(110 116 126)';
    pen.lineWidth = 0.5;
    pen.strokeRect(k * step, height - tall, step - 0.5, tall);
  });
  pen.fillStyle = getComputedStyle($('histogram')).color;
  for (const mm of [lower, upper]) if (mm) pen.fillRect(((mm - low) / (high - low)) * width - 1, 0, 2, height);
}

export { recolour as redraw };
