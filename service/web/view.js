/** From where the part is looked at: two cameras, named views, fitting, zoom; and where a place is drawn. Frame: that of the design, mm. */

import * as THREE from './vendor/three/three.module.js';
import { OrbitControls } from './vendor/three/OrbitControls.js';
import { fittingHeight } from './geometry.js';
import { DIRECTIONS, upOf } from './views.js';

const MARGIN = 1.08; // of the view, around the part
const FOV_DEG = 30; // of the perspective
const FAR_AWAY = 4; // radii of the part between the eye and its centre, where lines stay parallel
const HALF_FOV = Math.tan((FOV_DEG * Math.PI) / 360);

export class View {
  /** box : () -> THREE.Box3 of the part; onChange : called when the part is to be drawn again */
  constructor(canvas, box, onChange) {
    Object.assign(this, { canvas, box, onChange });
    this.parallel = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 10000);
    this.perspective = new THREE.PerspectiveCamera(FOV_DEG, 1, 0.1, 10000);
    for (const camera of [this.parallel, this.perspective]) camera.layers.enableAll();
    this.camera = this.parallel;
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', onChange);
  }

  /** The whole part, from one of the named sides. */
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

  /** Show the whole part. direction : from which side; by default the present one */
  fit(direction = this.camera.position.clone().sub(this.controls.target)) {
    const box = this.box();
    const half = box.getSize(new THREE.Vector3()).divideScalar(2);
    this.radius = Math.max(half.length(), 1e-6);
    box.getCenter(this.controls.target);
    this.look(direction.normalize(), MARGIN * fittingHeight(half, direction, this.camera.up, this.aspect ?? 1));
  }

  /** direction : unit vector from the target to the eye; height : half of what the view shows there, mm */
  look(direction, height) {
    const isFlat = this.camera === this.parallel;
    const away = isFlat ? FAR_AWAY * this.radius : height / HALF_FOV + this.radius;
    this.camera.position.copy(this.controls.target).addScaledVector(direction, away);
    this.camera.near = isFlat ? 0.01 * this.radius : this.radius / 50;
    this.camera.far = isFlat ? 3 * FAR_AWAY * this.radius : this.radius * 30;
    this.height = height;
    this.shape();
    this.controls.update();
    this.onChange();
  }

  /** Look along the inward normal of a place, unless it can be seen already. */
  turnTo(normal) {
    const eye = this.camera.position.clone().sub(this.controls.target);
    const towards = new THREE.Vector3(...normal);
    if (towards.dot(eye) < 0.5 * eye.length()) this.camera.position.copy(this.controls.target).addScaledVector(towards.normalize(), eye.length());
    this.controls.update();
  }

  /** The canvas has another size. */
  resize(aspect) {
    this.aspect = aspect;
    if (!this.height) return;
    const { zoom } = this.parallel;
    this.shape();
    this.parallel.zoom = zoom;
    this.camera.updateProjectionMatrix();
  }

  /** The camera fits the canvas. */
  shape() {
    const aspect = this.aspect ?? 1;
    if (this.camera === this.parallel) Object.assign(this.parallel, { left: -this.height * aspect, right: this.height * aspect, top: this.height, bottom: -this.height, zoom: 1 });
    else this.perspective.aspect = aspect;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  project(isPerspective) {
    const height = this.shownHeight();
    const direction = this.camera.position.clone().sub(this.controls.target).normalize();
    this.camera = isPerspective ? this.perspective : this.parallel;
    this.controls.object = this.camera;
    this.look(direction, isPerspective ? height - this.radius * HALF_FOV : height);
  }

  zoom(by) {
    if (this.camera === this.parallel) {
      this.parallel.zoom /= by;
      this.parallel.updateProjectionMatrix();
    } else this.camera.position.sub(this.controls.target).multiplyScalar(by).add(this.controls.target);
  }

  // --- where things are drawn

  /** Half of what the view shows at the target, mm. */
  shownHeight() {
    if (this.camera === this.parallel) return this.height / this.parallel.zoom;
    return this.camera.position.distanceTo(this.controls.target) * HALF_FOV;
  }

  mmPerPixel() {
    return (2 * this.shownHeight()) / Math.max(1, this.canvas.clientHeight);
  }

  /** Pixel of the canvas where a point is drawn, and how far from the eye: [x, y, depth]. */
  toScreen(position) {
    const at = new THREE.Vector3(...position).project(this.camera);
    return [((at.x + 1) / 2) * this.canvas.clientWidth, ((1 - at.y) / 2) * this.canvas.clientHeight, at.z];
  }

  /** Unit vector towards the eye. */
  eye() {
    return this.camera.position.clone().sub(this.controls.target).normalize().toArray();
  }

  close() {
    this.controls.dispose();
  }
}
