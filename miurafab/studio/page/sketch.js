// The coarse sheet in space, on a plain canvas: facets from back to front, an eye that goes round.

import { byId } from "./tools.js";

const eye = { yaw: -0.6, pitch: 0.62, near: 1 };
let sheet = null;
let waiting = false;

/** Show `points` (x, y, z a vertex, hundredths of mm) with `faces` of vertices; null for nothing. */
export function sketch(picture) {
  sheet = picture;
  draw();
}

const colour = (name) => {
  const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));
};

function draw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    paint(byId("sketch"));
  });
}

/** The points as the eye sees them: right, up, towards it; in hundredths of mm. */
function seen({ points }) {
  const [cy, sy, cp, sp] = [Math.cos(eye.yaw), Math.sin(eye.yaw), Math.cos(eye.pitch), Math.sin(eye.pitch)];
  const found = [];
  for (let at = 0; at < points.length; at += 3) {
    const [x, y, z] = [points[at], points[at + 1], points[at + 2]];
    const along = sy * x - cy * y;
    found.push([cy * x + sy * y, -along * sp + z * cp, along * cp + z * sp]);
  }
  return found;
}

function paint(canvas) {
  const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
  if (!wide || !high) return;
  const dense = window.devicePixelRatio || 1;
  canvas.width = Math.round(wide * dense);
  canvas.height = Math.round(high * dense);
  const pen = canvas.getContext("2d");
  if (!sheet) return;
  const shown = seen(sheet);
  const scale = eye.near * dense * Math.min(...[wide, high].map((side, axis) => (
    (0.47 * side) / shown.reduce((most, point) => Math.max(most, Math.abs(point[axis])), 1)
  )));
  const sides = { front: colour("--side-a"), back: colour("--side-b") };
  const place = (vertex) => [canvas.width / 2 + scale * shown[vertex][0], canvas.height / 2 - scale * shown[vertex][1]];
  const facets = sheet.faces.map((face) => {
    const [a, b, c] = face.map((vertex) => shown[vertex]);
    const [p, q] = [[0, 1, 2].map((axis) => b[axis] - a[axis]), [0, 1, 2].map((axis) => c[axis] - b[axis])];
    const normal = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    const length = Math.hypot(...normal) || 1;
    const depth = face.reduce((sum, vertex) => sum + shown[vertex][2], 0) / face.length;
    const lit = Math.abs(0.3 * normal[0] + 0.5 * normal[1] + 0.81 * normal[2]) / length;
    return { face, depth, front: normal[2] > 0, light: 0.5 + 0.5 * lit };
  });
  facets.sort((one, other) => one.depth - other.depth);
  pen.lineJoin = "round";
  pen.lineWidth = 0.7 * dense;
  pen.strokeStyle = `rgb(${colour("--edge").join(" ")})`;
  for (const { face, front, light } of facets) {
    pen.beginPath();
    face.forEach((vertex, at) => (at ? pen.lineTo(...place(vertex)) : pen.moveTo(...place(vertex))));
    pen.closePath();
    pen.fillStyle = `rgb(${sides[front ? "front" : "back"].map((part) => Math.round(part * light)).join(" ")})`;
    pen.fill();
    pen.stroke();
  }
}

function turn(dx, dy) {
  eye.yaw -= dx * 0.008;
  eye.pitch = Math.min(Math.max(eye.pitch + dy * 0.008, -Math.PI / 2), Math.PI / 2);
  draw();
}

function zoom(factor) {
  eye.near = Math.min(Math.max(eye.near * factor, 0.3), 8);
  draw();
}

const KEYS = {
  ArrowLeft: () => turn(-30, 0), ArrowRight: () => turn(30, 0), ArrowUp: () => turn(0, -30), ArrowDown: () => turn(0, 30),
  "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8),
};

export function beginSketch() {
  const canvas = byId("sketch");
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (canvas.hasPointerCapture(event.pointerId)) turn(event.movementX, event.movementY);
  });
  canvas.addEventListener("keydown", (event) => {
    if (!(event.key in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return;
    KEYS[event.key]();
    event.preventDefault();
  });
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}
