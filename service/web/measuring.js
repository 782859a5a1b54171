/** The distance between two points that are clicked on the part. */

import { $ } from './dom.js';
import { plain } from './words.js';

const HINT = 'Click two points on the part.';
let points = [];
let changed = () => {};

$('distance-clear').addEventListener('click', () => clear());
$('distance').addEventListener('toggle', () => clear());

/** onChange : called when the points change */
export function open(onChange) {
  changed = onChange;
  clear();
}

export const shown = () => points;

/** point : in the frame of the design */
export function pick(point) {
  if (!$('distance').open) return;
  points = points.length === 2 ? [point] : [...points, point];
  tell();
}

function clear() {
  points = [];
  tell();
}

function tell() {
  const [a, b] = points;
  if (!b) $('distance-words').textContent = a ? `First point: ${a.map((part) => plain(part).replace('+', '')).join(', ')} mm. Click the second.` : HINT;
  else {
    const steps = a.map((part, k) => b[k] - part);
    $('distance-words').textContent = `${plain(Math.hypot(...steps)).replace('+', '')} mm; ${steps.map((step, k) => `Δ${'xyz'[k]} ${plain(step)}`).join(', ')} mm`;
  }
  changed();
}
