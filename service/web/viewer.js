/** The part in three dimensions: design, scan or one mesh, landmarks, matches. Millimetres, in the frame of the design. */

import * as THREE from './vendor/three/three.module.js';
import { OrbitControls } from './vendor/three/OrbitControls.js';
import { GLTFLoader } from './vendor/three/GLTFLoader.js';
import { NOT_COUNTED, isCounted, of } from './colours.js';
import { areas, fittingHeight, inMillimetres, nearestVertex, shaded, surfaces } from './geometry.js';
import { Picker } from './picking.js';
import { IDENTITY, moved } from './poses.js';
import { discTexture, ringTexture } from './textures.js';
import { DIRECTIONS, upOf } from './views.js';
import { listen } from './viewer_input.js';

const MARGIN = 1.08; // of the view, around the part
const BALL = 0.0075; // radius of a landmark, as a share of the diagonal
const FOV_DEG = 30; // of the perspective
const FAR_AWAY = 4; // radii of the part between the eye and its centre, where lines stay parallel
const SEE_THROUGH = 0.25; // opacity of the design over the scan
const LIFT = 0.004; // of the diagonal, or the largest deviation: the design is drawn so far in front of the scan, without stripes
const UNDER = 0x7e8896; // of the design, with the scan over it
const STEPS = 1024; // colours of a table
const VISIBLE = 0.005; // of the diagonal: a place is visible when what is drawn there lies as near to it
const loader = new GLTFLoader();
THREE.ColorManagement.enabled = false; // our colours are sRGB values already

