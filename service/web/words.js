/** Texts and colours of numbers, verdicts and segments, the same on the whole page. */

export const MEANING = {
  ok: 'A pose was found, and no other pose fits equally well.',
  uncertain: 'A pose was found and it is the best by a clear lead, but the evidence is not enough to vouch for it. The findings say what would settle it.',
  ambiguous: 'Several poses fit equally well. Check the pose before you use it.',
  under_constrained: 'The part can slide or rotate along its own surface: the pose is not unique.',
  units_suspect: 'The scan fits only in another length unit. Send it again with the right unit.',
  mirrored: 'The scan is the mirror image of the design. No valid alignment was found.',
  no_match: 'The scan is of another part, or shows too little of this one. No valid alignment was found.',
};
export const MOOD = { ok: 'good', uncertain: 'warn', ambiguous: 'warn', under_constrained: 'warn', units_suspect: 'warn' };
/** Of the alignment, not of the part: nobody is to read `ok` as "the part passed". */
export const alignment = (status) => `alignment: ${status.replaceAll('_', ' ')}`;
/** Of the part. */
export const DECISION = { pass: 'pass', fail: 'fail', not_judged: 'not judged' };
export const DECISION_MOOD = { pass: 'good', fail: 'bad', not_judged: 'warn' };
export const PASSED = { true: 'passed', false: 'failed', null: 'not judged' };
export const FINAL = ['successful', 'failed', 'dismissed'];

// As in pipeline/report/palette.py: the "muted" scheme of Paul Tol.
const PALETTE = ['#332288', '#ddcc77', '#cc6677', '#44aa99', '#882255', '#88ccee', '#117733', '#aa4499', '#999933'];
export const ofSegment = (segment) => PALETTE[segment % PALETTE.length];

export const mm = (value) => (value === null || value === undefined ? '-' : `${value.toFixed(3)} mm`);
export const signed = (value) => `${value >= 0 ? '+' : '−'}${Math.abs(value).toFixed(3)} mm`;
export const percent = (share) => (share === null || share === undefined ? '-' : `${(100 * share).toFixed(1)} %`);
/** 4 digits without trailing zeros; large and small numbers as 1.23·10⁶ */
export function short(value) {
  const size = Math.abs(value);
  if (size < 1e4 && (size >= 1e-3 || size === 0)) return String(Number(value.toPrecision(4)));
  const power = Math.floor(Math.log10(size) + 1e-9);
  const mantissa = Number((value / 10 ** power).toPrecision(3));
  const raised = [...String(power)].map((digit) => (digit === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[digit])).join('');
  return `${mantissa === 1 ? '' : `${mantissa}·`}10${raised}`;
}
export const some = (count, word) => `${count} ${word}${count === 1 ? '' : 's'}`;
export const time = (text) => new Date(text).toLocaleString(undefined, { dateStyle: 'medium', timeStyle: 'short' });
export const size = (bytes) => (bytes < 1e6 ? `${Math.ceil(bytes / 1024)} KiB` : `${(bytes / 1048576).toFixed(1)} MiB`);

/** Of an alternative pose: one row is for all that are equivalent by a symmetry of the design. */
export const standsFor = ({ equivalent_poses: count }) => (count > 1 ? `stands for ${count} equivalent poses` : '');

/** `design.stl ← scan.stl`, or the one mesh; a mesh without a name by the beginning of its hash. */
export function meshes(inputs) {
  const name = (given) => given.filename ?? given.blob.slice(7, 15);
  return inputs.mesh ? name(inputs.mesh) : [inputs.design, inputs.scan].filter(Boolean).map(name).join(' ← ');
}
