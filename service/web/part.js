/** The part on the page: the viewer, what of it is shown, and what is said of the place under the pointer. */

import * as api from './api.js';
import * as centres from './centres.js';
import { isCounted } from './colours.js';
import { $, choices, element } from './dom.js';
import * as legend from './legend.js';
import * as limits from './limits.js';
import * as measuring from './measuring.js';
import * as overlay from './overlay.js';
import { pins, worst } from './pins.js';
import { IDENTITY, inverse, moved, times } from './poses.js';
import * as section from './section.js';
import * as segments from './segments.js';
import { DIRECTIONS } from './views.js';
import { mm, ofSegment, short, signed, standsFor } from './words.js';

const LARGEST = 80e6; // bytes of a mesh that is shown as it was sent
const FAR = 0.02; // of the diagonal: there is no scan there, unless its vertices are as far apart

let viewer = null;
let now = null; // {results, poses: name -> matrix of the scan's own frame, pose, isAligned: the scan's file is in the final pose, pins, first: the view at the beginning}

for (const side of Object.keys(DIRECTIONS)) $('sides').append(element('button', side, { type: 'button', onclick: () => viewer?.view.frame(side) }));
$('fit').addEventListener('click', () => viewer?.view.fit());
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
  preview: (mesh, positions) => {
    viewer?.marks.preview(positions.map((each) => place(mesh, each)));
    viewer?.draw();
  },
};

/** The scan on its design. sizes : name of a file -> bytes */
export async function openRegistration(job, results, sizes, signal) {
  close();
  const at = (name) => api.bytes(`/v1/jobs/${job.id}/files/${name}`);
  const isAligned = sizes.has('deviation.glb') && Boolean(results.transform);
  const shown = isAligned ? 'deviation.glb' : sizes.get('scan.clean.ply') <= LARGEST ? 'scan.clean.ply' : null;
  const [{ Viewer }, designFile, scanFile] = await Promise.all([import('./viewer.js'), at('design.glb'), shown ? at(shown) : null]);
  if (signal.aborted) return;
  begin(Viewer, { results, isAligned });
  const mine = viewer;
  await Promise.all([mine.load('design', designFile, 'glb'), scanFile && mine.load('scan', scanFile, isAligned ? 'glb' : 'ply')]);
  if (signal.aborted) return;
  mark(results.landmarks, results);
  now.poses = poses(results);
  choices($('pose'), [...now.poses].map(([name, { words }]) => [name, words]));
  setUp({ scan: Boolean(scanFile), design: !isAligned || viewer.isCloud, marks: false, lines: false });
  const isMeasured = isAligned && viewer.values !== null; // the file of a cloud of points of an earlier version has colours only
  for (const id of ['legend', 'tolerance-box', 'section', 'extremes', 'segments']) $(id).hidden = !isMeasured;
  viewer.onReset = () => viewer?.view.frame('+z');
  viewer.onReset();
  pose(now.poses.has('final') ? 'final' : 'before');
  limits.open(viewer, job, isMeasured);
  if (!isMeasured) return;
  if (!viewer.isCloud) viewer.shadeBacks();
  legend.open(viewer, results);
  now.pins = pins(viewer, results);
  begin3d(worst(viewer));
  segments.open(viewer, job, results, 'design');
}

/** The first view shows the largest deviation. */
function begin3d(place) {
  const first = viewer.sideThatShows(place.position, place.normal);
  viewer.onReset = () => (first ? viewer?.view.frame(first) : viewer?.view.fitAlong(place.normal));
  viewer.onReset();
  section.open(viewer, place);
}

/** One mesh in the colours of its segments. */
export async function openMesh(job, results, signal) {
  close();
  const [{ Viewer }, file] = await Promise.all([import('./viewer.js'), api.bytes(`/v1/jobs/${job.id}/files/mesh.segments.ply`)]);
  if (signal.aborted) return;
  begin(Viewer, { results, isAligned: false });
  const mine = viewer;
  await mine.load('design', file, 'ply');
  if (signal.aborted) return;
  mark({ design: results.landmarks.mesh, scan: [], matches: [] }, results);
  now.poses = new Map();
  setUp({ scan: false, design: true, marks: true, lines: false });
  for (const box of ['legend', 'section', 'extremes']) $(box).hidden = true;
  viewer.onReset = () => viewer?.view.frame('oblique');
  viewer.onReset();
  segments.open(viewer, job, results, 'mesh');
}

export function close() {
  viewer?.close();
  viewer = null;
  now = null;
  legend.close();
  section.close();
  segments.close();
  limits.close();
  $('tip').hidden = true;
  $('pose-note').textContent = '';
  $('overlay').replaceChildren();
  if (document.fullscreenElement) document.exitFullscreen();
}

function project(isPerspective) {
  $('projection').setAttribute('aria-pressed', String(isPerspective));
  viewer?.view.project(isPerspective);
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
  const own = isFinal && $('show-pins').checked ? now.pins : [];
  overlay.draw($('overlay'), viewer, [...own, ...limits.pins()].filter(({ position }) => viewer.kept(position)), measuring.shown(), section.plane());
  section.placeHandle();
}

function pick(found, event) {
  hover(found);
  if (!limits.pick(event) && found?.point) measuring.pick(found.point);
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
  $('show-matches').closest('label').hidden = !viewer.marks.pairs.length;
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
  viewer.marks.landmarks(design.map((each) => ({ ...words(each, name), partner: partner.get(`design ${each.id}`) })));
  viewer.marks.landmarks(scan.map((each) => ({ ...words(each, 'scan'), position: inFile(each), partner: partner.get(`scan ${each.id}`) })), true);
  if (matches.length) viewer.marks.matches(matches.map((each) => [ofDesign.get(each.design).position_mm, inFile(ofScan.get(each.scan))]));
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
  viewer.view.fit();
  section.posed(name === 'final');
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
  if (found.away > Math.max(FAR * viewer.diagonal(), 2 * viewer.scan.spacing)) return ', no scan there';
  return said(found.mm);
}

const said = (value) => (isCounted(value) ? `, deviation ${signed(value)}` : ', deviation not counted');
