/** The centres of the segments: the decision graph of each mesh, and a new job with centres chosen in it. */

import * as api from './api.js';
import { byNumber, byThresholds } from './choose.js';
import { DecisionGraph } from './decision_graph.js';
import { $, choices, element, fill, say } from './dom.js';
import { ofSegment, short, size, some } from './words.js';
import * as vertices from './vertices.js';

const LARGE = 30e6; // bytes of a table that is not fetched unasked
const HINT = 'Point at a dot to see which vertex it is; click it to see it on the part.';
const UNITS = ['mm', 'cm', 'm', 'inch'];

let graph = null;
let now = null; // what is shown: {job, results, part, tables: mesh -> promise of {points, rows}, mesh, isTouched}

$('rerun').addEventListener('submit', runAgain);
$('rerun').addEventListener('input', () => touched());
$('graph-mesh').addEventListener('change', () => show($('graph-mesh').value));
$('graph-load').addEventListener('click', () => show(now.mesh, true));

/** meshes : those with a table; part : where centres are shown in three dimensions; sizes : name of a file -> bytes */
export async function open(job, results, part, sizes, signal) {
  close();
  const meshes = Object.keys(results.segments).filter((mesh) => results.segments[mesh] && sizes.has(`${mesh}.vertices.csv`));
  $('graph').hidden = !meshes.length;
  if (!meshes.length) return;
  now = { job, results, part, sizes, meshes, mesh: meshes[0], tables: {}, isTouched: false };
  graph = new DecisionGraph($('plot'), { onHover: hover, onPick: pick, onPull: (rho, delta) => pull(rho, delta) });
  choices($('graph-mesh'), meshes.map((mesh) => [mesh, mesh]));
  $('graph-mesh').closest('label').hidden = meshes.length < 2;
  $('graph-tip').textContent = HINT;
  dress();
  await show(meshes[0]);
  if (!signal.aborted && meshes[1] && sizes.get(`${meshes[1]}.vertices.csv`) <= LARGE) await table(meshes[1]).then(preview, () => {});
}

export function close() {
  graph?.close();
  graph = null;
  now = null;
  $('rerun-refused').hidden = true;
}

export function redraw() {
  graph?.draw();
}

/** What is known of a place on a mesh: the nearest vertex that the graph has, or null. position : in the mesh's own frame */
export function near(mesh, position) {
  const points = now?.tables[mesh]?.points;
  if (!points) return null;
  let best = Infinity;
  let found = null;
  for (const each of points) {
    const square = (each.position[0] - position[0]) ** 2 + (each.position[1] - position[1]) ** 2 + (each.position[2] - position[2]) ** 2;
    if (square < best) { best = square; found = each; }
  }
  return found;
}

/** Ring the point in the graph, when that is of the mesh. */
export function mark(mesh, point) {
  if (graph && (mesh === now.mesh || !point)) graph.mark(point);
}

// --- the graph of one mesh

async function show(mesh, isAsked = false) {
  const mine = now;
  mine.mesh = mesh;
  $('graph-mesh').value = mesh;
  const bytes = mine.sizes.get(`${mesh}.vertices.csv`);
  const isLarge = bytes > LARGE && !isAsked && !mine.tables[mesh];
  $('graph-load').hidden = !isLarge;
  $('graph-load').textContent = `Load the graph of the ${mesh} (${size(bytes)})`;
  $('plot').hidden = isLarge;
  listCentres();
  if (isLarge) return;
  try {
    const { points } = await table(mesh);
    if (now !== mine || mine.mesh !== mesh) return;
    const { d_c: dC, density, count } = mine.results.segments[mesh];
    graph.set(points, dC, density);
    $('plot').querySelector('svg').setAttribute('aria-label', `Decision graph of the ${mesh}: ${points.length} vertices, ${some(count, 'centre')}, cut-off distance ${short(dC)} mm`);
    preview();
  } catch (error) {
    if (now === mine) say('rerun-refused', error);
  }
}

/** The vertices of the graph, centres among them as the results have them; kept in `now.tables`. */
async function table(mesh) {
  const mine = now;
  if (mine.tables[mesh]) return mine.tables[mesh];
  const { resample } = mine.results.provenance.settings;
  const { rows, working: points } = await vertices.read(`/v1/jobs/${mine.job.id}/files/${mesh}.vertices.csv`, resample.enabled);
  for (const { segment, vertex, position_mm: position, rho, delta } of mine.results.segments[mesh].centres) {
    let point = points.find((each) => each.rho === rho && each.delta === delta && each.centre === undefined);
    if (!point) { // no vertex of the file is nearest to it
      point = { segment, vertex, isHalo: false, rho, delta, t2: rows.t2[vertex] };
      points.push(point);
    }
    Object.assign(point, { position, centre: segment });
  }
  mine.tables[mesh] = { points, rows };
  return mine.tables[mesh];
}

/** The table of a mesh, as of `table`; null of a job without one. */
export const verticesOf = (mesh) => (now?.meshes.includes(mesh) ? table(mesh) : null);

function listCentres() {
  const { centres } = now.results.segments[now.mesh];
  const rows = centres.map((centre) => [
    element('button', [swatch(centre.segment), ` ${centre.segment}`], { type: 'button', title: `show centre ${centre.segment} on the part`, onclick: () => turnTo(centre) }),
    short(centre.rho), short(centre.delta), String(centre.size),
  ]);
  fill($('centres'), ['Segment', 'ρ', 'δ, mm', 'Vertices'], rows, [1, 2, 3]);
  $('centres-title').textContent = `${some(centres.length, 'centre')} of the ${now.mesh}`;
}

