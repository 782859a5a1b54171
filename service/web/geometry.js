/** Geometry of the shown surfaces: read from glTF, shaded, measured. */

import * as THREE from './vendor/three/three.module.js';

const MM_PER_M = 1000; // glTF is in metres

/** Meshes and point clouds of a glTF scene, without the landmarks in it. */
export function surfaces(gltf) {
  const nodes = [];
  gltf.scene.updateMatrixWorld(true);
  gltf.scene.traverse((node) => { if ((node.isMesh || node.isPoints) && !/landmarks/.test(node.name)) nodes.push(node); });
  return nodes;
}

export const inMillimetres = (node) => node.geometry.clone().applyMatrix4(node.matrixWorld).scale(MM_PER_M, MM_PER_M, MM_PER_M);

export function shaded(geometry, isCloud) {
  if (isCloud) return new THREE.Points(geometry, new THREE.PointsMaterial({ vertexColors: true, size: 2, sizeAttenuation: false }));
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
}

/** (n) area of each vertex in mm^2: a third of the triangles around it; 1 for each point of a cloud */
export function areas(geometry) {
  const at = geometry.attributes.position;
  const index = geometry.index?.array;
  if (!index) return new Float32Array(at.count).fill(1);
  const perVertex = new Float32Array(at.count);
  const [a, b, c] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
  for (let k = 0; k < index.length; k += 3) {
    a.fromBufferAttribute(at, index[k]);
    b.fromBufferAttribute(at, index[k + 1]).sub(a);
    c.fromBufferAttribute(at, index[k + 2]).sub(a);
    const third = b.cross(c).length() / 6;
    for (let corner = 0; corner < 3; corner += 1) perVertex[index[k + corner]] += third;
  }
  return perVertex;
}

/** The vertex nearest to a point. positions : (3 n) in mm; returns {vertex, distance} */
export function nearestVertex(positions, [x, y, z]) {
  let best = Infinity;
  let vertex = 0;
  for (let k = 0; k < positions.length / 3; k += 1) {
    const square = (positions[3 * k] - x) ** 2 + (positions[3 * k + 1] - y) ** 2 + (positions[3 * k + 2] - z) ** 2;
    if (square < best) { best = square; vertex = k; }
  }
  return { vertex, distance: Math.sqrt(best) };
}

/** Distance along `direction` from the centre of a box at which all its corners are in sight. */
export function fittingDistance(camera, half, direction) {
  const view = new THREE.Matrix4().lookAt(direction, new THREE.Vector3(), camera.up).transpose();
  const slope = Math.tan((camera.fov * Math.PI) / 360);
  let distance = 0;
  for (let corner = 0; corner < 8; corner += 1) {
    const at = new THREE.Vector3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1).multiply(half).applyMatrix4(view);
    distance = Math.max(distance, at.z + Math.abs(at.y) / slope, at.z + Math.abs(at.x) / (slope * camera.aspect));
  }
  return distance;
}
