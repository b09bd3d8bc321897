// A mesh laid flat, with the rectangle of it that is to be covered: moved, sized and turned by hand.

import { byId } from "./tools.js";

const MARGIN = 14; // CSS pixels
const GRIP = 14;
const LEAST = 0.04; // of a side of the box
const STEP = 0.01;
const SAMPLES = 21;

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Loops of vertices along the border of triangles: sides that one triangle alone has. */
function borderOf({ faces }) {
  const sides = new Map();
  const key = (a, b) => Math.min(a, b) * 4294967296 + Math.max(a, b);
  for (let at = 0; at < faces.length; at += 1) {
    const next = faces[at % 3 === 2 ? at - 2 : at + 1];
    const name = key(faces[at], next);
    if (sides.has(name)) sides.delete(name);
    else sides.set(name, [faces[at], next]);
  }
  const after = new Map([...sides.values()]);
  const loops = [];
  while (after.size) {
    const [first] = after.keys();
    const loop = [];
    let vertex = first;
    while (after.has(vertex)) {
      loop.push(vertex);
      const next = after.get(vertex);
      after.delete(vertex);
      vertex = next;
    }
    loops.push(loop);
  }
  return loops;
}

export class LayoutMap {
  /** `change({ part, turn })` is called while a hand moves: the part in fractions, the turn in degrees. */
  constructor(canvas, change) {
    this.canvas = canvas;
    this.change = change;
    this.picture = null;
    this.turn = 0;
    this.part = null;
    canvas.addEventListener("pointerdown", (event) => this.grip(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.held = null; });
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  show(picture) {
    if (picture === this.picture) return;
    this.picture = picture;
    this.path = new Path2D();
    for (const loop of borderOf(picture)) {
      loop.forEach((vertex, at) => {
        const [x, y] = picture.flat.subarray(2 * vertex, 2 * vertex + 2);
        if (at) this.path.lineTo(x, y);
        else this.path.moveTo(x, y);
      });
      this.path.closePath();
    }
  }

  /** Lay the picture turned by so many degrees, with the `part` in fractions of its box, or all of it (null). */
  set(turn, part) {
    this.turn = turn;
    this.part = part;
    this.draw();
  }

  get axes() {
    const angle = (this.turn * Math.PI) / 180;
    return [Math.cos(angle), Math.sin(angle)];
  }

  /** The box around the turned layout: its corner and its size. */
  get box() {
    const [c, s] = this.axes;
    const { flat } = this.picture;
    const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
    for (let at = 0; at < flat.length; at += 2) {
      const place = [c * flat[at] + s * flat[at + 1], c * flat[at + 1] - s * flat[at]];
      for (const axis of [0, 1]) {
        low[axis] = Math.min(low[axis], place[axis]);
        high[axis] = Math.max(high[axis], place[axis]);
      }
    }
    return [...low, high[0] - low[0], high[1] - low[1]];
  }

  /** Whether the part reaches beyond the mesh. */
  get beyond() {
    if (!this.part) return false;
    const [c, s] = this.axes;
    const [x0, y0, wide, high] = this.box;
    const [u0, u1, v0, v1] = this.part;
    const pen = (this.probe ??= document.createElement("canvas").getContext("2d"));
    for (let i = 0; i < SAMPLES; i += 1) {
      for (let j = 0; j < SAMPLES; j += 1) {
        const share = [i, j].map((at) => 1e-3 + (at / (SAMPLES - 1)) * (1 - 2e-3));
        const x = x0 + wide * (u0 + share[0] * (u1 - u0));
        const y = y0 + high * (v0 + share[1] * (v1 - v0));
        if (!pen.isPointInPath(this.path, c * x - s * y, s * x + c * y, "evenodd")) return true;
      }
    }
    return false;
  }

  /** From fractions of the box to CSS pixels of the canvas, and how many pixels the box has. */
  get frame() {
    const [, , wide, high] = this.box;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const scale = Math.min((width - 2 * MARGIN) / wide, (height - 2 * MARGIN) / high);
    const size = [wide * scale, high * scale];
    const left = (width - size[0]) / 2;
    const bottom = (height + size[1]) / 2;
    return { scale, size, at: (u, v) => [left + u * size[0], bottom - v * size[1]] };
  }

  draw() {
    const { canvas } = this;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!this.picture || !width || !height) return;
    const dense = window.devicePixelRatio || 1;
    [canvas.width, canvas.height] = [Math.round(width * dense), Math.round(height * dense)];
    const pen = canvas.getContext("2d");
    const { scale, at } = this.frame;
    const [x0, y0] = this.box;
    const [left, bottom] = at(0, 0);
    const [c, s] = this.axes;
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.translate(left, bottom);
    pen.scale(scale, -scale);
    pen.translate(-x0, -y0);
    pen.transform(c, -s, s, c, 0, 0); // the layout turned back
    pen.fillStyle = colour(this.part ? "--left-out" : "--side-a");
    pen.fill(this.path, "evenodd");
    pen.lineWidth = 1.2 / scale;
    pen.strokeStyle = colour("--quiet");
    pen.stroke(this.path);
    if (!this.part) return;
    const [u0, u1, v0, v1] = this.part;
    const [[x, y], [right, top]] = [at(u0, v0), at(u1, v1)];
    if (!this.beyond) {
      pen.save();
      pen.clip(this.path, "evenodd");
      pen.setTransform(dense, 0, 0, dense, 0, 0);
      pen.fillStyle = colour("--side-a");
      pen.fillRect(x, top, right - x, y - top);
      pen.restore();
    }
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.lineWidth = 2;
    pen.strokeStyle = colour(this.beyond ? "--bad" : "--accent");
    pen.fillStyle = pen.strokeStyle;
    pen.strokeRect(x, top, right - x, y - top);
    for (const [gx, gy] of [[x, y], [right, y], [x, top], [right, top]]) pen.fillRect(gx - 4, gy - 4, 8, 8);
  }

  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** What a pointer takes hold of: a corner, the rectangle, or the layout around it. */
  grip(event) {
    if (!this.picture) return;
    this.canvas.setPointerCapture(event.pointerId);
    const [x, y] = this.place(event);
    this.held = { x, y, part: this.part && [...this.part], turn: this.turn, what: "turn" };
    if (!this.part) return;
    const { at } = this.frame;
    const [u0, u1, v0, v1] = this.part;
    const corners = [[0, 2], [1, 2], [0, 3], [1, 3]];
    const near = corners.find(([u, v]) => {
      const [cx, cy] = at(this.part[u], this.part[v]);
      return Math.hypot(cx - x, cy - y) <= GRIP;
    });
    const [[left, low], [right, top]] = [at(u0, v0), at(u1, v1)];
    if (near) this.held.what = near;
    else if (x > left && x < right && y > top && y < low) this.held.what = "move";
  }