export function swatch(segment) {
  const made = element('span', '', { className: 'swatch' });
  made.style.backgroundColor = ofSegment(segment);
  return made;
}

function turnTo(centre) {
  const points = now.tables[now.mesh]?.points;
  graph.mark(points?.find((each) => each.centre === centre.segment) ?? null);
  now.part?.point(now.mesh, centre.position_mm, true);
}

function hover(point) {
  graph.mark(point);
  $('graph-tip').textContent = point ? words(point) : HINT;
  now.part?.point(now.mesh, point?.position ?? null);
}

function pick(point) {
  hover(point);
  now.part?.point(now.mesh, point.position, true);
}

function words(point) {
  const { vertex, segment, isHalo, rho, delta, centre } = point;
  const what = centre === undefined ? `vertex ${vertex}, segment ${segment}${isHalo ? ' (halo)' : ''}` : `centre of segment ${centre}`;
  return `${what}: ρ ${short(rho)}, δ ${short(delta)} mm`;
}

// --- choosing

/** What the job itself was told, in the form. */
function dress() {
  const { segmentation: asked } = now.results.provenance.settings;
  const isBox = asked.rho_min !== null || asked.delta_min_mm !== null;
  const { centres } = now.results.segments[now.mesh];
  const form = $('rerun').elements;
  form.by.value = isBox ? 'box' : asked.n_centres === null ? 'rule' : 'number';
  $('rho-min').value = isBox ? asked.rho_min ?? 0 : below(Math.min(...centres.map((each) => each.rho)));
  $('delta-min').value = isBox ? asked.delta_min_mm ?? 0 : below(Math.min(...centres.map((each) => each.delta)));
  $('n-centres').value = asked.n_centres ?? centres.length;
  $('n-centres').max = asked.max_centres;
}

/** With 3 digits, not above the value, so that it still chooses what has it. */
function below(given) {
  const step = 10 ** (Math.floor(Math.log10(given || 1)) - 2);
  return Number((Math.floor(given / step) * step).toPrecision(3));
}

function pull(rho, delta) {
  $('rho-min').value = Number(rho.toPrecision(3));
  $('delta-min').value = Number(delta.toPrecision(3));
  $('rerun').elements.by.value = 'box';
  touched();
}

function touched() {
  if (document.activeElement === $('rho-min') || document.activeElement === $('delta-min')) $('rerun').elements.by.value = 'box';
  if (document.activeElement === $('n-centres')) $('rerun').elements.by.value = 'number';
  now.isTouched = true;
  preview();
}

/** How many centres that would be, at once, on both meshes. */
function preview() {
  if (!graph) return;
  const by = $('rerun').elements.by.value;
  const corner = { rho: Number($('rho-min').value), delta: Number($('delta-min').value) };
  const isJoined = now.results.provenance.settings.segmentation.centre_rule === 'prominence';
  const least = now.results.provenance.settings.resample.enabled ? 'at least ' : ''; // the file does not have every working vertex
  const counts = [];
  for (const mesh of now.meshes) {
    const points = now.tables[mesh]?.points;
    if (!points) continue;
    const chosen = by === 'box' ? byThresholds(points, corner.rho, corner.delta) : by === 'number' && !isJoined ? byNumber(points, Number($('n-centres').value)) : [];
    const where = now.meshes.length > 1 ? ` on the ${mesh}` : '';
    counts.push(chosen.length ? `${chosen.length}${where} (now ${now.results.segments[mesh].count})` : `now ${now.results.segments[mesh].count}${where}`);
    if (mesh !== now.mesh) continue;
    graph.choose(corner, now.isTouched ? chosen : [], by !== 'box');
    now.part?.preview(mesh, now.isTouched ? chosen.map((k) => points[k].position) : []);
  }
  $('would').textContent = {
    box: `Selects ${least}${counts.join(', ')}.`,
    number: isJoined ? `Peaks are merged over their borders until this number remains; ${counts.join(', ')}.` : `Selects ${counts.join(', ')}.`,
    rule: `Selected by the method; ${counts.join(', ')}. Drag the corner of the box, or enter numbers, to select others.`,
  }[by];
}

/** The same blobs, part, columns, settings, units, seed and label; only the centres are chosen anew. */
async function runAgain(event) {
  event.preventDefault();
  const { job, results } = now;
  const { settings, seed, inputs } = results.provenance;
  const by = $('rerun').elements.by.value;
  const segmentation = {
    ...settings.segmentation,
    rho_min: by === 'box' ? Number($('rho-min').value) : null,
    delta_min_mm: by === 'box' ? Number($('delta-min').value) : null,
    n_centres: by === 'number' ? Number($('n-centres').value) : null,
  };
  const units = Object.entries(inputs).map(([mesh, { unit }]) => [mesh, unit]).filter(([, unit]) => UNITS.includes(unit));
  const given = Object.fromEntries(Object.entries(job.inputs).filter(([, each]) => each));
  $('rerun-refused').hidden = true;
  $('again').disabled = true;
  try {
    const { webhook, ...asked } = await api.json(`/v1/jobs/${job.id}/options`);
    const stated = Object.fromEntries(Object.entries(asked).filter(([, value]) => value !== null));
    const options = { ...stated, settings: { ...settings, segmentation }, seed, units: Object.fromEntries(units) };
    location.hash = (await api.start({ type: job.type, ...given, options })).id;
  } catch (error) {
    say('rerun-refused', error);
  } finally {
    $('again').disabled = false;
  }
}
