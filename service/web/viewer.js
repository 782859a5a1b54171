/** The part in three dimensions: design, scan or one mesh, with what is drawn beside them. Millimetres, in the frame of the design. */

import * as THREE from './vendor/three/three.module.js';
import { Drawing } from './drawing.js';
import { Marks } from './marks.js';
import { Picker } from './picking.js';
import { IDENTITY } from './poses.js';
import { Surface, read } from './surface.js';
import { View } from './view.js';
import { listen } from './viewer_input.js';
import { DIRECTIONS } from './views.js';

const SEE_THROUGH = 0.25; // opacity of the design over the scan
const LIFT = 0.004; // of the diagonal, or the largest deviation: the design is drawn so far in front of the scan, without stripes
const UNDER = 0x7e8896; // of the design, with the scan over it
const VISIBLE = 0.005; // of the diagonal: a place is visible when what is drawn there lies as near to it
const ASKED = 50; // vertices that say to which side a surface faces
THREE.ColorManagement.enabled = false; // our colours are sRGB values already

/** Whether what is behind is seen through it. */
function veil(material, isVeil) {
  Object.assign(material, { transparent: isVeil, opacity: isVeil ? SEE_THROUGH : 1, depthWrite: !isVeil, needsUpdate: true });
}

export class Viewer {
  /** onHover : called with what is under the pointer, {mark} or {what, vertex, point}, or null; onPick : with the same on a click, and the
   *  event; onDrawn : after each frame */
  constructor(canvas, { onHover, onPick, onDrawn }) {
    Object.assign(this, { canvas, onHover, onPick, onDrawn });
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // as above
    this.scene = new THREE.Scene();
    this.light = new THREE.DirectionalLight(0xffffff, 2.2);
    const around = new THREE.AmbientLight(0xffffff, 1.1);
    for (const each of [around, this.light]) each.layers.enableAll();
    this.scene.add(around, this.light, this.light.target);
    this.groups = { design: new THREE.Group(), scan: new THREE.Group() };
    this.groups.scan.matrixAutoUpdate = false;
    this.scene.add(this.groups.scan, this.groups.design);
    this.design = null; // surfaces
    this.scan = null;
    this.matrix = IDENTITY;
    this.isBySegment = false; // the scan has the colours of the segments
    this.isDimmed = false; // the design is seen behind or in front of the scan
    this.lift = 0;
    this.cutAway = null; // {axis, offset}: what lies beyond is not shown
    this.drawing = new Drawing(this.renderer, this.scene, {
      surfaces: () => ['scan', 'design'].filter((what) => this[what] && this.groups[what].visible).map((what) => this[what]),
      camera: () => this.view.camera,
      prepare: () => this.prepare(),
      onDrawn: () => this.onDrawn?.(),
    });
    this.picker = new Picker();
    this.marks = new Marks(this.scene, () => this.diagonal());
    this.view = new View(canvas, () => this.box(), () => this.draw());
    this.cancelPicking = listen(this);
    this.size = new ResizeObserver(() => this.resize());
    this.size.observe(canvas);
  }

  // --- what is shown

  /** what : `design` or `scan`; file : its bytes; kind : `glb` or `ply` */
  async load(what, file, kind) {
    const surface = new Surface(what, await read(file, kind));
    this[what] = surface;
    this.groups[what].add(surface.object);
    this.scene.updateMatrixWorld();
  }

  /** Deviation of each vertex of the scan; null without */
  get values() {
    return this.scan?.values ?? null;
  }

  get isCloud() {
    return this.scan?.isCloud ?? false;
  }

  /** Shade the backs of the faces, so that they are not taken for fronts. The design says which side of the scan is which. */
  shadeBacks() {
    this.design.object.material.userData.back.value = 1;
    if (this.scan && !this.isCloud) this.scan.object.material.userData.back.value = this.scanSide();
  }

  /** +1 where the normals of the scan point as those of the design do, -1 where they point against them */
  scanSide() {
    this.side ??= this.compareSides();
    return this.side;
  }