  drag(event) {
    if (!this.held) return;
    const [x, y] = this.place(event);
    const { held } = this;
    const { size } = this.frame;
    if (held.what === "turn") {
      const middle = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
      const angle = (px, py) => Math.atan2(middle[1] - py, px - middle[0]);
      // the layout is turned back by the angle of the grid
      const by = ((angle(x, y) - angle(held.x, held.y)) * 180) / Math.PI;
      this.tell({ turn: held.turn - by });
      return;
    }
    const step = [(x - held.x) / size[0], (held.y - y) / size[1]];
    const part = [...held.part];
    if (held.what === "move") this.tell({ part: moved(part, step) });
    else {
      const [u, v] = held.what;
      part[u] += step[0];
      part[v] += step[1];
      this.tell({ part: sized(part, held.what) });
    }
  }

  key(event) {
    const steps = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
    const step = steps[event.key];
    if (!step || !this.part || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const part = [...this.part];
    if (!event.shiftKey) this.tell({ part: moved(part, step) });
    else this.tell({ part: sized([part[0], part[1] + step[0], part[2], part[3] + step[1]], [1, 3]) });
  }

  tell({ part = this.part, turn = this.turn }) {
    this.change({ part, turn: ((((turn + 180) % 360) + 360) % 360) - 180 });
  }
}

function moved(part, [du, dv]) {
  const u = Math.min(Math.max(du, -part[0]), 1 - part[1]);
  const v = Math.min(Math.max(dv, -part[2]), 1 - part[3]);
  return [part[0] + u, part[1] + u, part[2] + v, part[3] + v];
}

/** The part with the two sides that were moved kept within the box and clear of the others. */
function sized(part, [u, v]) {
  const made = part.map((value) => Math.min(Math.max(value, 0), 1));
  if (u === 0) made[0] = Math.min(made[0], made[1] - LEAST);
  else made[1] = Math.max(made[1], made[0] + LEAST);
  if (v === 2) made[2] = Math.min(made[2], made[3] - LEAST);
  else made[3] = Math.max(made[3], made[2] + LEAST);
  return made;
}

export const layoutMap = (change) => new LayoutMap(byId("target-map"), change);
