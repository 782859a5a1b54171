/** One mesh: its segments and landmarks. */

import * as centres from './centres.js';
import { $, figure } from './dom.js';
import * as part from './part.js';
import { percent, short } from './words.js';

export async function show(job, results, sizes, signal) {
  const { count, d_c: dC, halo_fraction: halo, limit_share: limit } = results.segments.mesh;
  $('figures').replaceChildren(...[
    ['segments', String(count)],
    ['landmarks', String(results.landmarks.mesh.length)],
    ['cut-off distance', `${short(dC)} mm`],
    ['halo', percent(halo)],
    ['beyond the T² limit', percent(limit)],
  ].map(figure));
  $('how').hidden = false;
  $('how').open = true;
  $('why').hidden = true;
  $('measure').hidden = true;
  $('how-figures').replaceChildren();
  const isShown = sizes.has('mesh.segments.ply');
  $('viewer').hidden = !isShown;
  const shown = isShown ? part.openMesh(job, results, signal) : null;
  await Promise.all([shown, centres.open(job, results, shown && part.panel, sizes, signal)]);
}
