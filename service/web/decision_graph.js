/** The decision graph (Rodriguez & Laio 2014, figure 1B): delta over rho, a dot a vertex, a disc a centre, and a box whose corner
 * is pulled to choose centres. It looks as pipeline/decision_graph.py draws it. */

import { ofSegment, short } from './words.js';

const SVG = 'http://www.w3.org/2000/svg';
const MARGIN = { left: 66, right: 14, top: 14, bottom: 46 };
const LOG_ABOVE = 30; // largest rho over the median: from there on a linear axis hides most vertices
const NEAR_CENTRE = 18; // pixels
const NEAR_VERTEX = 10;
const RHO = {
  vertex: 'local density ρ: vertices within the cut-off',
  area: 'local density ρ: area within the cut-off [mm²]',
  convexity: 'local density ρ: area, more where it is high [mm²]',
};
const DELTA = 'δ to the nearest denser vertex [mm]';

export class DecisionGraph {
  /** onHover, onPick : called with a point or null; onPull : with rho and delta of the box's corner */
  constructor(box, { onHover, onPick, onPull }) {
    this.box = box;
    this.canvas = box.querySelector('canvas');
    this.svg = box.querySelector('svg');
    Object.assign(this, { onHover, onPick, onPull, points: [], chosen: [], corner: null, marked: null });
    this.size = new ResizeObserver(() => this.draw());
    this.size.observe(box);
    this.svg.onpointermove = (event) => { if (!event.buttons) this.onHover(this.nearest(event)); };
    this.svg.onpointerleave = () => this.onHover(null);
    this.svg.onclick = (event) => {
      const found = this.isPulled ? null : this.nearest(event);
      this.isPulled = false;
      if (found) this.onPick(found);
    };
  }

  /** points : {rho, delta, segment, isHalo, centre?: number of the segment}; dC in mm */
  set(points, dC, density) {
    const sorted = points.map((each) => each.rho).sort((a, b) => a - b);
    const positive = points.map((each) => each.delta).filter((each) => each > 0);
    const least = positive.reduce((a, b) => Math.min(a, b), Infinity);
    const floor = Number.isFinite(least) ? least : 1; // a piece of one vertex has delta 0
    const most = Math.max(floor, positive.reduce((a, b) => Math.max(a, b), floor));
    const isLog = sorted.at(-1) > LOG_ABOVE * sorted[sorted.length >> 1] && sorted.some((each) => each > 0);
    const rhoFloor = isLog ? sorted.find((each) => each > 0) / 1.2 : 0;
    Object.assign(this, { points, dC, density, chosen: [], marked: null });
    this.rho = { isLog, low: rhoFloor, high: (sorted.at(-1) || 1) * (isLog ? 1.2 : 1.05) };
    this.delta = { isLog: true, low: Math.min(floor, dC) / 1.2, high: Math.max(most, dC) * 1.35 };
    this.draw();
  }

  /** corner : {rho, delta} of the box; chosen : indices of the points that would be centres; isIdle : the box chooses nothing */
  choose(corner, chosen, isIdle) {
    Object.assign(this, { corner, chosen });
    this.svg.classList.toggle('idle', isIdle);
    if (!this.at) return;
    this.paint();
    this.moveBox();
  }

  /** Ring a point; null: none. */
  mark(point) {
    if (point === this.marked) return;
    this.marked = point;
    this.drawMark();
  }

  draw() {
    const width = this.box.clientWidth;
    if (!width || !this.points.length) return;
    const height = Math.round(Math.min(Math.max(0.72 * width, 280), 460));
    this.inner = { left: MARGIN.left, right: width - MARGIN.right, top: MARGIN.top, bottom: height - MARGIN.bottom };
    this.ratio = Math.min(devicePixelRatio, 2);
    this.canvas.width = width * this.ratio;
    this.canvas.height = height * this.ratio;
    this.svg.setAttribute('viewBox', `0 0 ${width} ${height}`); // both are as wide as the box and keep this shape, on paper too
    this.at = this.points.map((each) => [this.x(each.rho), this.y(each.delta)]);
    this.paint();
    this.svg.replaceChildren();
    this.drawAxes();
    this.drawBox();
    this.drawCentres();
    this.ring = this.put('circle', { r: 9, class: 'mark' });
    this.drawMark();
  }

  x(rho) { return place(rho, this.rho, this.inner.left, this.inner.right); }

