/** Wires of regions: (6 k) ends of lines, mm. */

const AROUND = 48;

/** low, high : corners */
export function box(low, high) {
  const ends = [];
  for (let axis = 0; axis < 3; axis += 1) {
    const [u, v] = [0, 1, 2].filter((each) => each !== axis);
    for (const [a, b] of [[low, low], [low, high], [high, low], [high, high]]) {
      for (const end of [low, high]) {
        const at = [0, 0, 0];
        [at[axis], at[u], at[v]] = [end[axis], a[u], b[v]];
        ends.push(...at);
      }
    }
  }
  return ends;
}

/** Its three great circles along the axes. */
export function sphere(centre, radius) {
  const ends = [];
  for (let axis = 0; axis < 3; axis += 1) {
    const [u, v] = [0, 1, 2].filter((each) => each !== axis);
    for (let k = 0; k < AROUND; k += 1) {
      for (const step of [k, k + 1]) {
        const at = [...centre];
        at[u] += radius * Math.cos((2 * Math.PI * step) / AROUND);
        at[v] += radius * Math.sin((2 * Math.PI * step) / AROUND);
        ends.push(...at);
      }
    }
  }
  return ends;
}
