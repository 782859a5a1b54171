/** Geometry of the shown surfaces: read from glTF, measured. */

import * as THREE from './vendor/three/three.module.js';

const MM_PER_M = 1000; // glTF is in metres

/** The mesh or point cloud of a glTF scene, without the landmarks in it. */
export function surface(gltf) {
  let found = null;
  gltf.scene.updateMatrixWorld(true);
  gltf.scene.traverse((node) => { if (!found && (node.isMesh || node.isPoints) && !/landmarks/.test(node.name)) found = node; });
  if (!found) throw new Error('the file has no surface');
  return found;
}

export function inMillimetres(node) {
  const geometry = node.geometry.clone().applyMatrix4(node.matrixWorld).scale(MM_PER_M, MM_PER_M, MM_PER_M);
  return { isPoints: node.isPoints, geometry };
}

/** (n) area of each vertex in mm^2: a third of the triangles around it; 1 for each point of a cloud */
export function areas(geometry) {
  const at = geometry.attributes.position.array;
  const index = geometry.index?.array;
  if (!index) return new Float32Array(at.length / 3).fill(1);
  const perVertex = new Float32Array(at.length / 3);
  for (let k = 0; k < index.length; k += 3) {
    const [a, b, c] = [3 * index[k], 3 * index[k + 1], 3 * index[k + 2]];
    const [ux, uy, uz] = [at[b] - at[a], at[b + 1] - at[a + 1], at[b + 2] - at[a + 2]];
    const [vx, vy, vz] = [at[c] - at[a], at[c + 1] - at[a + 1], at[c + 2] - at[a + 2]];
    const sixth = Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 6;
    perVertex[index[k]] += sixth;
    perVertex[index[k + 1]] += sixth;
    perVertex[index[k + 2]] += sixth;
  }
  return perVertex;
}

/** The vertex nearest to a point. positions : (3 n) in mm; returns {vertex, distance} */
export function nearestVertex(positions, [x, y, z]) {
  let best = Infinity;
  let vertex = 0;
  for (let k = 0; k < positions.length; k += 3) {
    const square = (positions[k] - x) ** 2 + (positions[k + 1] - y) ** 2 + (positions[k + 2] - z) ** 2;
    if (square < best) { best = square; vertex = k / 3; }
  }
  return { vertex, distance: Math.sqrt(best) };
}

/** Half of the height that a view from `direction` must show, so that it has the box of half size `half` in it, mm. */
export function fittingHeight(half, direction, up, aspect) {
  const view = new THREE.Matrix4().lookAt(direction, new THREE.Vector3(), up).transpose();
  let height = 0;
  for (let corner = 0; corner < 8; corner += 1) {
    const at = new THREE.Vector3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1).multiply(half).applyMatrix4(view);
    height = Math.max(height, Math.abs(at.y), Math.abs(at.x) / aspect);
  }
  return height;
}
