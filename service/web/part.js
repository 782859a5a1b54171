/** The part on the page: the viewer, what of it is shown, and what is said of the place under the pointer. */

import * as api from './api.js';
import * as centres from './centres.js';
import { isCounted } from './colours.js';
import { $, choices, element } from './dom.js';
import * as legend from './legend.js';
import * as measuring from './measuring.js';
import * as overlay from './overlay.js';
import * as ply from './ply.js';
import { IDENTITY, inverse, moved, times } from './poses.js';
import * as section from './section.js';
import { DIRECTIONS } from './views.js';
import { mm, ofSegment, short, signed, standsFor } from './words.js';

const PIN_DIFFERS = 0.0005; // mm: the surface that is shown has fewer vertices than the file, and may miss the extreme
const LARGEST = 80e6; // bytes of a mesh that is shown as it was sent
const FAR = 0.02; // of the diagonal: there is no scan there, unless its vertices are as far apart

let viewer = null;
let now = null; // {results, poses: name -> matrix of the scan's own frame, pose, isAligned: the scan's file is in the final pose, pins, first: the view at the beginning}

for (const side of Object.keys(DIRECTIONS)) $('sides').append(element('button', side, { type: 'button', onclick: () => viewer?.frame(side) }));
$('fit').addEventListener('click', () => viewer?.fit());
$('projection').addEventListener('click', () => project($('projection').getAttribute('aria-pressed') !== 'true'));
$('full').addEventListener('click', () => (document.fullscreenElement ? document.exitFullscreen() : $('stage-3d').requestFullscreen()));
$('show-pins').addEventListener('change', () => viewer?.draw());
$('pose').addEventListener('change', () => pose($('pose').value));
$('before').addEventListener('click', () => pose($('pose').value === 'before' ? 'final' : 'before'));
for (const [box, what] of [['show-scan', 'scan'], ['show-design', 'design'], ['show-landmarks', 'marks'], ['show-matches', 'lines']]) {
  $(box).addEventListener('change', () => viewer?.show(what, $(box).checked));
}

/** What the other panels may ask of it; all of them in the frame of the mesh that is named. */
export const panel = {
  point: (mesh, position, isTurned = false) => {
    viewer?.point(position && place(mesh, position), isTurned);
    if (viewer && isTurned) $('canvas').scrollIntoView({ block: 'nearest' });
  },
  preview: (mesh, positions) => viewer?.preview(positions.map((each) => place(mesh, each))),
};

/** The scan on its design. sizes : name of a file -> bytes */
export async function openRegistration(id, results, sizes, signal) {
  close();
  const at = (name) => api.bytes(`/v1/jobs/${id}/files/${name}`);
  const isAligned = sizes.has('deviation.glb') && Boolean(results.transform);
  const shown = isAligned ? 'deviation.glb' : sizes.get('scan.clean.ply') <= LARGEST ? 'scan.clean.ply' : null;
  const [{ Viewer }, designFile, scanFile] = await Promise.all([import('./viewer.js'), at('design.glb'), shown ? at(shown) : null]);
  if (signal.aborted) return;
  begin(Viewer, { results, isAligned });
  const mine = viewer;
  await mine.loadDesign(designFile);
  if (isAligned) await mine.loadScan(scanFile);
  else if (scanFile) mine.loadPly('scan', ply.parse(scanFile));
  if (signal.aborted) return;
  mark(results.landmarks, results);
  now.poses = poses(results);
  choices($('pose'), [...now.poses].map(([name, { words }]) => [name, words]));
  setUp({ scan: Boolean(scanFile), design: !isAligned || viewer.isCloud, marks: false, lines: false });
  const isMeasured = isAligned && viewer.values !== null; // the file of a cloud of points of an earlier version has colours only
  for (const id of ['legend', 'tolerance-box', 'section', 'extremes']) $(id).hidden = !isMeasured;
  viewer.onReset = () => viewer?.frame('+z');
  viewer.onReset();
  pose(now.poses.has('final') ? 'final' : 'before');
  if (!isMeasured) return;
  if (!viewer.isCloud) viewer.shadeBacks();
  legend.open(viewer, results);
  now.pins = pins(results);
  begin3d(worst());
}

