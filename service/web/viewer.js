/** The part in three dimensions: design, scan or one mesh, landmarks, matches. Millimetres, in the frame of the design. */

import * as THREE from './vendor/three/three.module.js';
import { OrbitControls } from './vendor/three/OrbitControls.js';
import { GLTFLoader } from './vendor/three/GLTFLoader.js';
import { NOT_COUNTED, isCounted, of } from './colours.js';
import { areas, fittingDistance, inMillimetres, nearestVertex, shaded, surfaces } from './geometry.js';
import { Picker } from './picking.js';
import { IDENTITY, moved } from './poses.js';
import { discTexture, ringTexture } from './textures.js';
import { listen } from './viewer_input.js';

const MARGIN = 1.05; // of the view, around the part
const BALL = 0.0075; // radius of a landmark, as a share of the diagonal
const DIRECTIONS = { '+x': [1, 0, 0], '-x': [-1, 0, 0], '+y': [0, 1, 0], '-y': [0, -1, 0], '+z': [0, 0, 1], '-z': [0, 0, -1], oblique: [0.6, -0.8, 0.7] };
const loader = new GLTFLoader();
THREE.ColorManagement.enabled = false; // our colours are sRGB values already

export class Viewer {
  /** onHover : called with what is under the pointer, {mark} or {what, vertex, point}, or null; onPick : with the same on a click */
  constructor(canvas, { onHover, onPick }) {
    this.canvas = canvas;
    this.onHover = onHover;
    this.onPick = onPick;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // as above
    this.camera = new THREE.PerspectiveCamera(30, 1, 0.1, 10000);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.picker = new Picker(this.renderer);
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.AmbientLight(0xffffff, 1.1), this.camera);
    this.camera.add(new THREE.DirectionalLight(0xffffff, 2.2));
    for (const name of ['scan', 'design', 'marks', 'lines']) {
      this[name] = new THREE.Group();
      this.scene.add(this[name]);
    }
    this.scanMarks = new THREE.Group(); // move with the scan, shown with the others
    this.scan.matrixAutoUpdate = false;
    this.scanMarks.matrixAutoUpdate = false;
    this.scene.add(this.scanMarks);
    this.matrix = IDENTITY;
    this.values = null; // deviation of each vertex of the scan
    this.pairs = [];
    this.addSpots();
    this.cancelPicking = listen(this);
    this.size = new ResizeObserver(() => this.resize());
    this.size.observe(canvas);
  }

  addSpots() {
    this.ring = new THREE.Sprite(new THREE.SpriteMaterial({ map: ringTexture(), depthTest: false, sizeAttenuation: false, transparent: true }));
    this.ring.scale.setScalar(0.045);
    this.ring.visible = false;
    const dots = new THREE.PointsMaterial({ color: 0xd0107a, size: 11, sizeAttenuation: false, depthTest: false, map: discTexture(), transparent: true });
    this.dots = new THREE.Points(new THREE.BufferGeometry(), dots);
    this.dots.visible = false;
    this.dots.frustumCulled = false;
    this.scene.add(this.ring, this.dots);
  }

  // --- what is shown

  async loadDesign(glb) {
    for (const node of surfaces(await loader.parseAsync(glb, ''))) this.add('design', shaded(inMillimetres(node), node.isPoints));
  }

  async loadScan(glb) {
    for (const node of surfaces(await loader.parseAsync(glb, ''))) this.add('scan', shaded(inMillimetres(node), node.isPoints));
    const { geometry } = this.scan.children[0];
    this.values = geometry.getAttribute('_deviation_mm')?.array ?? null;
    this.areas = areas(geometry);
    this.spacing = Math.sqrt(this.areas.reduce((a, b) => a + b, 0) / this.areas.length);
  }

  /** name : `design` or `scan`; mesh : of ply.js; a mesh without colours is grey */
  loadPly(name, { positions, colours, index }) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute('color', new THREE.BufferAttribute(colours ?? new Uint8Array(positions.length).fill(170), 3, true));
    if (index.length) geometry.setIndex(new THREE.BufferAttribute(index, 1));
    this.add(name, shaded(geometry, !index.length));
  }

  add(name, object) {
    object.userData.what = name;
    this[name].add(object);
    this.picker.add(object);
  }

  /** Recolour every vertex of the scan by its deviation. limit, tolerance : mm */
  recolour(limit, tolerance) {
    const target = this.scan.children[0]?.geometry.getAttribute('color');
    if (!this.values || !target) return;
    const step = target.itemSize;
    const scale = target.array instanceof Uint8Array ? 1 : target.array instanceof Uint16Array ? 257 : 1 / 255;
    for (let k = 0; k < this.values.length; k += 1) {
      const colour = isCounted(this.values[k]) ? of(this.values[k], limit, tolerance) : NOT_COUNTED;
      for (let part = 0; part < 3; part += 1) target.array[k * step + part] = colour[part] * scale;
    }
    target.needsUpdate = true;
    this.draw();
  }

  /** Deviation at the vertex of the scan nearest to `position`, and its distance: {mm, away}, both in mm. */
  deviationNear(position) {
    const at = this.scan.children[0]?.geometry.attributes.position.array;
    if (!at || !this.values) return null;
    const { vertex, distance } = nearestVertex(at, position);
    return { mm: this.values[vertex], away: distance };
  }

  /** matrix : rows of T_design_scan (4 x 4), which moves the scan from the frame of its file */
  pose(matrix) {
    this.matrix = matrix;
    for (const group of [this.scan, this.scanMarks]) {
      group.matrix.set(...matrix.flat());
      group.matrixWorldNeedsUpdate = true;
    }
    this.scene.updateMatrixWorld();
    this.drawLines();
    this.draw();
  }

  /** points : {position, colour, ...}, passed to onHover as `mark`; those of the scan are in the frame of its file */
  landmarks(points, isOfScan = false) {
    const radius = this.diagonal() * BALL;
    const shape = isOfScan ? new THREE.OctahedronGeometry(radius * 1.2) : new THREE.SphereGeometry(radius, 16, 12);
    const edge = new THREE.MeshBasicMaterial({ color: 0x101418, side: THREE.BackSide });
    for (const mark of points) {
      const ball = new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ color: mark.colour }));
      const rim = new THREE.Mesh(shape, edge); // separates it from the segment behind, which has the same colour
      rim.scale.setScalar(1.22);
      ball.add(rim);
      ball.position.set(...mark.position);
      ball.userData.mark = mark;
      (isOfScan ? this.scanMarks : this.marks).add(ball);
    }
    this.scene.updateMatrixWorld();
  }

  /** pairs : [point on the design, point on the scan in the frame of its file] */
  matches(pairs) {
    this.pairs = pairs;
    const line = new THREE.LineBasicMaterial({ color: 0xd0107a, depthTest: false });
    const dot = new THREE.PointsMaterial({ color: 0xd0107a, size: 6, sizeAttenuation: false, depthTest: false, map: discTexture(), transparent: true });
    this.lines.add(new THREE.LineSegments(new THREE.BufferGeometry(), line), new THREE.Points(new THREE.BufferGeometry(), dot)); // in a good pose a line is shorter than a pixel
    this.drawLines();
  }

  drawLines() {
    if (!this.pairs.length) return;
    const points = this.pairs.flatMap(([fixed, along]) => [fixed, moved(this.matrix, along)]).map((each) => new THREE.Vector3(...each));
    for (const drawn of this.lines.children) {
      drawn.geometry.dispose();
      drawn.geometry = new THREE.BufferGeometry().setFromPoints(points);
    }
  }

  show(what, isShown) {
    this[what].visible = isShown;
    if (what === 'marks') this.scanMarks.visible = isShown;
    this.draw();
  }

  /** Dots in front of everything, at points in the frame of the design. */
  preview(points) {
    this.dots.geometry.dispose();
    this.dots.geometry = new THREE.BufferGeometry().setFromPoints(points.map((each) => new THREE.Vector3(...each)));
    this.dots.visible = points.length > 0;
    this.draw();
  }

  /** A ring around a point; null removes it. isTurned : turn the view until the point is visible */
  point(position, isTurned = false) {
    this.ring.visible = Boolean(position);
    if (position) {
      this.ring.position.set(...position);
      if (isTurned) this.turnTo(this.ring.position);
    }
    this.draw();
  }

  turnTo(position) {
    const eye = this.camera.position.clone().sub(this.controls.target);
    const normal = this.normalNear(position);
    if (normal && normal.dot(eye) < 0.5 * eye.length()) { // otherwise it is visible already
      this.camera.position.copy(this.controls.target).addScaledVector(normal.normalize(), eye.length());
    }
    this.controls.update();
  }

  normalNear(position) {
    const shown = [...this.design.children, ...this.scan.children].find((each) => each.geometry.attributes.normal);
    if (!shown) return null;
    const { vertex } = nearestVertex(shown.geometry.attributes.position.array, position.toArray());
    return new THREE.Vector3().fromBufferAttribute(shown.geometry.attributes.normal, vertex);
  }

  // --- the view

  box() {
    return new THREE.Box3().expandByObject(this.design).expandByObject(this.scan);
  }

  diagonal() {
    return new THREE.Box3().setFromObject(this.design.children.length ? this.design : this.scan).getSize(new THREE.Vector3()).length();
  }

  frame(side) {
    this.camera.up.set(...(side.endsWith('z') ? [0, 1, 0] : [0, 0, 1]));
    this.fit(new THREE.Vector3(...DIRECTIONS[side]));
  }

  /** Show the whole part. direction : from which side; by default the present one */
  fit(direction = this.camera.position.clone().sub(this.controls.target)) {
    const box = this.box();
    const centre = box.getCenter(new THREE.Vector3());
    const half = box.getSize(new THREE.Vector3()).divideScalar(2);
    const radius = half.length();
    const distance = fittingDistance(this.camera, half, direction.normalize());
    this.camera.position.copy(centre).addScaledVector(direction, MARGIN * distance);
    this.camera.near = radius / 50;
    this.camera.far = radius * 30;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(centre);
    this.controls.update();
    this.draw();
  }

  zoom(by) {
    this.camera.position.sub(this.controls.target).multiplyScalar(by).add(this.controls.target);
  }

  // --- what is under the pointer

  under(event) {
    const box = this.canvas.getBoundingClientRect();
    const { clientLeft: border, clientWidth: width, clientHeight: height } = this.canvas;
    const surface = this.picker.at(this.camera, event.clientX - box.left - border, event.clientY - box.top - border, width, height);
    const mark = this.markAt(this.picker.ray.ray, surface?.distance ?? Infinity, event.pointerType === 'touch' ? 3 : 1.5);
    if (mark) return { mark };
    return surface && { what: surface.shown.userData.what, vertex: surface.vertex, point: surface.point.toArray() };
  }

  /** The nearest mark on the ray that no surface hides. */
  markAt(ray, beyond, ease) {
    const radius = this.diagonal() * BALL;
    const at = new THREE.Vector3();
    let found = null;
    let nearest = beyond + 2 * radius;
    for (const group of [this.marks, this.scanMarks]) {
      if (!group.visible) continue;
      for (const ball of group.children) {
        ball.getWorldPosition(at);
        const distance = at.distanceTo(ray.origin);
        if (ray.distanceToPoint(at) < ease * radius && distance < nearest) {
          nearest = distance;
          found = ball.userData.mark;
        }
      }
    }
    return found;
  }

  // --- drawing

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  /** Draw in the next frame, once for all calls until then. */
  draw() {
    this.due ??= requestAnimationFrame(() => {
      this.due = undefined;
      const colour = getComputedStyle(this.canvas).backgroundColor;
      this.renderer.setClearColor(new THREE.Color().setStyle(colour, THREE.LinearSRGBColorSpace), 1);
      this.renderer.render(this.scene, this.camera);
    });
  }

  close() {
    this.cancelPicking();
    cancelAnimationFrame(this.due);
    this.size.disconnect();
    this.controls.dispose();
    this.picker.close();
    this.scene.traverse((each) => each.geometry?.dispose());
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
