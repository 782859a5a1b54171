/** The segments of the design by name: shown and hidden, on the design and on the scan, and the scan in their colours. */

import * as api from './api.js';
import * as centres from './centres.js';
import { $, element } from './dom.js';
import { nearestVertex } from './geometry.js';
import * as legend from './legend.js';
import * as section from './section.js';
import { inSlices } from './slices.js';
import { ofSegment, some } from './words.js';

let now = null; // {viewer, job, results, mesh, hidden: set of segments, labels: {design, scan} of each vertex once they are known}

$('segments').addEventListener('toggle', () => { if ($('segments').open && now && !now.labels) prepare(); });
$('segments-all').addEventListener('click', () => choose(() => true));
$('segments-none').addEventListener('click', () => choose(() => false));
$('segments-colour').addEventListener('change', dress);

/** mesh : name of the mesh that has the segments; viewer : with it as its design, and with a scan only in the final pose */
export function open(viewer, job, results, mesh) {
  close();
  now = { viewer, job, results, mesh, hidden: new Set(), labels: null };
  $('segments').hidden = !results.segments[mesh]?.centres.length;
  $('segments-colour').checked = false;
  $('segments-colour').closest('label').hidden = !viewer.values;
  if ($('segments').open) prepare();
}

export function close() {
  now = null;
  $('segment-list').replaceChildren();
  $('segment-note').textContent = '';
}

async function prepare() {
  const mine = now;
  const isOver = () => now !== mine;
  list(new Map());
  $('segment-note').textContent = 'Finding the segments of each vertex.';
  const known = await Promise.resolve(centres.verticesOf(mine.mesh)).catch(() => null);
  if (isOver()) return;
  if (!known) {
    $('segment-note').textContent = 'The job has no table of vertices, so segments cannot be hidden.';
    return;
  }
  const { design, values, scan } = mine.viewer;
  const labels = { design: await ofDesign(design, known, isOver), scan: null };
  if (values) {
    labels.scan = new Uint16Array(scan.count);
    await inSlices(scan.count, (k) => { labels.scan[k] = labels.design[design.nearest(scan.position(k)).vertex]; }, isOver);
  }
  if (isOver()) return;
  mine.labels = labels;
  const named = await names(mine);
  if (isOver()) return;
  list(named);
  dress();
}

/** Of each vertex that is shown: as the table says, or where fewer are shown than it has, of the nearest vertex of the working mesh. */
async function ofDesign(design, { rows, points }, isOver) {
  if (rows.segment.length === design.count) return Uint16Array.from(rows.segment);
  const labels = new Uint16Array(design.count);
  const places = Float32Array.from(points.flatMap(({ position }) => position));
  await inSlices(design.count, (k) => { labels[k] = points[nearestVertex(places, design.position(k)).vertex].segment; }, isOver);
  return labels;
}

/** segment -> names of the regions of the design's characteristics that have it */
async function names({ job: { inputs }, viewer: { design }, labels }) {
  const found = new Map();
  if (!inputs.design) return found;
  const { regions } = await api.json(`/v1/designs/${inputs.design.blob}/characteristics?empty=true`).catch(() => ({ regions: [] }));
  const at = (place) => labels.design[design.nearest(place).vertex];
  for (const { name, region } of regions) {
    const within = region.kind === 'segments' ? region.segments : region.kind === 'segments_at' ? region.places_mm.map(at) : [];
    for (const segment of new Set(within)) found.set(segment, [...found.get(segment) ?? [], name]);
  }
  return found;
}

function list(named) {
  const items = now.results.segments[now.mesh].centres.map(({ segment }) => segment).sort((a, b) => a - b).map((segment) => {
    const box = element('input', '', { type: 'checkbox', checked: !now.hidden.has(segment), value: String(segment) });
    box.addEventListener('change', () => {
      if (box.checked) now.hidden.delete(segment);
      else now.hidden.add(segment);
      dress();
    });
    const words = named.has(segment) ? `${named.get(segment).join(', ')} (segment ${segment})` : `segment ${segment}`;
    return element('li', element('label', [box, centres.swatch(segment), words]));
  });
  $('segment-list').replaceChildren(...items);
}

function choose(isShown) {
  if (!now) return;
  for (const box of $('segment-list').querySelectorAll('input')) {
    box.checked = isShown();
    if (box.checked) now.hidden.delete(Number(box.value));
    else now.hidden.add(Number(box.value));
  }
  dress();
}

function dress() {
  if (!now?.labels) return;
  const { viewer, labels, hidden } = now;
  const isShown = (segment) => !hidden.has(segment);
  for (const what of ['design', 'scan']) if (labels[what]) viewer[what].hide(hidden.size ? labels[what] : null, isShown);
  viewer.isBySegment = Boolean(labels.scan) && $('segments-colour').checked;
  if (viewer.isBySegment) viewer.scan.colourBy(labels.scan, rgb);
  $('segment-note').textContent = hidden.size ? `${some(hidden.size, 'segment')} hidden. Figures and shares are of the whole part.` : '';
  legend.redraw();
  section.redraw();
  viewer.draw();
}

const rgb = (segment) => [1, 3, 5].map((at) => parseInt(ofSegment(segment).slice(at, at + 2), 16));
