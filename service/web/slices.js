/** Long work on the page in short slices, so that it never stalls. */

const SLICE_MS = 12;
const LOOK = 64; // pieces of work between two looks at the clock

/** work : called with 0 to count - 1; isOver : () -> whether nobody wants it any more. Returns whether all was done. */
export async function inSlices(count, work, isOver) {
  for (let k = 0; k < count;) {
    const until = performance.now() + SLICE_MS;
    do {
      for (const end = Math.min(count, k + LOOK); k < end; k += 1) work(k);
    } while (k < count && performance.now() < until);
    await new Promise((resolve) => { setTimeout(resolve); });
    if (isOver()) return false;
  }
  return true;
}
