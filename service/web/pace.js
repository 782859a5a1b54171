/** How much of a surface is drawn at a time, by how long the graphics took before. Times in ms. */

const FRAME_MS = 60; // of a frame while the view moves: a coarser level is drawn from here on
const STALL_MS = 100; // of one drawing of the whole: above, it is drawn in slices
const SLICE_MS = 60; // wanted of a slice
const FIRST = 25_000; // triangles or points drawn before anything was measured
const FASTER = 4; // a slice grows by this at most
const FORGET = 0.98; // of what a finer level took, with each frame of a coarser one: the machine may be less busy by now

export class Pace {
  /** counts : triangles or points of each level, the whole first; before : the pace of other surfaces on the same machine */
  constructor(counts, before = null) {
    this.counts = counts;
    this.took = counts.map(() => null); // when each level was drawn last
    const small = counts.findIndex((count) => count <= FIRST);
    this.level = small < 0 ? counts.length - 1 : small;
    this.slice = before?.slice ?? FIRST;
    this.whole = null; // what the whole would take, from its slices
  }

  /** A level was drawn. */
  drew(level, ms) {
    this.took[level] = ms;
    const finer = level - 1;
    if (finer >= 0 && this.took[finer] !== null) this.took[finer] *= FORGET;
    if (ms > FRAME_MS) this.level = Math.min(level + 1, this.counts.length - 1);
    else this.level = finer >= 0 && this.expected(finer) < FRAME_MS ? finer : level;
  }

  /** In proportion to a coarser level, at most; less where slices say what a triangle takes, and so what a frame takes without any. */
  expected(level) {
    const { took, counts, whole } = this;
    if (took[level] !== null) return took[level];
    const coarser = took[level + 1] ?? null;
    if (coarser === null) return level === 0 && whole !== null ? whole : Infinity;
    const more = whole === null ? Infinity : (whole * (counts[level] - counts[level + 1])) / counts[0];
    return Math.min(coarser * (counts[level] / counts[level + 1]), coarser + more);
  }

  /** A slice of so many was drawn. */
  drewSlice(count, ms) {
    if (count < this.slice / 2) return; // the last of a surface
    this.whole = (ms / count) * this.counts[0];
    this.slice = Math.round(count * Math.min(FASTER, Math.max(1 / FASTER, SLICE_MS / Math.max(ms, 1))));
  }

  /** Whether the whole is drawn at once when the view rests. */
  get isAtOnce() {
    return this.expected(0) < STALL_MS;
  }
}

/** Resolves when the graphics have drawn what they were given: how long that took since `begun`. Nothing waits for it. */
export function drawn(gl, begun) {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  return new Promise((resolve) => {
    const look = () => {
      if (!gl.isContextLost() && fence && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) setTimeout(look);
      else {
        gl.deleteSync(fence);
        resolve(performance.now() - begun);
      }
    };
    setTimeout(look);
  });
}
