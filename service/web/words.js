/** Texts and colours of numbers, verdicts and segments, the same on the whole page. */

export const MEANING = {
  ok: 'The scan is aligned. This pose fits clearly better than any other.',
  uncertain: 'The scan is aligned, and this pose fits clearly better than any other, but it is not certain that the scan shows this part, undamaged and in this pose. The findings say why. Check the pose before you use it.',
  ambiguous: 'The scan does not show which pose is right: another one, or the mirror image, fits nearly as well, or the scan is flat. The findings say which. Check the pose before you use it.',
  under_constrained: 'The scan can slide or turn on the design with hardly any change of the fit, so this motion of the pose is uncertain. The findings say which motion, and by how much.',
  units_suspect: 'The scan fits only in another unit of length. Send it again with the unit that the findings name.',
  mirrored: 'The scan is the mirror image of the design. No valid alignment was found.',
  no_match: 'No valid alignment was found. The scan shows another part, too little of this one, or a failed print.',
};
/** Instead of `ok`, of a design that is its own image. */
const MEANING_SYMMETRIC = 'The scan is aligned. The design is symmetric: its equivalent poses fit as well, and each is correct. Every other pose fits clearly worse.';
export const meaning = ({ status, findings }) => (status === 'ok' && findings.some(({ code }) => code === 'symmetric_design') ? MEANING_SYMMETRIC : MEANING[status]);
/** Statuses without a pose, and the findings that are about the best pose that was tried, not about the reason. */
export const WITHOUT_POSE = ['mirrored', 'no_match'];
export const ABOUT_POSE = ['free_motion', 'symmetric_design', 'rival_pose', 'weakly_constrained', 'few_landmarks', 'not_converged', 'confidence_not_calibrated'];
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

/** `+0.25`, `−0.5`, `0`: at most 3 digits after the point, fewer where the scale is coarse. size : of the scale in mm */
export function plain(value, size = 1) {
  const digits = size < 0.01 ? 5 : size < 0.1 ? 4 : 3;
  const rounded = Number(Math.abs(value).toFixed(digits));
  return rounded === 0 ? '0' : `${value > 0 ? '+' : '−'}${rounded}`;
}
export const mm = (value) => (value === null || value === undefined ? '-' : `${value.toFixed(3)} mm`);
export const number = (value) => (Math.abs(value) < 0.0005 ? '0.000' : `${value > 0 ? '+' : '−'}${Math.abs(value).toFixed(3)}`);
export const signed = (value) => `${number(value)} mm`;
/** 100.0 % is said of all only, and 0.0 % of nothing only. */
export function percent(share) {
  if (share === null || share === undefined) return '-';
  const text = (100 * share).toFixed(1);
  if (text === '100.0' && share < 1) return '> 99.9 %';
  return text === '0.0' && share > 0 ? '< 0.1 %' : `${text} %`;
}
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
