/** Coarser levels of a surface, which are drawn while the view moves. They are other lists of the same vertices, so that colours, hidden segments and
 *  cuts hold for them too. */

const MANY = 50_000; // triangles or points: fewer are always drawn whole
const RATIO = 4; // of a level to the next
const COARSEST = 8_000; // triangles or points, about
const CELLS = 1.5; // occupied cells of a grid, times the area of a cell, over the area of the surface
const FACES = 2; // triangles of a closed mesh for each vertex
const ACROSS = 2 ** 16; // cells along an axis, at most: far more than the levels have

/** Of triangles: [Uint32Array (3 m)], finer ones first. positions, normals : (3 n); index : (3 m) */
export function ofMesh(positions, normals, index) {
  const found = [];
  for (let wanted = index.length / 3 / RATIO, from = index; index.length / 3 > MANY && wanted >= COARSEST; wanted /= RATIO) {
    from = clustered(positions, normals, from, Math.sqrt((CELLS * FACES * area(positions, from)) / wanted));
    found.push(from);
  }
  return found;
}

/** Of a cloud of n points: [Uint32Array], every fourth of the level before. */
export function ofCloud(n) {
  const found = [];
  if (n <= MANY) return found;
  for (let step = RATIO; n / step >= COARSEST; step *= RATIO) found.push(Uint32Array.from({ length: Math.ceil(n / step) }, (_, k) => k * step));
  return found;
}

function area(at, index) {
  let sum = 0;
  for (let k = 0; k < index.length; k += 3) {
    const [a, b, c] = [3 * index[k], 3 * index[k + 1], 3 * index[k + 2]];
    const [ux, uy, uz] = [at[b] - at[a], at[b + 1] - at[a + 1], at[b + 2] - at[a + 2]];
    const [vx, vy, vz] = [at[c] - at[a], at[c + 1] - at[a + 1], at[c + 2] - at[a + 2]];
    sum += Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 2;
  }
  return sum;
}

/** Vertex clustering (Rossignac and Borrel 1993): the vertices of a cell whose normals look the same way become the one that lies nearest to their
 *  mean. The sides of a thin wall stay apart. size : of a cell, mm */
function clustered(at, normals, index, size) {
  const { count, of } = cellsOf(at, normals, index, size);
  const sums = new Float64Array(4 * count);
  const eachVertex = (act) => of.forEach((cell, vertex) => { if (cell >= 0) act(cell, vertex); });
  eachVertex((cell, vertex) => {
    for (let part = 0; part < 3; part += 1) sums[4 * cell + part] += at[3 * vertex + part];
    sums[4 * cell + 3] += 1;
  });
  const nearest = new Float64Array(count).fill(Infinity);
  const chosen = new Uint32Array(count);
  eachVertex((cell, vertex) => {
    let square = 0;
    for (let part = 0; part < 3; part += 1) square += (at[3 * vertex + part] - sums[4 * cell + part] / sums[4 * cell + 3]) ** 2;
    if (square < nearest[cell]) [nearest[cell], chosen[cell]] = [square, vertex];
  });
  const found = new Uint32Array(index.length);
  let length = 0;
  for (let k = 0; k < index.length; k += 3) {
    const [a, b, c] = [of[index[k]], of[index[k + 1]], of[index[k + 2]]];
    if (a === b || b === c || c === a) continue;
    const corners = [chosen[a], chosen[b], chosen[c]];
    for (const vertex of isTurned(at, normals, corners) ? corners.reverse() : corners) found[length++] = vertex;
  }
  return found.slice(0, length);
}

/** {count, of: (n) number of the cell of each vertex, -1 for those that no triangle has} */
function cellsOf(at, normals, index, size) {
  const of = new Int32Array(at.length / 3).fill(-1);
  const numbers = new Map();
  for (const vertex of index) {
    if (of[vertex] >= 0) continue;
    let key = sideOf(normals, vertex);
    for (let part = 0; part < 3; part += 1) key = key * ACROSS + ACROSS / 2 + Math.floor(at[3 * vertex + part] / size);
    if (!numbers.has(key)) numbers.set(key, numbers.size);
    of[vertex] = numbers.get(key);
  }
  return { count: numbers.size, of };
}

/** Whether a triangle faces against the normals of its corners. */
function isTurned(at, normals, [a, b, c]) {
  let volume = 0;
  for (let x = 0; x < 3; x += 1) {
    const [y, z] = [(x + 1) % 3, (x + 2) % 3];
    const across = (at[3 * b + y] - at[3 * a + y]) * (at[3 * c + z] - at[3 * a + z]) - (at[3 * b + z] - at[3 * a + z]) * (at[3 * c + y] - at[3 * a + y]);
    volume += across * (normals[3 * a + x] + normals[3 * b + x] + normals[3 * c + x]);
  }
  return volume < 0;
}

/** Which of the six directions of the axes a normal is nearest to: 0 to 5 */
function sideOf(normals, vertex) {
  let best = 0;
  for (let part = 1; part < 3; part += 1) if (Math.abs(normals[3 * vertex + part]) > Math.abs(normals[3 * vertex + best])) best = part;
  return 2 * best + (normals[3 * vertex + best] < 0 ? 1 : 0);
}
