/** What is drawn beside the surfaces of the viewer: landmarks, their matches, a ring, previews, outlines of sections and of limits. */

import * as THREE from './vendor/three/three.module.js';
import { LAYERS } from './drawing.js';
import { IDENTITY, moved } from './poses.js';
import { discTexture, ringTexture } from './textures.js';

const BALL = 0.0075; // radius of a landmark, as a share of the diagonal
const ACCENT = 0xd0107a;
const RING_PX = 24;
const RING_FAR = 0.045; // in a perspective, as a share of the view

const dotted = (size) => new THREE.PointsMaterial({ color: ACCENT, size, sizeAttenuation: false, depthTest: false, map: discTexture(), transparent: true });
const inFront = (colours) => new THREE.LineBasicMaterial({ ...colours, depthTest: false });

export class Marks {
  /** size : () -> diagonal of the part, mm */
  constructor(scene, size) {
    this.size = size;
    this.marks = new THREE.Group();
    this.scanMarks = new THREE.Group(); // move with the scan, shown with the others
    this.scanMarks.matrixAutoUpdate = false;
    this.lines = new THREE.Group();
    this.pairs = [];
    this.ring = new THREE.Sprite(new THREE.SpriteMaterial({ map: ringTexture(), depthTest: false, sizeAttenuation: false, transparent: true }));
    this.dots = new THREE.Points(new THREE.BufferGeometry(), dotted(11));
    this.outlines = {
      design: new THREE.LineSegments(new THREE.BufferGeometry(), inFront({ color: ACCENT })),
      scan: new THREE.LineSegments(new THREE.BufferGeometry(), inFront({ vertexColors: true })),
      limits: new THREE.LineSegments(new THREE.BufferGeometry(), inFront({ color: ACCENT })),
    };
    for (const each of [this.dots, ...Object.values(this.outlines)]) each.frustumCulled = false;
    for (const each of Object.values(this.outlines)) each.renderOrder = 1; // after the surfaces, which would cover them
    for (const each of [this.ring, this.dots, ...Object.values(this.outlines)]) each.visible = false;
    for (const each of [this.ring, this.dots]) each.layers.set(LAYERS.front);
    scene.add(this.marks, this.scanMarks, this.lines, this.ring, this.dots, ...Object.values(this.outlines));
  }

  /** points : {position, colour, ...}; those of the scan are in the frame of its file */
  landmarks(points, isOfScan = false) {
    const radius = this.size() * BALL;
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
  }

  /** pairs : [point on the design, point on the scan in the frame of its file] */
  matches(pairs) {
    this.pairs = pairs;
    this.lines.add(new THREE.LineSegments(new THREE.BufferGeometry(), inFront({ color: ACCENT })), new THREE.Points(new THREE.BufferGeometry(), dotted(6))); // in a good pose a line is shorter than a pixel
    this.lines.children[1].layers.set(LAYERS.front);
    this.pose(IDENTITY);
  }

  /** matrix : rows of the motion (4 x 4) of the scan from the frame of its file */
  pose(matrix) {
    this.scanMarks.matrix.set(...matrix.flat());
    this.scanMarks.matrixWorldNeedsUpdate = true;
    const points = this.pairs.flatMap(([fixed, along]) => [fixed, moved(matrix, along)]).map((each) => new THREE.Vector3(...each));
    for (const drawn of this.lines.children) {
      drawn.geometry.dispose();
      drawn.geometry = new THREE.BufferGeometry().setFromPoints(points);
    }
  }

  show(isShown) {
    this.marks.visible = isShown;
    this.scanMarks.visible = isShown;
  }

  /** name : `design`, `scan` or `limits`; ends : (6 k) of lines in front of everything; colours : (6 k) of 255, of the scan */
  outline(name, ends, colours = null) {
    const drawn = this.outlines[name];
    drawn.geometry.dispose();
    drawn.geometry = new THREE.BufferGeometry();
    drawn.geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(ends), 3));
    if (colours) drawn.geometry.setAttribute('color', new THREE.BufferAttribute(new Uint8Array(colours), 3, true));
    drawn.visible = ends.length > 0;
  }

  /** Dots in front of everything. */
  preview(points) {
    this.dots.geometry.dispose();
    this.dots.geometry = new THREE.BufferGeometry().setFromPoints(points.map((each) => new THREE.Vector3(...each)));
    this.dots.visible = points.length > 0;
  }

  /** A ring around a point; null removes it. */
  point(position) {
    this.ring.visible = Boolean(position);
    if (position) this.ring.position.set(...position);
  }

  /** Before a frame. view : of view.js */
  scale(view) {
    this.ring.scale.setScalar(view.camera === view.parallel ? RING_PX * view.mmPerPixel() : RING_FAR);
  }

  /** The nearest landmark on a ray that nothing hides. beyond : distance of the surface; ease : how many radii off it may be */
  at(ray, beyond, ease) {
    const radius = this.size() * BALL;
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
}
