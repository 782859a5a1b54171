/** What lies under the pointer, of any number of triangles: the graphics card draws one pixel whose colour is the number of a
 * vertex; only the few triangles at that vertex are then cut with the ray. */

import * as THREE from './vendor/three/three.module.js';

const VERTEX = `flat out int number;
#include <clipping_planes_pars_vertex>
void main() { vec4 mvPosition = modelViewMatrix * vec4(position, 1.0); number = gl_VertexID; gl_PointSize = 7.0; gl_Position = projectionMatrix * mvPosition;
#include <clipping_planes_vertex>
}`;
const FRAGMENT = `flat in int number; uniform float surface; out vec4 colour;
#include <clipping_planes_pars_fragment>
void main() {
#include <clipping_planes_fragment>
colour = vec4(number & 255, (number >> 8) & 255, (number >> 16) & 255, surface) / 255.0; }`;

export class Picker {
  constructor(renderer) {
    this.renderer = renderer;
    this.target = new THREE.WebGLRenderTarget(1, 1);
    this.scene = new THREE.Scene();
    this.surfaces = []; // {shown, twin}
    this.skip = null; // `userData.what` of surfaces that are looked through
    this.pixel = new Uint8Array(4);
    this.ray = new THREE.Raycaster();
  }

  /** shown : the mesh or points of the viewer, looked for while it is visible */
  add(shown) {
    const surface = { value: this.surfaces.length + 1 };
    const material = new THREE.ShaderMaterial({ glslVersion: THREE.GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: { surface }, clipping: true, side: THREE.DoubleSide, blending: THREE.NoBlending });
    const twin = shown.isPoints ? new THREE.Points(shown.geometry, material) : new THREE.Mesh(shown.geometry, material);
    twin.matrixAutoUpdate = false;
    twin.frustumCulled = false;
    this.scene.add(twin);
    this.surfaces.push({ shown, twin });
  }

  /** x, y : of width x height -> {shown, vertex, point, distance} nearest to the eye, or null */
  at(camera, x, y, width, height) {
    for (const { shown, twin } of this.surfaces) {
      twin.visible = shown.visible && shown.parent.visible && shown.userData.what !== this.skip;
      twin.matrix.copy(shown.matrixWorld);
      twin.matrixWorldNeedsUpdate = true;
    }
    camera.updateMatrixWorld();
    const before = this.renderer.getClearColor(new THREE.Color());
    camera.setViewOffset(width, height, Math.floor(x), Math.floor(y), 1, 1);
    this.renderer.setRenderTarget(this.target);
    this.renderer.setClearColor(0, 0);
    this.renderer.clear();
    this.renderer.render(this.scene, camera);
    this.renderer.readRenderTargetPixels(this.target, 0, 0, 1, 1, this.pixel);
    this.renderer.setRenderTarget(null);
    this.renderer.setClearColor(before, 1);
    camera.clearViewOffset();
    const found = this.surfaces[this.pixel[3] - 1];
    this.ray.setFromCamera(new THREE.Vector2((2 * (Math.floor(x) + 0.5)) / width - 1, 1 - (2 * (Math.floor(y) + 0.5)) / height), camera);
    return found ? this.refine(found.shown, this.pixel[0] + 256 * this.pixel[1] + 65536 * this.pixel[2]) : null;
  }

  /** The corner nearest to where the ray cuts the triangles at `corner`. */
  refine(shown, corner) {
    const { position } = shown.geometry.attributes;
    const index = shown.geometry.index?.array;
    const local = this.ray.ray.clone().applyMatrix4(shown.matrixWorld.clone().invert());
    const at = (vertex) => new THREE.Vector3().fromBufferAttribute(position, vertex);
    let vertex = corner;
    let point = at(corner);
    for (let k = 0; index && k < index.length; k += 3) {
      if (index[k] !== corner && index[k + 1] !== corner && index[k + 2] !== corner) continue;
      const corners = [index[k], index[k + 1], index[k + 2]];
      const cut = local.intersectTriangle(...corners.map(at), false, new THREE.Vector3());
      if (!cut) continue;
      point = cut;
      vertex = corners.reduce((best, each) => (at(each).distanceToSquared(cut) < at(best).distanceToSquared(cut) ? each : best));
      break;
    }
    point = point.applyMatrix4(shown.matrixWorld);
    return { shown, vertex, point, distance: point.distanceTo(this.ray.ray.origin) };
  }

  close() {
    this.target.dispose();
    for (const { twin } of this.surfaces) twin.material.dispose();
  }
}