  y(delta) { return place(delta, this.delta, this.inner.bottom, this.inner.top); }

  paint() {
    const pen = this.canvas.getContext('2d');
    const style = getComputedStyle(this.canvas);
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    for (const isHalo of [true, false]) {
      pen.fillStyle = style.getPropertyValue(isHalo ? '--dot-halo' : '--dot');
      this.points.forEach((each, k) => {
        if (each.centre === undefined && each.isHalo === isHalo) pen.fillRect(this.at[k][0] - 1.2, this.at[k][1] - 1.2, 2.4, 2.4);
      });
    }
    pen.strokeStyle = style.getPropertyValue('--accent');
    pen.lineWidth = 2;
    for (const k of this.chosen) {
      pen.beginPath();
      pen.arc(...this.at[k], 8.5, 0, 2 * Math.PI);
      pen.stroke();
    }
  }

  drawAxes() {
    const { left, right, top, bottom } = this.inner;
    for (const [scale, isX] of [[this.rho, true], [this.delta, false]]) {
      for (const value of ticks(scale, isX ? (right - left) / 70 : (bottom - top) / 36)) {
        const at = isX ? this.x(value) : this.y(value);
        this.put('line', isX ? { x1: at, x2: at, y1: top, y2: bottom, class: 'grid' } : { x1: left, x2: right, y1: at, y2: at, class: 'grid' });
        this.put('text', isX ? { x: at, y: bottom + 16, 'text-anchor': 'middle' } : { x: left - 7, y: at + 4, 'text-anchor': 'end' }, short(value));
      }
    }
    this.put('rect', { x: left, y: top, width: right - left, height: bottom - top, class: 'frame' });
    this.put('text', { x: (left + right) / 2, y: bottom + 37, 'text-anchor': 'middle' }, RHO[this.density] ?? `local density ρ (${this.density})`);
    this.put('text', { transform: `translate(15 ${(top + bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle' }, DELTA);
    this.put('line', { x1: left, x2: right, y1: this.y(this.dC), y2: this.y(this.dC), class: 'cut' });
  }

  drawCentres() {
    const centres = this.points.map((each, k) => ({ ...each, k })).filter((each) => each.centre !== undefined).sort((a, b) => b.centre - a.centre);
    const placed = [];
    for (const { centre, k } of centres) this.put('circle', { cx: this.at[k][0], cy: this.at[k][1], r: 5.5, fill: ofSegment(centre), class: 'centre', 'data-segment': centre });
    const discs = centres.map(({ k }) => this.at[k]);
    for (const { centre, k } of centres.reverse()) {
      const [x, y] = free(this.at[k], discs, placed, this.inner);
      placed.push([x, y]);
      if (Math.hypot(x - this.at[k][0], y - this.at[k][1]) > 18) this.put('line', { x1: this.at[k][0], y1: this.at[k][1], x2: x, y2: y, class: 'lead' });
      this.put('text', { x, y: y + 4, 'text-anchor': 'middle', class: 'label' }, String(centre));
    }
  }

  /** The box with its two lines and its corner, each with room for a finger. Made once, then moved: a touch ends with its target. */
  drawBox() {
    this.parts = {
      shade: this.put('rect', { class: 'box' }),
      lineRho: this.put('line', { class: 'threshold' }),
      lineDelta: this.put('line', { class: 'threshold' }),
      gripRho: this.grip('line', 'ew', true, false),
      gripDelta: this.grip('line', 'ns', false, true),
      handle: this.put('circle', { r: 8, class: 'handle' }),
      gripBoth: this.grip('circle', 'both', true, true),
    };
    this.parts.gripBoth.setAttribute('r', 22);
    this.moveBox();
  }

  moveBox() {
    for (const part of Object.values(this.parts)) part.setAttribute('visibility', this.corner ? 'visible' : 'hidden');
    if (!this.corner) return;
    const { left, right, top, bottom } = this.inner;
    const x = Math.min(Math.max(this.x(this.corner.rho), left), right);
    const y = Math.min(Math.max(this.y(this.corner.delta), top), bottom);
    assign(this.parts.shade, { x, y: top, width: right - x, height: y - top });
    for (const name of ['lineRho', 'gripRho']) assign(this.parts[name], { x1: x, x2: x, y1: top, y2: bottom });
    for (const name of ['lineDelta', 'gripDelta']) assign(this.parts[name], { x1: left, x2: right, y1: y, y2: y });
    for (const name of ['handle', 'gripBoth']) assign(this.parts[name], { cx: x, cy: y });
  }

  grip(tag, kind, isRho, isDelta) {
    const made = this.put(tag, { class: `grip ${kind}` });
    made.addEventListener('pointerdown', (event) => {
      event.preventDefault();
      this.isPulled = false;
      const pull = (moved) => {
        this.isPulled = true;
        const [x, y] = this.where(moved);
        this.onPull(
          isRho ? value(x, this.rho, this.inner.left, this.inner.right) : this.corner.rho,
          isDelta ? value(y, this.delta, this.inner.bottom, this.inner.top) : this.corner.delta,
        );
      };
      const end = new AbortController();
      addEventListener('pointermove', pull, { signal: end.signal });
      for (const name of ['pointerup', 'pointercancel']) addEventListener(name, () => end.abort(), { signal: end.signal });
    });
    return made;
  }

  drawMark() {
    if (!this.ring) return;
    const k = this.points.indexOf(this.marked);
    this.ring.setAttribute('visibility', k < 0 ? 'hidden' : 'visible');
    if (k >= 0) assign(this.ring, { cx: this.at[k][0], cy: this.at[k][1] });
  }

  put(tag, attributes, words) {
    const made = document.createElementNS(SVG, tag);
    assign(made, attributes);
    if (words !== undefined) made.textContent = words;
    this.svg.append(made);
    return made;
  }

  where(event) {
    const box = this.svg.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** The centre within a finger's reach, or else the vertex under the pointer. */
  nearest(event) {
    if (!this.at) return null;
    const [x, y] = this.where(event);
    let found = null;
    let least = Infinity;
    this.points.forEach((each, k) => {
      const away = Math.hypot(this.at[k][0] - x, this.at[k][1] - y);
      const cost = each.centre === undefined ? away / NEAR_VERTEX : away / NEAR_CENTRE - 1; // a centre first
      if (away <= (each.centre === undefined ? NEAR_VERTEX : NEAR_CENTRE) && cost < least) {
        least = cost;
        found = each;
      }
    });
    return found;
  }

  close() {
    this.size.disconnect();
    Object.assign(this.svg, { onpointermove: null, onpointerleave: null, onclick: null });
    this.svg.replaceChildren();
  }
}

function assign(made, attributes) {
  for (const [name, given] of Object.entries(attributes)) made.setAttribute(name, given);
}

function place(given, { isLog, low, high }, from, to) {
  const share = isLog ? Math.log(Math.max(given, low) / low) / Math.log(high / low) : (given - low) / (high - low);
  return from + share * (to - from);
}

function value(pixel, { isLog, low, high }, from, to) {
  const share = Math.min(1, Math.max(0, (pixel - from) / (to - from)));
  return isLog ? low * (high / low) ** share : low + share * (high - low);
}

/** At most about `room` round values between the ends. */
function ticks({ isLog, low, high }, room) {
  const found = [];
  if (isLog) {
    const decades = Math.log10(high / low);
    const steps = decades * 3 <= room ? [1, 2, 5] : [1];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
      found.push(...steps.map((step) => step * 10 ** power).filter((each) => each >= low && each <= high));
    }
    return found;
  }
  const raw = (high - low) / room;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((each) => each * power >= raw) * power;
  for (let each = Math.ceil(low / step) * step; each <= high; each += step) found.push(Number(each.toPrecision(12)));
  return found;
}

/** Where the number of a disc hides least: the nearest of the places around it. */
function free([x, y], discs, placed, { left, right, top, bottom }) {
  let best;
  let least = Infinity;
  for (let ring = 1; ring <= 5; ring += 1) {
    for (let turn = 0; turn < 12; turn += 1) {
      const at = [x + 14 * ring * Math.cos((turn * Math.PI) / 6), y + 14 * ring * Math.sin((turn * Math.PI) / 6)];
      const hidden = discs.filter((each) => Math.abs(each[0] - at[0]) < 13 && Math.abs(each[1] - at[1]) < 12).length
        + placed.filter((each) => Math.abs(each[0] - at[0]) < 15 && Math.abs(each[1] - at[1]) < 13).length
        + (at[0] < left + 8 || at[0] > right - 8 || at[1] < top + 8 || at[1] > bottom - 8 ? 1 : 0);
      if (hidden < least) {
        least = hidden;
        best = at;
      }
    }
  }
  return best;
}
