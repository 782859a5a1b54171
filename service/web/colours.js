/** The colours of the deviation, the same as in every file of a job: Moreland's diverging map, neutral within the tolerance. */

const STOPS = [[59, 76, 192], [77, 104, 215], [98, 130, 234], [119, 154, 247], [141, 176, 254], [163, 194, 255], [184, 208, 249], [204, 217, 238], [221, 221, 221], [236, 211, 197], [245, 196, 173], [247, 177, 148], [244, 154, 123], [236, 127, 99], [222, 96, 77], [203, 62, 56], [180, 4, 38]];
// As in pipeline/report/colormap.py: what a scan can show at least, so that rounding noise has no colour.
const RESOLUTION_SIGMAS = 2; // of the scanner's accuracy, else of the noise of the scan
const RESOLUTION_SHARE = 1e-4; // of the diagonal of the design
export const NOT_COUNTED = [115, 115, 115];
/** glTF has no NaN: what is not counted is 1e31. */
export const isCounted = (mm) => Number.isFinite(mm) && mm < 1e30;

/** share in [-1, 1] -> [r, g, b] of 255 */
export function at(share) {
  const place = ((Math.min(1, Math.max(-1, share)) + 1) / 2) * (STOPS.length - 1);
  const low = Math.min(Math.floor(place), STOPS.length - 2);
  return STOPS[low].map((part, k) => part + (place - low) * (STOPS[low + 1][k] - part));
}

/** scale : {low, high, lower, upper, bands}: its ends and the tolerance in mm (low < lower <= 0 <= upper < high), and the number
 *  of bands on each side, 0 for a smooth scale */
export function of(mm, { low, high, lower, upper, bands }) {
  const share = mm > 0 ? Math.max(mm - upper, 0) / Math.max(high - upper, 1e-12) : -Math.max(lower - mm, 0) / Math.max(lower - low, 1e-12);
  if (!bands) return at(share);
  return at((Math.sign(share) * Math.ceil(Math.min(Math.abs(share), 1) * bands - 1e-9)) / bands);
}

/** Least end of a scale in mm. scan : `scan` of the results, which earlier versions do not have; sd : of the deviations, as the
 *  noise of few points is overestimated */
export function resolution(scan, diagonal, sd) {
  return Math.max(RESOLUTION_SIGMAS * (scan?.accuracy_mm ?? Math.min(scan?.noise_mm ?? 0, sd)), RESOLUTION_SHARE * diagonal);
}

/** The next of 1, 1.5, 2, 3, 5, 7.5 times a power of ten. */
export function roundUp(value) {
  if (!(value > 1e-6)) return 1e-6;
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 1.5, 2, 3, 5, 7.5, 10].find((step) => step * power >= value * (1 - 1e-9)) * power;
}