/** The first view shows the largest deviation. */
function begin3d(place) {
  const first = viewer.sideThatShows(place.position, place.normal);
  viewer.onReset = () => (first ? viewer?.frame(first) : viewer?.fitAlong(place.normal));
  viewer.onReset();
  section.open(viewer, place);
}

/** The place that a person must see: the vertex that lies farthest off. */
function worst() {
  const [farthest] = viewer.extremes().sort((a, b) => Math.abs(b.mm) - Math.abs(a.mm));
  const position = farthest?.position ?? [0, 0, 0];
  return { position, normal: farthest?.normal ?? normalAt(position) };
}

const normalAt = (position) => viewer.normalOfDesign(position);

/** The lowest and the highest vertex, and the points that were to be inspected. */
function pins({ deviation, inspection }) {
  const ends = viewer.extremes().map((each, k) => {
    const ofAll = k ? deviation.max_mm : deviation.min_mm;
    const name = `${k ? 'max' : 'min'}${Math.abs(ofAll - each.mm) > PIN_DIFFERS ? ' shown' : ''}`;
    return { ...each, words: `${name} ${signed(each.mm)}`, normal: each.normal ?? normalAt(each.position) };
  });
  const points = (inspection?.checks ?? []).filter(({ kind, position_mm: position }) => kind === 'point' && position);
  const moods = { true: 'good', false: 'bad', null: 'warn' };
  return [...ends, ...points.map(({ name, value, passed, position_mm: position }) => ({
    words: `${name} ${value === null ? 'not measured' : signed(value)}`, position, normal: normalAt(position), mood: moods[passed],
  }))];
}

/** One mesh in the colours of its segments. */
export async function openMesh(id, results, signal) {
  close();
  const [{ Viewer }, file] = await Promise.all([import('./viewer.js'), api.bytes(`/v1/jobs/${id}/files/mesh.segments.ply`)]);
  if (signal.aborted) return;
  begin(Viewer, { results, isAligned: false });
  viewer.loadPly('design', ply.parse(file));
  mark({ design: results.landmarks.mesh, scan: [], matches: [] }, results);
  now.poses = new Map();
  setUp({ scan: false, design: true, marks: true, lines: false });
  for (const box of ['legend', 'section', 'extremes']) $(box).hidden = true;
  viewer.onReset = () => viewer?.frame('oblique');
  viewer.onReset();
}

export function close() {
  viewer?.close();
  viewer = null;
  now = null;
  legend.close();
  section.close();
  $('tip').hidden = true;
  $('pose-note').textContent = '';
  $('overlay').replaceChildren();
  if (document.fullscreenElement) document.exitFullscreen();
}

function project(isPerspective) {
  $('projection').setAttribute('aria-pressed', String(isPerspective));
  viewer?.project(isPerspective);
}

export function redraw() {
  viewer?.draw();
  legend.redraw();
}

function begin(Viewer, known) {
  const canvas = $('canvas').cloneNode(); // a fresh one: a context is lost for good when a viewer is closed
  $('canvas').replaceWith(canvas);
  viewer = new Viewer(canvas, { onHover: hover, onPick: pick, onDrawn: furnish });
  viewer.resize();
  now = { ...known, pins: [] };
  $('projection').setAttribute('aria-pressed', 'false');
  measuring.open(() => viewer?.draw());
}

/** What lies over the picture; the pins are those of the final pose. */
function furnish() {
  const isFinal = !now.isAligned || $('pose').value === 'final';
  overlay.draw($('overlay'), viewer, isFinal && $('show-pins').checked ? now.pins.filter(({ position }) => viewer.kept(position)) : [], measuring.shown());
}

function pick(found) {
  hover(found);
  if (found?.point) measuring.pick(found.point);
}

function setUp(isOn) {
  const boxes = { scan: 'show-scan', design: 'show-design', marks: 'show-landmarks', lines: 'show-matches' };
  const isPair = now.results.type === 'registration';
  for (const [what, box] of Object.entries(boxes)) {
    $(box).checked = isOn[what];
    viewer.show(what, isOn[what]);
    $(box).closest('label').hidden = !isPair && what !== 'marks';
  }
  $('show-scan').closest('label').hidden = !isOn.scan;
  $('show-matches').closest('label').hidden = !viewer.pairs.length;
  $('show-pins').checked = true;
  $('show-pins').closest('label').hidden = !now.isAligned;
  $('pose').closest('label').hidden = now.poses.size < 2;
  $('before').hidden = !now.poses.has('final');
  $('tolerance-box').hidden = true;
}

