/** One surface of the viewer, a mesh or a cloud: its shape, its colours, what of it is hidden, and where a ray, a point or a plane meets it.
 *  Frame: that of its file, mm. */

import * as THREE from './vendor/three/three.module.js';
import { MeshBVH } from './vendor/three_mesh_bvh/index.module.js';
import { NOT_COUNTED, isCounted, of } from './colours.js';
import { LAYERS } from './drawing.js';
import { nearestVertex } from './geometry.js';

const STEPS = 1024; // colours of a table
const HIDDEN = 0; // of the fourth part of a colour

/** What a worker makes of a file. kind : `glb` or `ply` */
export function read(file, kind) {
  const worker = new Worker(new URL('./surface_worker.js', import.meta.url), { type: 'module' });
  return new Promise((resolve, reject) => {
    worker.onmessage = ({ data: { made, error } }) => (made ? resolve(made) : reject(new Error(error)));
    worker.onerror = (event) => reject(new Error(event.message || 'the viewer cannot read the file'));
    worker.postMessage({ file, kind }, [file]);
  }).finally(() => worker.terminate());
}

export class Surface {
  /** what : `design` or `scan`; made : of `read` */
  constructor(what, { isCloud, positions, normals, colours, index, values, areas, extremes, roots, levels }) {
    Object.assign(this, { what, isCloud, positions, normals, colours, index, values, areas, extremes });
    this.hidden = null; // 1 for each vertex that is not shown
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute('color', new THREE.BufferAttribute(colours, 4, true));
    if (normals) geometry.setAttribute('normal', new THREE.BufferAttribute(normals, 3));
    if (index) geometry.setIndex(new THREE.BufferAttribute(index, 1));
    this.bvh = roots ? MeshBVH.deserialize({ version: 1, roots, index, indirectBuffer: null }, geometry, { setIndex: false }) : null;
    this.object = isCloud ? points(geometry) : mesh(geometry);
    this.object.userData.what = what;
    this.object.layers.set(LAYERS[what]);
    geometry.computeBoundingBox();
    geometry.computeBoundingSphere();
    this.box = geometry.boundingBox;
    this.levels = [geometry, ...levels.map((each) => coarser(geometry, each))];
  }

  /** Triangles or points of a level, 0 the whole. */
  size(level) {
    const { index, attributes } = this.at(level);
    return this.isCloud ? (index ?? attributes.position).count : index.count / 3;
  }

  /** What is drawn in the next frame: a level, or `count` triangles or points of it. */
  draw(level, from = 0, count = Infinity) {
    const each = this.isCloud ? 1 : 3;
    this.object.geometry = this.at(level);
    this.object.geometry.setDrawRange(each * from, each * count);
  }

  at(level) {
    return this.levels[Math.min(level, this.levels.length - 1)];
  }

  get count() {
    return this.areas.length;
  }

  /** Typical distance between neighbours. */
  get spacing() {
    const all = this.isCloud ? this.box.getSize(new THREE.Vector3()).lengthSq() : this.areas.reduce((a, b) => a + b, 0);
    return Math.sqrt(all / this.count);
  }

  position(vertex) {
    return [...this.positions.subarray(3 * vertex, 3 * vertex + 3)];
  }

  normal(vertex) {
    return this.normals ? [...this.normals.subarray(3 * vertex, 3 * vertex + 3)] : null;
  }

  // --- colours

  /** By deviation. scale : as in colours.js */
  recolour(scale) {
    const { low, high } = scale;
    const table = new Uint8Array(3 * (STEPS + 1));
    for (let k = 0; k < STEPS; k += 1) table.set(of(low + ((k + 0.5) / STEPS) * (high - low), scale), 3 * k);
    table.set(NOT_COUNTED, 3 * STEPS);
    const { values, colours } = this;
    const factor = STEPS / (high - low);
    for (let k = 0; k < values.length; k += 1) {
      const step = isCounted(values[k]) ? Math.min(STEPS - 1, Math.max(0, Math.floor((values[k] - low) * factor))) : STEPS;
      for (let part = 0; part < 3; part += 1) colours[4 * k + part] = table[3 * step + part];
    }
    this.object.geometry.attributes.color.needsUpdate = true;
  }

  /** By number. labels : (n) of each vertex; colourOf : number -> [r, g, b] of 255 */
  colourBy(labels, colourOf) {
    const table = new Map();
    for (let k = 0; k < this.count; k += 1) {
      if (!table.has(labels[k])) table.set(labels[k], colourOf(labels[k]));
      const colour = table.get(labels[k]);
      for (let part = 0; part < 3; part += 1) this.colours[4 * k + part] = colour[part];
    }
    this.object.geometry.attributes.color.needsUpdate = true;
  }

  /** labels : (n) of each vertex; isShown : number -> whether; without them all is shown */
  hide(labels, isShown) {
    this.hidden = labels ? Uint8Array.from(labels, (each) => (isShown(each) ? 0 : 1)) : null;
    for (let k = 0; k < this.count; k += 1) this.colours[4 * k + 3] = this.hidden?.[k] ? HIDDEN : 255;
    this.object.geometry.attributes.color.needsUpdate = true;
  }

  // --- where it is met

  /** The nearest place on a ray between two distances: {vertex, point, distance}, in this frame, or null.
   *  reach : distance along the ray -> how far off the ray a point of a cloud may lie, mm */
  meet(ray, near, far, reach) {
    if (this.isCloud) return this.meetPoints(ray, near, far, reach);
    let found = null;
    for (const { point, face, distance } of this.bvh.raycast(ray, THREE.DoubleSide, near, far)) {
      if (found && found.distance <= distance) continue;
      const vertex = this.corner([face.a, face.b, face.c], point);
      if (!this.hidden?.[vertex]) found = { vertex, point, distance };
    }
    return found;
  }

