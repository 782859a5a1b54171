/** Draws the scene of a viewer without a stall. While the view moves, a level that the graphics can follow; once it rests, the whole, in slices beside
 *  the picture that is seen if it takes long. Small parts are always drawn whole. */

import * as THREE from './vendor/three/three.module.js';
import { Pace, drawn } from './pace.js';

const REST_MS = 150; // without a change: the view rests
const COARSE_PIXELS = 0.5; // of the resolution, where even the coarsest level takes too long
const SAMPLES = 4; // to a pixel, as browsers have them for a canvas
/** Layers of the scene: what is not a surface, each surface, and what is drawn last, in front of all. */
export const LAYERS = { others: 0, design: 1, scan: 2, front: 3 };

export class Drawing {
  /** surfaces : () -> those that are shown, opaque ones first; prepare : called before a frame; onDrawn : after it */
  constructor(renderer, scene, { surfaces, camera, prepare, onDrawn }) {
    Object.assign(this, { renderer, scene, surfaces, camera, prepare, onDrawn });
    this.gl = renderer.getContext();
    this.pace = new Pace([0]);
    this.turn = 0; // of the pictures that were asked for: an older one is given up
    this.isBusy = false; // the graphics draw
    this.copy = copier();
  }

  /** Draw in the next frame, once for all calls until then. */
  ask() {
    if (this.isClosed) return;
    this.turn += 1;
    clearTimeout(this.rest);
    if (!this.isBusy) this.due ??= requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.due = undefined;
    const shown = this.surfaces();
    const levels = Math.max(1, ...shown.map((each) => each.levels.length));
    const counts = Array.from({ length: levels }, (_, level) => shown.reduce((sum, each) => sum + each.size(level), 0));
    if (levels > 1) counts.push(counts.at(-1) * COARSE_PIXELS); // pixels count as triangles do
    if (String(counts) !== String(this.pace.counts)) this.pace = new Pace(counts, this.pace);
    const { level } = this.pace;
    const begun = performance.now();
    this.resolve(level < levels ? 1 : COARSE_PIXELS);
    this.prepare();
    for (const each of shown) each.draw(level);
    this.renderer.render(this.scene, this.camera());
    this.tell(level === 0);
    if (levels > 1) this.follow(level, begun);
  }

  /** isWhole : nothing is left out of the picture */
  tell(isWhole) {
    this.renderer.domElement.dataset.drawn = isWhole ? 'whole' : 'coarse';
    this.onDrawn();
  }

  /** How long it took, and what comes next. */
  async follow(level, begun) {
    const { turn, isFirst = true } = this;
    this.isFirst = false; // the first frame also sends the vertices to the graphics
    const ms = await this.finished(begun);
    if (!isFirst) this.pace.drew(level, ms);
    if (turn !== this.turn) this.ask();
    else if (level > 0) this.rest = setTimeout(() => (this.pace.isAtOnce ? this.atOnce() : this.inSlices()), REST_MS);
  }

  async finished(begun) {
    this.isBusy = true;
    const ms = await drawn(this.gl, begun);
    this.isBusy = false;
    return ms;
  }

  atOnce() {
    this.pace.level = 0;
    this.ask();
  }

  /** The whole, beside the picture that is seen, in its place when it is done. */
  async inSlices() {
    const { turn, renderer } = this;
    const camera = this.camera();
    const target = this.besides();
    this.prepare();
    let isFirst = true;
    for (const step of this.steps()) {
      const begun = performance.now();
      const count = step(target, camera, isFirst);
      isFirst = false;
      const ms = await this.finished(begun);
      if (turn !== this.turn) {
        this.ask();
        return;
      }
      if (count) this.pace.drewSlice(count, ms);
    }
    this.resolve(1);
    this.copy(renderer, target.texture);
    this.tell(true);
  }

  /** In the order in which the whole is drawn: opaque surfaces, what lies beside them, surfaces that are seen through, what lies in front. */
  * steps() {
    const shown = this.surfaces();
    const isVeil = (each) => each.object.material.transparent;
    for (const each of shown.filter((surface) => !isVeil(surface))) yield* this.slices(each);
    yield (...to) => this.render(LAYERS.others, ...to);
    for (const each of shown.filter(isVeil)) yield* this.slices(each);
    yield (...to) => this.render(LAYERS.front, ...to);
  }

  * slices(surface) {
    for (let from = 0; from < surface.size(0);) {
      const count = Math.min(this.pace.slice, surface.size(0) - from);
      const begin = from;
      yield (...to) => {
        surface.draw(0, begin, count);
        this.render(LAYERS[surface.what], ...to);
        surface.draw(0);
        return count;
      };
      from += count;
    }
  }

  /** Only what is on a layer. */
  render(layer, target, camera, isFirst) {
    const { renderer } = this;
    const { mask } = camera.layers;
    camera.layers.set(layer);
    renderer.setRenderTarget(target);
    renderer.autoClear = isFirst;
    renderer.render(this.scene, camera);
    renderer.autoClear = true;
    renderer.setRenderTarget(null);
    camera.layers.mask = mask;
  }

  /** Of the canvas. share : of the resolution of the screen */
  resolve(share) {
    if (this.renderer.getPixelRatio() !== share * this.ratio) this.renderer.setPixelRatio(share * this.ratio);
  }

  /** width, height : of the canvas on the page; ratio : pixels of the screen to one of them */
  resize(width, height, ratio) {
    this.ratio = ratio;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
  }

  besides() {
    const { width, height } = this.renderer.getSize(new THREE.Vector2()).multiplyScalar(this.ratio).floor();
    this.target ??= new THREE.WebGLRenderTarget(width, height, { samples: SAMPLES, resolveDepthBuffer: false, minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter });
    this.target.setSize(width, height);
    return this.target;
  }

  close() {
    this.isClosed = true;
    this.turn += 1;
    cancelAnimationFrame(this.due);
    clearTimeout(this.rest);
    this.target?.dispose();
  }
}

/** Puts a picture into the canvas, pixel by pixel. */
function copier() {
  const material = new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    uniforms: { picture: { value: null } },
    vertexShader: 'in vec3 position; void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }',
    fragmentShader: 'precision highp float; uniform sampler2D picture; out vec4 colour; void main() { colour = texelFetch(picture, ivec2(gl_FragCoord.xy), 0); }',
    depthTest: false,
    depthWrite: false,
  });
  const all = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), material);
  all.frustumCulled = false;
  const scene = new THREE.Scene().add(all);
  const camera = new THREE.Camera();
  return (renderer, texture) => {
    material.uniforms.picture.value = texture;
    renderer.render(scene, camera);
  };
}