function mark({ design, scan, matches }, { transform }) {
  const words = (each, mesh) => ({ ...each, mesh, position: each.position_mm, colour: ofSegment(each.segment) });
  const ofDesign = new Map(design.map((each) => [each.id, each]));
  const ofScan = new Map(scan.map((each) => [each.id, each]));
  const partner = new Map(matches.flatMap(({ design: a, scan: b, residual_mm: away }) => [[`design ${a}`, { id: b, away }], [`scan ${b}`, { id: a, away }]]));
  const inFile = (each) => (now.isAligned && transform ? moved(transform.matrix, each.position_mm) : each.position_mm);
  const name = now.results.type === 'registration' ? 'design' : 'mesh';
  viewer.landmarks(design.map((each) => ({ ...words(each, name), partner: partner.get(`design ${each.id}`) })));
  viewer.landmarks(scan.map((each) => ({ ...words(each, 'scan'), position: inFile(each), partner: partner.get(`scan ${each.id}`) })), true);
  if (matches.length) viewer.matches(matches.map((each) => [ofDesign.get(each.design).position_mm, inFile(ofScan.get(each.scan))]));
}

// --- poses

/** name -> {words, matrix}, in the order of the menu */
function poses({ transform, alternatives }) {
  const found = new Map();
  if (transform) found.set('final', { words: 'final', matrix: transform.matrix });
  found.set('before', { words: 'as uploaded', matrix: IDENTITY });
  alternatives.forEach((each, k) => {
    const kind = each.symmetry_of_design ? 'equivalent by symmetry' : transform ? 'alternative' : 'rejected';
    const stands = standsFor(each);
    found.set(String(k), { words: `${kind}, RMS ${short(each.rmse_mm)} mm${stands && `, ${stands}`}`, matrix: each.matrix });
  });
  return found;
}

/** Only where the scan lies changes; what is shown stays as it was chosen. */
function pose(name) {
  $('pose').value = name;
  now.pose = now.poses.get(name).matrix;
  $('before').textContent = name === 'before' ? 'After' : 'Before';
  const notes = [];
  if (now.isAligned && name !== 'final') notes.push('The colours are those of the final pose.');
  if (now.isAligned && !viewer.values) notes.push('For the colours of this point cloud see report.html.');
  $('pose-note').textContent = notes.join(' ');
  viewer.point(null);
  viewer.pose(now.isAligned ? times(now.pose, inverse(now.results.transform.matrix)) : now.pose);
  viewer.fit();
}

/** From a mesh's own frame to where it is shown. */
function place(mesh, position) {
  return mesh === 'scan' && now.pose ? moved(now.pose, position) : position;
}

// --- what is under the pointer

function hover(found) {
  const words = found ? describe(found) : '';
  $('tip').textContent = words;
  $('tip').hidden = !words;
  if (!found) centres.mark(null, null);
}

function describe({ mark: landmark, what, vertex, point }) {
  if (landmark) {
    const { id, mesh, segment, t2, partner, position } = landmark;
    centres.mark(mesh, centres.near(mesh, landmark.position_mm));
    const there = mesh === 'mesh' ? '' : deviation(position);
    const matched = partner ? `, matched with ${partner.id}, ${mm(partner.away)} apart` : '';
    return `landmark ${id} of the ${mesh}: segment ${segment}, T² ${short(t2)}${there}${matched}`;
  }
  const mesh = now.results.type === 'registration' ? what : 'mesh';
  const near = centres.near(mesh, mesh === 'scan' ? moved(inverse(now.pose), point) : point);
  centres.mark(mesh, near);
  const there = mesh === 'scan' && viewer.values ? said(viewer.values[vertex]) : '';
  const of = near ? `: segment ${near.segment}${near.isHalo ? ' (halo)' : ''}, T² ${short(near.t2)}` : '';
  return `${mesh}${of}${there}`;
}

/** In words, at a place in the frame of the scan's file. */
function deviation(position) {
  const found = viewer.deviationNear(position);
  if (!found) return '';
  if (found.away > Math.max(FAR * viewer.diagonal(), 2 * viewer.spacing)) return ', no scan there';
  return said(found.mm);
}

const said = (value) => (isCounted(value) ? `, deviation ${signed(value)}` : ', deviation not counted');