  corner(corners, point) {
    const square = (vertex) => point.distanceToSquared(new THREE.Vector3(...this.position(vertex)));
    return corners.reduce((best, each) => (square(each) < square(best) ? each : best));
  }

  meetPoints({ origin: o, direction: d }, near, far, reach) {
    const at = this.positions;
    let [vertex, nearest] = [-1, far];
    for (let k = 0; k < at.length; k += 3) {
      const [x, y, z] = [at[k] - o.x, at[k + 1] - o.y, at[k + 2] - o.z];
      const along = x * d.x + y * d.y + z * d.z;
      if (along < near || along >= nearest) continue;
      if (x * x + y * y + z * z - along * along < reach(along) ** 2 && !this.hidden?.[k / 3]) [vertex, nearest] = [k / 3, along];
    }
    return vertex < 0 ? null : { vertex, point: new THREE.Vector3(...this.position(vertex)), distance: nearest };
  }

  /** Nearest to a point: {vertex, distance}; of a mesh the nearest corner of the nearest triangle. */
  nearest(position) {
    if (this.isCloud) return nearestVertex(this.positions, position);
    const at = new THREE.Vector3(...position);
    const { point, faceIndex } = this.bvh.closestPointToPoint(at);
    const vertex = this.corner([...this.index.subarray(3 * faceIndex, 3 * faceIndex + 3)], point);
    return { vertex, distance: at.distanceTo(new THREE.Vector3(...this.position(vertex))) };
  }

  /** The nearest place of a mesh to a point, [x, y, z]. */
  foot(position) {
    return this.bvh.closestPointToPoint(new THREE.Vector3(...position)).point.toArray();
  }

  /** Where it meets the plane across the axis 0, 1 or 2: [{ends: [{at, mm}, {at, mm}]}]; mm is the deviation, null where there is none. */
  cut(axis, offset) {
    const found = [];
    this.bvh?.shapecast({
      intersectsBounds: ({ min, max }) => min.getComponent(axis) <= offset && max.getComponent(axis) >= offset,
      intersectsRange: (first, count) => {
        for (let k = 3 * first; k < 3 * (first + count); k += 3) {
          const ends = this.crossing(k, axis, offset);
          if (ends) found.push({ ends });
        }
        return false;
      },
    });
    return found;
  }

  crossing(k, axis, offset) {
    const { positions: at, values } = this;
    const corners = [this.index[k], this.index[k + 1], this.index[k + 2]];
    const above = corners.map((vertex) => at[3 * vertex + axis] - offset);
    if ((above[0] > 0) === (above[1] > 0) && (above[1] > 0) === (above[2] > 0)) return null;
    if (this.hidden && corners.some((vertex) => this.hidden[vertex])) return null;
    const ends = [];
    for (const [i, j] of [[0, 1], [1, 2], [2, 0]]) {
      if ((above[i] > 0) === (above[j] > 0)) continue;
      const share = above[i] / (above[i] - above[j]);
      const mix = (array, part, width) => (1 - share) * array[width * corners[i] + part] + share * array[width * corners[j] + part];
      const isBoth = values && isCounted(values[corners[i]]) && isCounted(values[corners[j]]);
      ends.push({ at: [0, 1, 2].map((part) => mix(at, part, 3)), mm: isBoth ? mix(values, 0, 1) : null });
    }
    return ends;
  }

  /** The points of a cloud within a distance of the plane: [{at, mm}]. */
  slab(axis, offset, reach) {
    const found = [];
    for (let k = 0; k < this.count; k += 1) {
      if (Math.abs(this.positions[3 * k + axis] - offset) >= reach || this.hidden?.[k]) continue;
      found.push({ at: this.position(k), mm: this.values && isCounted(this.values[k]) ? this.values[k] : null });
    }
    return found;
  }
}

/** A level of a geometry: other triangles or points of the same vertices. */
function coarser(whole, index) {
  const level = new THREE.BufferGeometry();
  for (const [name, attribute] of Object.entries(whole.attributes)) level.setAttribute(name, attribute);
  level.setIndex(new THREE.BufferAttribute(index, 1));
  level.boundingSphere = whole.boundingSphere;
  return level;
}

const HIDE = 'if (vColor.a < 0.5) discard; diffuseColor.rgb *= vColor.rgb;'; // the fourth part says whether it is shown, not how opaque it is

function points(geometry) {
  const material = new THREE.PointsMaterial({ vertexColors: true, size: 3, sizeAttenuation: false });
  material.onBeforeCompile = (shader) => {
    shader.fragmentShader = shader.fragmentShader.replace('#include <color_fragment>', `#if defined(USE_COLOR_ALPHA)\n${HIDE}\n#endif`);
  };
  return new THREE.Points(geometry, material);
}

/** Its material has `userData.back`: 1 shades the backs of its faces, -1 their fronts, 0 neither. */
function mesh(geometry) {
  const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide });
  const back = { value: 0 };
  const plain = { value: 0 }; // 1: in the colour of the material
  Object.assign(material.userData, { back, plain });
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, { back, plain });
    shader.fragmentShader = `uniform float back;\nuniform float plain;\n${shader.fragmentShader}`.replace('#include <color_fragment>', `
      if (vColor.a < 0.5) discard;
      if (plain == 0.0) diffuseColor.rgb *= vColor.rgb;
      if (back != 0.0 && gl_FrontFacing == (back < 0.0)) diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.28, 0.31, 0.36), 0.75);`);
  };
  return new THREE.Mesh(geometry, material);
}