export class Viewer {
  /** onHover : called with what is under the pointer, {mark} or {what, vertex, point}, or null; onPick : with the same on a click;
   *  onDrawn : after each frame */
  constructor(canvas, { onHover, onPick, onDrawn }) {
    this.canvas = canvas;
    Object.assign(this, { onHover, onPick, onDrawn });
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // as above
    this.parallel = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 10000);
    this.perspective = new THREE.PerspectiveCamera(FOV_DEG, 1, 0.1, 10000);
    this.camera = this.parallel;
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.picker = new Picker(this.renderer);
    this.scene = new THREE.Scene();
    this.light = new THREE.DirectionalLight(0xffffff, 2.2);
    this.scene.add(new THREE.AmbientLight(0xffffff, 1.1), this.light, this.light.target);
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
    this.isCloud = false;
    this.pairs = [];
    this.lift = 0;
    this.kept = () => true; // whether a place is not cut away
    this.addSpots();
    this.cancelPicking = listen(this);
    this.size = new ResizeObserver(() => this.resize());
    this.size.observe(canvas);
  }

  addSpots() {
    this.ring = new THREE.Sprite(new THREE.SpriteMaterial({ map: ringTexture(), depthTest: false, sizeAttenuation: false, transparent: true }));
    this.ring.visible = false;
    const dots = new THREE.PointsMaterial({ color: 0xd0107a, size: 11, sizeAttenuation: false, depthTest: false, map: discTexture(), transparent: true });
    this.dots = new THREE.Points(new THREE.BufferGeometry(), dots);
    this.dots.visible = false;
    this.dots.frustumCulled = false;
    this.outline = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xd0107a, depthTest: false }));
    this.outline.frustumCulled = false;
    this.scene.add(this.ring, this.dots, this.outline);
  }

  // --- what is shown

  async loadDesign(glb) {
    for (const node of surfaces(await loader.parseAsync(glb, ''))) this.add('design', shaded(inMillimetres(node), node.isPoints));
  }

  async loadScan(glb) {
    for (const node of surfaces(await loader.parseAsync(glb, ''))) this.add('scan', shaded(inMillimetres(node), node.isPoints));
    const { geometry, isPoints } = this.scan.children[0];
    this.values = geometry.getAttribute('_deviation_mm')?.array ?? null;
    this.areas = areas(geometry);
    this.isCloud = Boolean(isPoints);
    const share = isPoints ? this.diagonal() ** 2 : this.areas.reduce((a, b) => a + b, 0);
    this.spacing = Math.sqrt(share / this.areas.length);
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

  /** Shade the backs of the faces, so that they are not taken for fronts. The design says which side of the scan is which. */
  shadeBacks() {
    for (const shown of this.design.children) shown.material.userData.back.value = 1;
    for (const shown of this.scan.children) if (!shown.isPoints) shown.material.userData.back.value = this.scanSide() > 0 ? 1 : -1;
  }

  /** +1 where the normals of the scan point as those of the design do, -1 where they point against them */
  scanSide() {
    this.side ??= this.compareSides();
    return this.side;
  }

  compareSides() {
    const [design] = this.design.children;
    const [scan] = this.scan.children;
    if (!design || !scan || scan.isPoints) return 1;
    const [a, b] = [design, scan].map((each) => each.geometry.attributes);
    const step = Math.max(1, Math.floor(b.position.count / 50));
    let sum = 0;
    for (let k = 0; k < b.position.count; k += step) {
      const at = new THREE.Vector3().fromBufferAttribute(b.position, k).applyMatrix4(this.scan.matrix);
      const { vertex } = nearestVertex(a.position.array, at.toArray());
      const ofScan = new THREE.Vector3().fromBufferAttribute(b.normal, k).transformDirection(this.scan.matrix);
      sum += Math.sign(ofScan.dot(new THREE.Vector3().fromBufferAttribute(a.normal, vertex)));
    }
    return sum >= 0 ? 1 : -1;
  }

  /** Recolour every vertex of the scan by its deviation. scale : as in colours.js */
  recolour(scale) {
    const target = this.scan.children[0]?.geometry.getAttribute('color');
    if (!this.values || !target) return;
    const step = target.itemSize;
    const factor = target.array instanceof Uint8Array ? 1 : target.array instanceof Uint16Array ? 257 : 1 / 255;
    const { low, high } = scale;
    const table = Array.from({ length: STEPS }, (_, k) => of(low + ((k + 0.5) / STEPS) * (high - low), scale));
    for (let k = 0; k < this.values.length; k += 1) {
      const place = Math.floor(((this.values[k] - low) / (high - low)) * STEPS);
      const colour = isCounted(this.values[k]) ? table[Math.min(STEPS - 1, Math.max(0, place))] : NOT_COUNTED;
      for (let part = 0; part < 3; part += 1) target.array[k * step + part] = colour[part] * factor;
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

  /** The vertices of the scan that lie lowest and highest: [{mm, position, normal}], in the frame of its file. */
  extremes() {
    const { position, normal } = this.scan.children[0].geometry.attributes;
    let [low, high] = [-1, -1];
    this.values.forEach((value, k) => {
      if (!isCounted(value)) return;
      if (low < 0 || value < this.values[low]) low = k;
      if (high < 0 || value > this.values[high]) high = k;
    });
    return [low, high].filter((k) => k >= 0).map((k) => ({
      mm: this.values[k],
      position: [position.getX(k), position.getY(k), position.getZ(k)],
      normal: normal ? [normal.getX(k), normal.getY(k), normal.getZ(k)].map((part) => part * this.scanSide()) : null,
    }));
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
    this.seeThrough();
    this.draw();
  }

  /** Two surfaces in the same place would be drawn in stripes: the design is a grey veil in front of a scan with triangles, and a
   *  grey body behind a cloud of points. Alone it has the colours of its segments. */
  seeThrough() {
    const isBoth = this.design.visible && this.scan.visible && this.scan.children.length > 0;
    const isVeil = isBoth && !this.isCloud;
    const apart = this.values && isBoth ? Math.max(...this.extremes().map(({ mm }) => Math.abs(mm))) : 0;
    const lift = Math.min(Math.max(LIFT * this.diagonal(), 1.2 * apart), 5 * LIFT * this.diagonal());
    this.lift = isVeil ? lift : isBoth ? -lift : 0;
    for (const { material } of this.design.children) {
      Object.assign(material, { transparent: isVeil, opacity: isVeil ? SEE_THROUGH : 1, depthWrite: !isVeil, vertexColors: !isBoth, needsUpdate: true });
      material.color.set(isBoth ? UNDER : 0xffffff);
    }
    this.picker.skip = isBoth ? 'design' : null;
  }

  /** Keep what lies below `offset` along the axis 0, 1 or 2; null shows all. */
  clip(axis, offset) {
    const normal = new THREE.Vector3().setComponent(axis ?? 0, -1);
    this.kept = (position) => offset === null || position[axis] <= offset;
    this.renderer.clippingPlanes = offset === null ? [] : [new THREE.Plane(normal, offset)];
    this.draw();
  }

  /** Lines in front of everything: (6 k) ends of segments, in the frame of the design. */
  drawOutline(ends) {
    this.outline.geometry.dispose();
    this.outline.geometry = new THREE.BufferGeometry();
    this.outline.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(ends), 3));
    this.outline.visible = ends.length > 0;
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

  /** Unit outward normal of the design near a point. */
  normalOfDesign(position) {
    const [shown] = this.design.children;
    if (!shown) return [0, 0, 1];
    const { vertex } = nearestVertex(shown.geometry.attributes.position.array, position);
    return new THREE.Vector3().fromBufferAttribute(shown.geometry.attributes.normal, vertex).toArray();
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
    this.setUp(upOf(side));
    this.fit(new THREE.Vector3(...DIRECTIONS[side]));
  }

  /** The whole part, from where a unit vector points. */
  fitAlong(direction) {
    this.setUp(Math.abs(direction[2]) > 0.9 ? [0, 1, 0] : [0, 0, 1]);
    this.fit(new THREE.Vector3(...direction));
  }

  /** The controls turn about this axis. */
  setUp(up) {
    for (const camera of [this.parallel, this.perspective]) camera.up.set(...up);
    this.controls._quat.setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
    this.controls._quatInverse.copy(this.controls._quat).invert();
  }

  /** The first of the named views from which a point is visible, those that look at its front first; none: null.
   *  position, normal : in the frame of the design */
  sideThatShows(position, normal) {
    const facing = (side) => normal.reduce((sum, part, k) => sum + part * DIRECTIONS[side][k], 0) / Math.hypot(...DIRECTIONS[side]);
    const sides = Object.keys(DIRECTIONS).filter((side) => facing(side) > 0.2).sort((a, b) => facing(b) - facing(a));
    for (const side of sides) {
      this.frame(side);
      const [x, y] = this.toScreen(position);
      const seen = this.picker.at(this.camera, x, y, this.canvas.clientWidth, this.canvas.clientHeight);
      if (seen && seen.point.distanceTo(new THREE.Vector3(...position)) < VISIBLE * this.diagonal()) return side;
    }
    return null;
  }

  /** Show the whole part. direction : from which side; by default the present one */
  fit(direction = this.camera.position.clone().sub(this.controls.target)) {
    const box = this.box();
    const centre = box.getCenter(new THREE.Vector3());
    const half = box.getSize(new THREE.Vector3()).divideScalar(2);
    this.radius = Math.max(half.length(), 1e-6);
    this.controls.target.copy(centre);
    this.look(direction.normalize(), MARGIN * fittingHeight(half, direction, this.camera.up, this.aspect ?? 1));
  }

  /** direction : unit vector from the target to the eye; height : half of what the view shows there, mm */
  look(direction, height) {
    const isFlat = this.camera === this.parallel;
    const away = isFlat ? FAR_AWAY * this.radius : height / Math.tan((FOV_DEG * Math.PI) / 360) + this.radius;
    this.camera.position.copy(this.controls.target).addScaledVector(direction, away);
    this.camera.near = isFlat ? 0.01 * this.radius : this.radius / 50;
    this.camera.far = isFlat ? 3 * FAR_AWAY * this.radius : this.radius * 30;
    this.height = height;
    this.shape();
    this.controls.update();
    this.draw();
  }

  /** The camera fits the canvas. */
  shape() {
    const aspect = this.aspect ?? 1;
    if (this.camera === this.parallel) Object.assign(this.parallel, { left: -this.height * aspect, right: this.height * aspect, top: this.height, bottom: -this.height, zoom: 1 });
    else this.perspective.aspect = aspect;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  /** Half of what the view shows at the target, mm. */
  shownHeight() {
    if (this.camera === this.parallel) return this.height / this.parallel.zoom;
    return this.camera.position.distanceTo(this.controls.target) * Math.tan((FOV_DEG * Math.PI) / 360);
  }

  mmPerPixel() {
    return (2 * this.shownHeight()) / Math.max(1, this.canvas.clientHeight);
  }

  project(isPerspective) {
    const height = this.shownHeight();
    const direction = this.camera.position.clone().sub(this.controls.target).normalize();
    this.camera = isPerspective ? this.perspective : this.parallel;
    this.controls.object = this.camera;
    this.look(direction, isPerspective ? height - this.radius * Math.tan((FOV_DEG * Math.PI) / 360) : height);
  }

  zoom(by) {
    if (this.camera === this.parallel) {
      this.parallel.zoom /= by;
      this.parallel.updateProjectionMatrix();
    } else this.camera.position.sub(this.controls.target).multiplyScalar(by).add(this.controls.target);
  }

  /** Pixel of the canvas where a point of the frame of the design is drawn, and how far from the eye: [x, y, depth]. */
  toScreen(position) {
    const at = new THREE.Vector3(...position).project(this.camera);
    return [((at.x + 1) / 2) * this.canvas.clientWidth, ((1 - at.y) / 2) * this.canvas.clientHeight, at.z];
  }

  /** Unit vector towards the eye. */
  eye() {
    return this.camera.position.clone().sub(this.controls.target).normalize().toArray();
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
    this.aspect = width / height;
    if (this.height) {
      const { zoom } = this.parallel;
      this.shape();
      this.parallel.zoom = zoom;
      this.camera.updateProjectionMatrix();
    }
    this.draw();
  }

  /** Draw in the next frame, once for all calls until then. */
  draw() {
    this.due ??= requestAnimationFrame(() => {
      this.due = undefined;
      const colour = getComputedStyle(this.canvas).backgroundColor;
      const eye = this.camera.position.clone().sub(this.controls.target).normalize();
      this.light.position.copy(this.controls.target).add(eye);
      this.light.target.position.copy(this.controls.target);
      this.design.position.copy(eye).multiplyScalar(this.lift);
      this.ring.scale.setScalar(this.camera === this.parallel ? 24 * this.mmPerPixel() : 0.045);
      this.renderer.setClearColor(new THREE.Color().setStyle(colour, THREE.LinearSRGBColorSpace), 1);
      this.renderer.render(this.scene, this.camera);
      this.onDrawn?.();
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
