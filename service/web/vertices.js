/** `<mesh>.vertices.csv`, read as it comes: the file of a large scan has a million rows.
 *
 * It has a row a vertex of the cleaned mesh, with the values of the nearest vertex of the working mesh. Rows of one such vertex
 * have the same rho and delta to the last digit: by that the decision graph, which is of the working mesh, is found again. */

import * as api from './api.js';

const COLUMNS = ['vertex', 'x_mm', 'y_mm', 'z_mm', 'segment', 'halo', 'rho', 'delta', 't2', 'landmark'];

/** isResampled : false where the cleaned mesh is the working mesh, and equal values are a chance
 *
 * -> {rows: {segment, rho, delta, t2}, by vertex; working: [{vertex, position, segment, isHalo, rho, delta, t2}]} */
export async function read(path, isResampled) {
  const rows = { segment: [], rho: [], delta: [], t2: [] };
  const working = [];
  const seen = new Set();
  let isFirst = true;
  for await (const batch of lines(await api.stream(path))) {
    for (const line of batch) {
      const cells = line.split(',');
      if (!isFirst) add(cells);
      else if (cells.join() !== COLUMNS.join()) throw new Error('vertices.csv has other columns than this page knows');
      isFirst = false;
    }
  }
  return { rows, working };

  function add([vertex, x, y, z, segment, halo, rho, delta, t2]) {
    rows.segment.push(Number(segment));
    rows.rho.push(Number(rho));
    rows.delta.push(Number(delta));
    rows.t2.push(Number(t2));
    const own = isResampled ? `${rho},${delta}` : vertex;
    if (seen.has(own)) return;
    seen.add(own);
    working.push({ vertex: Number(vertex), position: [Number(x), Number(y), Number(z)], segment: Number(segment), isHalo: halo === '1', rho: Number(rho), delta: Number(delta), t2: Number(t2) });
  }
}

/** The lines that came at once, again and again. */
async function* lines(body) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = '';
  for (;;) {
    const { value, done } = await reader.read();
    if (done) break;
    const found = (rest + value).split('\n');
    rest = found.pop();
    yield found;
  }
  if (rest) yield [rest];
}
