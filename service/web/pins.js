/** The places of a registration that a person must see: the ends of the deviation, and the points that were to be inspected. */

import { signed } from './words.js';

const DIFFERS = 0.0005; // mm: the surface that is shown has fewer vertices than the file, and may miss the extreme
const MOODS = { true: 'good', false: 'bad', null: 'warn' };

/** [{words, position, normal, mood}], in the frame of the design. viewer : with a scan and its values */
export function pins(viewer, { deviation, inspection }) {
  const ends = viewer.extremes().map((each, k) => {
    const ofAll = k ? deviation.max_mm : deviation.min_mm;
    const name = `${k ? 'max' : 'min'}${Math.abs(ofAll - each.mm) > DIFFERS ? ' shown' : ''}`;
    return { ...each, words: `${name} ${signed(each.mm)}`, normal: each.normal ?? viewer.normalOfDesign(each.position) };
  });
  const points = (inspection?.checks ?? []).filter(({ kind, position_mm: position }) => kind === 'point' && position);
  return [...ends, ...points.map(({ name, value, passed, position_mm: position }) => ({
    words: `${name} ${value === null ? 'not measured' : signed(value)}`, position, normal: viewer.normalOfDesign(position), mood: MOODS[passed],
  }))];
}

/** The vertex that lies farthest off: {position, normal}. */
export function worst(viewer) {
  const [farthest] = viewer.extremes().sort((a, b) => Math.abs(b.mm) - Math.abs(a.mm));
  const position = farthest?.position ?? [0, 0, 0];
  return { position, normal: farthest?.normal ?? viewer.normalOfDesign(position) };
}
