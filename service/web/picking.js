/** What lies under the pointer, of any number of triangles. */

import * as THREE from './vendor/three/three.module.js';

const POINT_PX = 3.5; // a point of a cloud is hit so far from its middle

export class Picker {
  constructor() {
    this.ray = new THREE.Raycaster();
  }

  /** x, y : pixel of a canvas of width x height, seen by `camera`
   *  clip : {axis, offset}, what lies beyond is cut away; or null
   *  -> {surface, vertex, point, distance} nearest to the eye of those that are shown, or null */
  at(surfaces, camera, x, y, width, height, clip) {
    camera.updateMatrixWorld();
    this.ray.setFromCamera(new THREE.Vector2((2 * (Math.floor(x) + 0.5)) / width - 1, 1 - (2 * (Math.floor(y) + 0.5)) / height), camera);
    const { ray } = this.ray;
    const [near, far] = kept(ray, clip);
    let found = null;
    for (const surface of surfaces) {
      const { matrixWorld } = surface.object;
      const local = ray.clone().applyMatrix4(matrixWorld.clone().invert()); // a motion: lengths stay
      const hit = surface.meet(local, near, found?.distance ?? far, (along) => POINT_PX * pixel(camera, height, along));
      if (hit && (!found || hit.distance < found.distance)) found = { ...hit, surface, point: hit.point.clone().applyMatrix4(matrixWorld) };
    }
    return found;
  }
}

/** Between which distances a ray runs through what is not cut away. */
function kept({ origin, direction }, clip) {
  if (!clip) return [0, Infinity];
  const speed = direction.getComponent(clip.axis);
  const along = (clip.offset - origin.getComponent(clip.axis)) / speed;
  if (Math.abs(speed) < 1e-9) return origin.getComponent(clip.axis) <= clip.offset ? [0, Infinity] : [0, 0];
  return speed > 0 ? [0, along] : [Math.max(0, along), Infinity];
}

/** Size of a pixel so far from the eye, mm. */
const pixel = (camera, height, along) => (camera.isOrthographicCamera ? (camera.top - camera.bottom) / camera.zoom
  : 2 * along * Math.tan((camera.fov * Math.PI) / 360)) / height;