  compareSides() {
    if (!this.design || !this.scan || this.isCloud || this.design.isCloud) return 1;
    const motion = this.groups.scan.matrix;
    const step = Math.max(1, Math.floor(this.scan.count / ASKED));
    let sum = 0;
    for (let k = 0; k < this.scan.count; k += step) {
      const at = new THREE.Vector3(...this.scan.position(k)).applyMatrix4(motion);
      const ofScan = new THREE.Vector3(...this.scan.normal(k)).transformDirection(motion);
      sum += Math.sign(ofScan.dot(new THREE.Vector3(...this.normalOfDesign(at.toArray()))));
    }
    return sum >= 0 ? 1 : -1;
  }

  /** Recolour every vertex of the scan by its deviation. scale : as in colours.js */
  recolour(scale) {
    if (!this.values || this.isBySegment) return;
    this.scan.recolour(scale);
    this.draw();
  }

  /** Deviation at the vertex of the scan nearest to `position`, and its distance: {mm, away}, both in mm. */
  deviationNear(position) {
    if (!this.values) return null;
    const { vertex, distance } = this.scan.nearest(position);
    return { mm: this.values[vertex], away: distance };
  }

  /** The vertices of the scan that lie lowest and highest: [{mm, position, normal}], in the frame of its file. */
  extremes() {
    return this.scan.extremes.map((k) => ({
      mm: this.values[k],
      position: this.scan.position(k),
      normal: this.scan.normal(k)?.map((part) => part * this.scanSide()) ?? null,
    }));
  }

  /** matrix : rows of T_design_scan (4 x 4), which moves the scan from the frame of its file */
  pose(matrix) {
    this.matrix = matrix;
    this.groups.scan.matrix.set(...matrix.flat());
    this.groups.scan.matrixWorldNeedsUpdate = true;
    this.marks.pose(matrix);
    this.scene.updateMatrixWorld();
    this.draw();
  }

  /** what : `design`, `scan`, `marks` or `lines` */
  show(what, isShown) {
    if (what === 'marks') this.marks.show(isShown);
    else if (what === 'lines') this.marks.lines.visible = isShown;
    else this.groups[what].visible = isShown;
    this.seeThrough();
    this.draw();
  }

  /** Two surfaces in the same place would be drawn in stripes: the design is a grey veil in front of a scan with triangles, and a
   *  grey body behind a cloud of points. Alone it has the colours of its segments. */
  seeThrough() {
    if (!this.design) return;
    const isBoth = this.groups.design.visible && this.groups.scan.visible && this.scan !== null;
    const isVeil = isBoth && !this.isCloud;
    const apart = this.values && isBoth ? Math.max(0, ...this.extremes().map(({ mm }) => Math.abs(mm))) : 0;
    const lift = Math.min(Math.max(LIFT * this.diagonal(), 1.2 * apart), 5 * LIFT * this.diagonal());
    this.lift = isVeil ? lift : isBoth ? -lift : 0;
    const { material } = this.design.object;
    veil(material, isVeil);
    material.color.set(isBoth ? UNDER : 0xffffff);
    if (material.userData.plain) material.userData.plain.value = isBoth ? 1 : 0;
    this.isDimmed = isBoth;
  }

  /** Keep what lies below `offset` along the axis 0, 1 or 2; null shows all. */
  clip(axis, offset) {
    const normal = new THREE.Vector3().setComponent(axis ?? 0, -1);
    this.cutAway = offset === null ? null : { axis, offset };
    this.renderer.clippingPlanes = offset === null ? [] : [new THREE.Plane(normal, offset)];
    this.draw();
  }

  /** Whether a place is not cut away. */
  kept(position) {
    return !this.cutAway || position[this.cutAway.axis] <= this.cutAway.offset;
  }

  /** A ring around a point; null removes it. isTurned : turn the view until the point is visible */
  point(position, isTurned = false) {
    this.marks.point(position);
    if (position && isTurned) this.view.turnTo(this.normalOfDesign(position));
    this.draw();
  }

