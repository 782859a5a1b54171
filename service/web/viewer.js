/** The part in three dimensions: design, scan or one mesh, landmarks, matches. Millimetres, in the frame of the design. */

import * as THREE from './vendor/three/three.module.js';
import { OrbitControls } from './vendor/three/OrbitControls.js';
import { GLTFLoader } from './vendor/three/GLTFLoader.js';
import { NOT_COUNTED, isCounted, of } from './colours.js';
import { Picker } from './picking.js';
import { IDENTITY, moved } from './poses.js';

const MM = 1000; // glTF is in metres
const SLOW_MS = 12; // a look at what is under the pointer that takes longer waits until the pointer rests
const REST_MS = 120;
const TURN = Math.PI / 36;
const MARGIN = 1.05; // of air around the part
const BALL = 0.0075; // radius of a landmark, of the diagonal
const DIRECTIONS = { '+x': [1, 0, 0], '-x': [-1, 0, 0], '+y': [0, 1, 0], '-y': [0, -1, 0], '+z': [0, 0, 1], '-z': [0, 0, -1], oblique: [0.6, -0.8, 0.7] };
const loader = new GLTFLoader();
THREE.ColorManagement.enabled = false; // our colours are meant as they stand

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
    this.listen();
    this.size = new ResizeObserver(() => this.resize());
    this.size.observe(canvas);
  }

  addSpots() {
    this.ring = new THREE.Sprite(new THREE.SpriteMaterial({ map: ringPicture(), depthTest: false, sizeAttenuation: false, transparent: true }));
    this.ring.scale.setScalar(0.045);
    this.ring.visible = false;
    const dots = new THREE.PointsMaterial({ color: 0xd0107a, size: 11, sizeAttenuation: false, depthTest: false, map: discPicture(), transparent: true });
    this.dots = new THREE.Points(new THREE.BufferGeometry(), dots);
    this.dots.visible = false;
    this.dots.frustumCulled = false;
    this.scene.add(this.ring, this.dots);
  }

  listen() {
    let frame;
    let rest;
    let took = 0;
    let pressed = null;
    const look = (event) => {
      const begun = performance.now();
      this.onHover(this.under(event));
      took = performance.now() - begun;
    };
    this.forget = () => {
      cancelAnimationFrame(frame);
      clearTimeout(rest);
    };
    this.canvas.addEventListener('pointermove', (event) => {
      if (event.buttons) return; // it turns
      this.forget();
      if (took > SLOW_MS) rest = setTimeout(() => look(event), REST_MS);
      else frame = requestAnimationFrame(() => look(event));
    });
    this.canvas.addEventListener('pointerleave', (event) => {
      this.forget();
      if (event.pointerType !== 'touch') this.onHover(null); // a finger that is lifted has asked
    });
    this.canvas.addEventListener('pointerdown', (event) => { pressed = [event.clientX, event.clientY]; });
    this.canvas.addEventListener('pointerup', (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 5) return;
      const found = this.under(event);
      this.onHover(found);
      this.onPick(found);
    });
    this.canvas.addEventListener('keydown', (event) => {
      const act = {
        ArrowLeft: () => this.controls.rotateLeft(TURN),
        ArrowRight: () => this.controls.rotateLeft(-TURN),
        ArrowUp: () => this.controls.rotateUp(TURN),
        ArrowDown: () => this.controls.rotateUp(-TURN),
        '+': () => this.zoom(0.85),
        '=': () => this.zoom(0.85),
        '-': () => this.zoom(1 / 0.85),
        0: () => this.frame('+z'),
      }[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
      this.controls.update();
      this.draw();
    });
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

  /** Colour every vertex of the scan anew. */
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

  /** Deviation at the vertex of the scan that is nearest to `position`, and how far that is: {mm, away}. */
  deviationNear(position) {
    const at = this.scan.children[0]?.geometry.attributes.position.array;
    if (!at || !this.values) return null;
    let best = Infinity;
    let vertex = 0;
    for (let k = 0; k < this.values.length; k += 1) {
      const square = (at[3 * k] - position[0]) ** 2 + (at[3 * k + 1] - position[1]) ** 2 + (at[3 * k + 2] - position[2]) ** 2;
      if (square < best) { best = square; vertex = k; }
    }
    return { mm: this.values[vertex], away: Math.sqrt(best) };
  }

  /** matrix : rows of the 4 x 4 motion of the scan from where its file has it */
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

  /** points : {position, colour, ...}, handed back on hover as `mark`; of the scan: in the frame that its file has */
  landmarks(points, isOfScan = false) {
    const radius = this.diagonal() * BALL;
    const shape = isOfScan ? new THREE.OctahedronGeometry(radius * 1.2) : new THREE.SphereGeometry(radius, 16, 12);
    const edge = new THREE.MeshBasicMaterial({ color: 0x101418, side: THREE.BackSide });
    for (const mark of points) {
      const ball = new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ color: mark.colour }));
      const rim = new THREE.Mesh(shape, edge); // tells it from the segment behind, which has its colour
      rim.scale.setScalar(1.22);
      ball.add(rim);
      ball.position.set(...mark.position);
      ball.userData.mark = mark;
      (isOfScan ? this.scanMarks : this.marks).add(ball);
    }
    this.scene.updateMatrixWorld();
  }

  /** pairs : [on the design, on the scan as its file has it] */
  matches(pairs) {
    this.pairs = pairs;
    const line = new THREE.LineBasicMaterial({ color: 0xd0107a, depthTest: false });
    const dot = new THREE.PointsMaterial({ color: 0xd0107a, size: 6, sizeAttenuation: false, depthTest: false, map: discPicture(), transparent: true });
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

  /** Dots through everything, at points of the design's frame. */
  preview(points) {
    this.dots.geometry.dispose();
    this.dots.geometry = new THREE.BufferGeometry().setFromPoints(points.map((each) => new THREE.Vector3(...each)));
    this.dots.visible = points.length > 0;
    this.draw();
  }

  /** A ring around a point, null: none. isTurned : turn until it is seen */
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
    if (normal && normal.dot(eye) < 0.5 * eye.length()) { // else it is in sight as we look
      this.camera.position.copy(this.controls.target).addScaledVector(normal.normalize(), eye.length());
    }
    this.controls.update();
  }

  normalNear(position) {
    const shown = [...this.design.children, ...this.scan.children].find((each) => each.geometry.attributes.normal);
    if (!shown) return null;
    const at = shown.geometry.attributes.position;
    let best = Infinity;
    let vertex = 0;
    for (let k = 0; k < at.count; k += 1) {
      const square = (at.array[3 * k] - position.x) ** 2 + (at.array[3 * k + 1] - position.y) ** 2 + (at.array[3 * k + 2] - position.z) ** 2;
      if (square < best) { best = square; vertex = k; }
    }
    return new THREE.Vector3().fromBufferAttribute(shown.geometry.attributes.normal, vertex);
  }

  // --- where we look from

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

  /** All in sight. direction : from where, or as now */
  fit(direction = this.camera.position.clone().sub(this.controls.target)) {
    const box = this.box();
    const centre = box.getCenter(new THREE.Vector3());
    const half = box.getSize(new THREE.Vector3()).divideScalar(2);
    const radius = half.length();
    const view = new THREE.Matrix4().lookAt(direction.normalize(), new THREE.Vector3(), this.camera.up).transpose();
    const slope = Math.tan((this.camera.fov * Math.PI) / 360);
    let distance = 0;
    for (let corner = 0; corner < 8; corner += 1) {
      const at = new THREE.Vector3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1).multiply(half).applyMatrix4(view);
      distance = Math.max(distance, at.z + Math.abs(at.y) / slope, at.z + Math.abs(at.x) / (slope * this.camera.aspect));
    }
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

  /** Once, in the next frame, however often it is asked for. */
  draw() {
    this.due ??= requestAnimationFrame(() => {
      this.due = undefined;
      const colour = getComputedStyle(this.canvas).backgroundColor;
      this.renderer.setClearColor(new THREE.Color().setStyle(colour, THREE.LinearSRGBColorSpace), 1);
      this.renderer.render(this.scene, this.camera);
    });
  }

  close() {
    this.forget();
    cancelAnimationFrame(this.due);
    this.size.disconnect();
    this.controls.dispose();
    this.picker.close();
    this.scene.traverse((each) => each.geometry?.dispose());
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

function surfaces(gltf) {
  const found = [];
  gltf.scene.updateMatrixWorld(true);
  gltf.scene.traverse((node) => { if ((node.isMesh || node.isPoints) && !/landmarks/.test(node.name)) found.push(node); });
  return found;
}

const inMillimetres = (node) => node.geometry.clone().applyMatrix4(node.matrixWorld).scale(MM, MM, MM);

function shaded(geometry, isCloud) {
  if (isCloud) return new THREE.Points(geometry, new THREE.PointsMaterial({ vertexColors: true, size: 2, sizeAttenuation: false }));
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
}

/** (n) what each vertex counts for: a third of the triangles around it, 1 of points */
function areas(geometry) {
  const at = geometry.attributes.position;
  const index = geometry.index?.array;
  if (!index) return new Float32Array(at.count).fill(1);
  const found = new Float32Array(at.count);
  const [a, b, c] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
  for (let k = 0; k < index.length; k += 3) {
    a.fromBufferAttribute(at, index[k]);
    b.fromBufferAttribute(at, index[k + 1]).sub(a);
    c.fromBufferAttribute(at, index[k + 2]).sub(a);
    const third = b.cross(c).length() / 6;
    for (let corner = 0; corner < 3; corner += 1) found[index[k + corner]] += third;
  }
  return found;
}

function picture(paint) {
  const canvas = document.createElement('canvas');
  canvas.width = 64;
  canvas.height = 64;
  paint(canvas.getContext('2d'));
  return new THREE.CanvasTexture(canvas);
}

const ringPicture = () => picture((pen) => {
  for (const [width, colour] of [[12, '#fff'], [6, '#d0107a']]) {
    pen.lineWidth = width;
    pen.strokeStyle = colour;
    pen.beginPath();
    pen.arc(32, 32, 22, 0, 2 * Math.PI);
    pen.stroke();
  }
});

const discPicture = () => picture((pen) => {
  pen.fillStyle = '#fff';
  pen.beginPath();
  pen.arc(32, 32, 28, 0, 2 * Math.PI);
  pen.fill();
});
