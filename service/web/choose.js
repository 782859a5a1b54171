/** Which vertices thresholds or a number would make centres: what pipeline/kernels/density_peaks.py does, for a preview. */

/** points : {rho, delta}; the densest is always one. -> indices, largest rho * delta first */
export function byThresholds(points, rhoMin, deltaMin) {
  const densest = densestOf(points);
  return ordered(points, numbers(points).filter((k) => k === densest || (points[k].rho >= rhoMin && points[k].delta >= deltaMin)));
}

export function byNumber(points, count) {
  const densest = densestOf(points);
  const others = ordered(points, numbers(points).filter((k) => k !== densest));
  return ordered(points, [densest, ...others.slice(0, Math.max(0, count - 1))]);
}

const numbers = (points) => points.map((_, k) => k);
const densestOf = (points) => points.reduce((best, each, k) => (each.rho > points[best].rho ? k : best), 0);
const ordered = (points, found) => [...found].sort((a, b) => points[b].rho * points[b].delta - points[a].rho * points[a].delta);
