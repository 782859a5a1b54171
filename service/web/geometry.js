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

/** A material has `userData.back`: 1 shades the backs of its faces, -1 their fronts, 0 neither. */
export function shaded(geometry, isCloud) {
  if (isCloud) return new THREE.Points(geometry, new THREE.PointsMaterial({ vertexColors: true, size: 3, sizeAttenuation: false }));
  geometry.computeVertexNormals();
  const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide });
  const back = { value: 0 };
  material.userData.back = back;
  material.onBeforeCompile = (shader) => {
    shader.uniforms.back = back;
    shader.fragmentShader = `uniform float back;\n${shader.fragmentShader}`.replace('#include <color_fragment>', `#include <color_fragment>
      if (back != 0.0 && gl_FrontFacing == (back < 0.0)) diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.28, 0.31, 0.36), 0.75);`);
  };
  return new THREE.Mesh(geometry, material);
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
