/** The scan on the design, in three dimensions. Works in millimetres; the files are in metres. */

import * as THREE from './vendor/three/three.module.js';
import { OrbitControls } from './vendor/three/OrbitControls.js';
import { GLTFLoader } from './vendor/three/GLTFLoader.js';
import { NOT_COUNTED, of } from './colours.js';

const MM = 1000;
const loader = new GLTFLoader();

export class Viewer {
  constructor(canvas, onHover) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // our colours are meant as they stand
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(30, 1, 0.1, 10000);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.listenToKeyEvents(canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.scene.add(new THREE.AmbientLight(0xffffff, 1.1));
    this.lamp = new THREE.DirectionalLight(0xffffff, 2.2);
    this.camera.add(this.lamp);
    this.scene.add(this.camera);
    this.scan = new THREE.Group();
    this.design = new THREE.Group();
    this.marks = new THREE.Group();
    this.lines = new THREE.Group();
    this.scan.matrixAutoUpdate = false;
    this.scene.add(this.scan, this.design, this.marks, this.lines);
    this.onHover = onHover;
    canvas.addEventListener('pointermove', (event) => this.hover(event));
    canvas.addEventListener('keydown', (event) => { if ('+-'.includes(event.key)) this.zoom(event.key === '+' ? 0.85 : 1 / 0.85); });
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  async load(designFile, scanFile) {
    const [design, scan] = await Promise.all([parse(designFile), scanFile ? parse(scanFile) : null]);
    for (const node of surfaces(design)) this.design.add(shaded(node));
    if (scan) for (const node of surfaces(scan)) this.scan.add(shaded(node));
    this.values = this.scan.children[0]?.geometry.getAttribute('_deviation_mm');
    this.frame('+z');
  }

  /** Colour every vertex anew. */
  recolour(limit, tolerance) {
    const target = this.scan.children[0]?.geometry.getAttribute('color');
    if (!this.values || !target) return;
    const step = target.itemSize;
    const scale = target.array instanceof Uint8Array ? 1 : target.array instanceof Uint16Array ? 257 : 1 / 255;
    for (let k = 0; k < this.values.count; k += 1) {
      const mm = this.values.array[k];
      const colour = Number.isFinite(mm) && mm < 1e30 ? of(mm, limit, tolerance) : NOT_COUNTED;
      for (let part = 0; part < 3; part += 1) target.array[k * step + part] = colour[part] * scale;
    }
    target.needsUpdate = true;
    this.draw();
  }

  /** matrix : rows of the 4 x 4 motion of the file's scan from the final pose */
  pose(matrix) {
    this.scan.matrix.set(...matrix.flat());
    this.scan.matrixWorldNeedsUpdate = true;
    this.draw();
  }

  landmarks(points, size) {
    const shape = new THREE.SphereGeometry(size * 0.006, 12, 8);
    for (const { position, colour, words } of points) {
      const ball = new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ color: colour }));
      ball.position.set(...position);
      ball.userData.words = words;
      this.marks.add(ball);
    }
  }

  matches(pairs) {
    const points = pairs.flat().map((each) => new THREE.Vector3(...each));
    const material = new THREE.LineBasicMaterial({ color: 0xd0107a, depthTest: false });
    this.lines.add(new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points), material));
  }

  show(what, isShown) {
    this[what].visible = isShown;
    this.draw();
  }

  frame(side) {
    const box = new THREE.Box3().setFromObject(this.design).union(new THREE.Box3().setFromObject(this.scan));
    const centre = box.getCenter(new THREE.Vector3());
    const radius = box.getSize(new THREE.Vector3()).length() / 2;
    const towards = { '+x': [1, 0, 0], '-x': [-1, 0, 0], '+y': [0, 1, 0], '-y': [0, -1, 0], '+z': [0, 0, 1], '-z': [0, 0, -1], oblique: [0.6, -0.8, 0.7] }[side];
    this.camera.up.set(...(side.endsWith('z') ? [0, 1, 0] : [0, 0, 1]));
    this.camera.position.copy(centre).addScaledVector(new THREE.Vector3(...towards).normalize(), radius * 3.6);
    this.camera.near = radius / 50;
    this.camera.far = radius * 30;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(centre);
    this.controls.update();
    this.draw();
  }

  zoom(by) {
    this.camera.position.sub(this.controls.target).multiplyScalar(by).add(this.controls.target);
    this.controls.update();
    this.draw();
  }

  hover(event) {
    const box = this.canvas.getBoundingClientRect();
    const place = new THREE.Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(place, this.camera);
    const hit = this.marks.visible ? ray.intersectObjects(this.marks.children, false)[0] : undefined;
    this.onHover(hit?.object.userData.words ?? '');
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    const colour = getComputedStyle(this.canvas).backgroundColor;
    this.renderer.setClearColor(new THREE.Color().setStyle(colour, THREE.LinearSRGBColorSpace));
    this.renderer.render(this.scene, this.camera);
  }

  close() {
    this.controls.dispose();
    this.renderer.dispose();
  }
}

const parse = (file) => loader.parseAsync(file, '');

function surfaces(gltf) {
  const found = [];
  gltf.scene.updateMatrixWorld(true);
  gltf.scene.traverse((node) => { if ((node.isMesh || node.isPoints) && !/landmarks/.test(node.name)) found.push(node); });
  return found;
}

function shaded(node) {
  const geometry = node.geometry.clone().applyMatrix4(node.matrixWorld).scale(MM, MM, MM);
  if (node.isPoints) return new THREE.Points(geometry, new THREE.PointsMaterial({ vertexColors: true, size: 2, sizeAttenuation: false }));
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
}