  /** Unit outward normal of the design near a point. */
  normalOfDesign(position) {
    if (!this.design?.normals) return [0, 0, 1];
    return this.design.normal(this.design.nearest(position).vertex);
  }

  box() {
    const box = new THREE.Box3();
    for (const what of ['design', 'scan']) if (this[what]) box.union(this[what].box.clone().applyMatrix4(what === 'scan' ? this.groups.scan.matrix : new THREE.Matrix4()));
    return box;
  }

  diagonal() {
    return (this.design ?? this.scan).box.getSize(new THREE.Vector3()).length();
  }

  /** The first of the named views from which a point is visible, those that look at its front first; none: null.
   *  position, normal : in the frame of the design */
  sideThatShows(position, normal) {
    const facing = (side) => normal.reduce((sum, part, k) => sum + part * DIRECTIONS[side][k], 0) / Math.hypot(...DIRECTIONS[side]);
    const sides = Object.keys(DIRECTIONS).filter((side) => facing(side) > 0.2).sort((a, b) => facing(b) - facing(a));
    for (const side of sides) {
      this.view.frame(side);
      const [x, y] = this.view.toScreen(position);
      const seen = this.at(x, y);
      if (seen && seen.point.distanceTo(new THREE.Vector3(...position)) < VISIBLE * this.diagonal()) return side;
    }
    return null;
  }

  // --- what is under the pointer

  /** x, y : pixel of the canvas. The design is looked through while the scan is shown. */
  at(x, y) {
    const isShown = (what) => this[what] && this.groups[what].visible && !(what === 'design' && this.isDimmed);
    return this.pick(['design', 'scan'].filter(isShown).map((what) => this[what]), x, y);
  }

  pick(surfaces, x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return this.picker.at(surfaces, this.view.camera, x, y, width, height, this.cutAway);
  }

  pixel(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left - this.canvas.clientLeft, event.clientY - box.top - this.canvas.clientTop];
  }

  under(event) {
    const surface = this.at(...this.pixel(event));
    const mark = this.marks.at(this.picker.ray.ray, surface?.distance ?? Infinity, event.pointerType === 'touch' ? 3 : 1.5);
    if (mark) return { mark };
    return surface && { what: surface.surface.what, vertex: surface.vertex, point: surface.point.toArray() };
  }

  /** Where the pointer meets the design, shown or not: {position, normal}, or null. */
  onDesign(event) {
    if (!this.design) return null;
    this.placeDesign(0);
    const hit = this.pick([this.design], ...this.pixel(event));
    this.draw();
    return hit && { position: hit.point.toArray(), normal: this.design.normal(hit.vertex) };
  }

  // --- drawing

  placeDesign(lift) {
    this.groups.design.position.fromArray(this.view.eye()).multiplyScalar(lift);
    this.groups.design.updateMatrixWorld(true);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.drawing.resize(width, height, Math.min(devicePixelRatio, 2));
    this.view.resize(width / height);
    this.draw();
  }

  /** Draw in the next frame, once for all calls until then. */
  draw() {
    if (this.view.height) this.drawing.ask(); // else nothing is loaded yet
  }

  /** What depends on the view, before a frame. */
  prepare() {
    const colour = getComputedStyle(this.canvas).backgroundColor;
    const { target } = this.view.controls;
    this.light.position.fromArray(this.view.eye()).add(target);
    this.light.target.position.copy(target);
    this.placeDesign(this.lift);
    this.marks.scale(this.view);
    this.renderer.setClearColor(new THREE.Color().setStyle(colour, THREE.LinearSRGBColorSpace), 1);
  }

  close() {
    this.cancelPicking();
    this.drawing.close();
    this.size.disconnect();
    this.view.close();
    for (const surface of [this.design, this.scan]) for (const each of surface?.levels ?? []) each.dispose();
    this.scene.traverse((each) => each.geometry?.dispose());
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
