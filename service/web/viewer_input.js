/** Pointer and keys on the canvas of a viewer. */

const SLOW_MS = 12; // if picking takes longer, it waits until the pointer rests
const REST_MS = 120;
const CLICK_PX = 5; // a pointer that moved further has dragged
const TURN = Math.PI / 36;

/** Call onHover and onPick of `viewer`. Returns a function that cancels what is scheduled. */
export function listen(viewer) {
  const { canvas, view } = viewer;
  const { controls } = view;
  let frame;
  let rest;
  let took = 0;
  let pressed = null;
  const pick = (event) => {
    const begun = performance.now();
    viewer.onHover(viewer.under(event));
    took = performance.now() - begun;
  };
  const cancel = () => {
    cancelAnimationFrame(frame);
    clearTimeout(rest);
  };
  canvas.addEventListener('pointermove', (event) => {
    if (event.buttons) return; // a drag turns the part
    cancel();
    if (took > SLOW_MS) rest = setTimeout(() => pick(event), REST_MS);
    else frame = requestAnimationFrame(() => pick(event));
  });
  canvas.addEventListener('pointerleave', (event) => {
    cancel();
    if (event.pointerType !== 'touch') viewer.onHover(null); // lifting a finger keeps what it touched
  });
  canvas.addEventListener('pointerdown', (event) => { pressed = [event.clientX, event.clientY]; });
  canvas.addEventListener('pointerup', (event) => {
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > CLICK_PX) return;
    const target = viewer.under(event);
    viewer.onHover(target);
    viewer.onPick(target, event);
  });
  canvas.addEventListener('keydown', (event) => {
    const action = {
      ArrowLeft: () => controls.rotateLeft(TURN),
      ArrowRight: () => controls.rotateLeft(-TURN),
      ArrowUp: () => controls.rotateUp(TURN),
      ArrowDown: () => controls.rotateUp(-TURN),
      '+': () => view.zoom(0.85),
      '=': () => view.zoom(0.85),
      '-': () => view.zoom(1 / 0.85),
      0: () => viewer.onReset?.(),
    }[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
    controls.update();
    viewer.draw();
  });
  return cancel;
}
