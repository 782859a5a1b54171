/** The part on the page: the viewer, what of it is shown, and what is said of the place under the pointer. */

import * as api from './api.js';
import * as centres from './centres.js';
import { isCounted } from './colours.js';
import { $, choices } from './dom.js';
import * as legend from './legend.js';
import * as ply from './ply.js';
import { IDENTITY, inverse, moved, times } from './poses.js';
import { mm, ofSegment, short, signed, standsFor } from './words.js';

const SIDES = ['+z', '-z', '+x', '-x', '+y', '-y', 'oblique'];
const LARGEST = 80e6; // bytes of a mesh that is shown as it was sent
const FAR = 0.02; // of the diagonal: there is no scan there, unless its vertices are as far apart

let viewer = null;
let now = null; // {results, poses: name -> matrix of the scan's own frame, pose, isAligned: the scan's file is in the final pose}

$('side').addEventListener('change', () => viewer?.frame($('side').value));
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
  const isAligned = sizes.has('deviation.glb');
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
  choices($('pose'), Object.entries(now.poses).map(([name, { words }]) => [name, words]));
  setUp({ scan: Boolean(scanFile), design: !isAligned, marks: false, lines: false });
  const isMeasured = isAligned && viewer.values !== null; // the file of a cloud of points has colours only
  $('legend').hidden = !isMeasured;
  $('tolerance-box').hidden = !isMeasured;
  if (isMeasured) legend.open(viewer, results.deviation);
  viewer.frame('+z');
  pose('final' in now.poses ? 'final' : 'before');
}

/** One mesh in the colours of its segments. */
export async function openMesh(id, results, signal) {
  close();
  const [{ Viewer }, file] = await Promise.all([import('./viewer.js'), api.bytes(`/v1/jobs/${id}/files/mesh.segments.ply`)]);
  if (signal.aborted) return;
  begin(Viewer, { results, isAligned: false });
  viewer.loadPly('design', ply.parse(file));
  mark({ design: results.landmarks.mesh, scan: [], matches: [] }, results);
  now.poses = {};
  setUp({ scan: false, design: true, marks: true, lines: false });
  $('legend').hidden = true;
  viewer.frame('+z');
}

export function close() {
  viewer?.close();
  viewer = null;
  now = null;
  legend.close();
  $('tip').hidden = true;
}

export function redraw() {
  viewer?.draw();
  legend.redraw();
}

function begin(Viewer, known) {
  const canvas = $('canvas').cloneNode(); // a fresh one: a context is lost for good when a viewer is closed
  $('canvas').replaceWith(canvas);
  viewer = new Viewer(canvas, { onHover: hover, onPick: hover });
  viewer.resize();
  now = known;
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
  $('pose').closest('label').hidden = Object.keys(now.poses).length < 2;
  $('before').hidden = !('final' in now.poses);
  $('tolerance-box').hidden = true;
  choices($('side'), SIDES.map((side) => [side, side]));
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

function poses({ transform, alternatives }) {
  const found = {};
  if (transform) found.final = { words: 'final pose', matrix: transform.matrix };
  found.before = { words: 'as uploaded', matrix: IDENTITY };
  alternatives.forEach((each, k) => {
    const kind = each.symmetry_of_design ? 'symmetry' : transform ? 'rival' : 'rejected';
    const stands = standsFor(each);
    found[k] = { words: `${kind} ${k + 1}, RMSE ${short(each.rmse_mm)} mm${stands && `, ${stands}`}`, matrix: each.matrix };
  });
  return found;
}

function pose(name) {
  $('pose').value = name;
  now.pose = now.poses[name].matrix;
  const isBefore = name === 'before';
  $('before').textContent = isBefore ? 'After' : 'Before';
  const notes = [];
  if (now.isAligned && name !== 'final') notes.push('The colours are those of the final pose.');
  if (now.isAligned && !viewer.values) notes.push('For the colours of a point cloud see report.html.');
  $('pose-note').textContent = notes.join(' ');
  if (now.isAligned) { // without the design beside it, where the scan lay says nothing
    $('show-design').checked = name !== 'final';
    viewer.show('design', name !== 'final');
  }
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
