// The picture of a sheet that is being cut: its strokes, those that are burnt, and the head.

import { byId } from "./tools.js";

const MARGIN = 10;
let sheet = null;
let shown = { done: 0, head: null };
let base = null; // the strokes that are still to be burnt, as a picture

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export function setSheet(drawing) {
  sheet = drawing;
  shown = { done: 0, head: null };
  base = null;
  draw();
}

/** Mark the first `done` strokes as burnt, and the head at `head` (mm from the origin of the job). */
export function mark(done, head) {
  const same = done === shown.done && head?.[0] === shown.head?.[0] && head?.[1] === shown.head?.[1];
  if (!sheet || same) return;
  shown = { done, head };
  draw();
}

function fit(canvas) {
  const [x0, y0, x1, y1] = sheet.view;
  const width = canvas.clientWidth || 600;
  const height = Math.max(160, Math.min(0.52 * window.innerHeight, (width * (y1 - y0)) / (x1 - x0)));
  const dense = window.devicePixelRatio || 1;
  canvas.style.height = `${height}px`;
  if (canvas.width !== Math.round(width * dense) || canvas.height !== Math.round(height * dense)) {
    canvas.width = Math.round(width * dense);
    canvas.height = Math.round(height * dense);
    base = null;
  }
  const scale = Math.min((width - 2 * MARGIN) / (x1 - x0), (height - 2 * MARGIN) / (y1 - y0)) * dense;
  const left = (canvas.width - scale * (x1 - x0)) / 2;
  const bottom = (canvas.height + scale * (y1 - y0)) / 2;
  return { scale, dense, at: (x, y) => [left + scale * (x - x0), bottom - scale * (y - y0)] };
}

function path(pen, view, from, to) {
  pen.beginPath();
  for (const points of sheet.strokes.slice(from, to)) {
    for (let k = 0; k < points.length; k += 2) {
      const [x, y] = view.at(points[k] / 100, points[k + 1] / 100);
      if (k) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    }
  }
  pen.stroke();
}

function background(canvas, view) {
  const made = document.createElement("canvas");
  made.width = canvas.width;
  made.height = canvas.height;
  const pen = made.getContext("2d");
  const [x0, y1] = view.at(0, 0);
  const [x1, y0] = view.at(...sheet.paper);
  pen.lineWidth = view.dense;
  pen.strokeStyle = style("--quiet");
  pen.strokeRect(x0, y0, x1 - x0, y1 - y0);
  pen.lineWidth = view.dense;
  pen.strokeStyle = style("--accent");
  path(pen, view, 0, sheet.strokes.length);
  return made;
}

function draw() {
  if (!sheet) return;
  const canvas = byId("sheet-canvas");
  if (!canvas.clientWidth) return;
  const view = fit(canvas);
  base ??= background(canvas, view);
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(base, 0, 0);
  pen.lineWidth = 2.2 * view.dense;
  pen.lineCap = "round";
  pen.strokeStyle = style("--ink");
  path(pen, view, 0, shown.done);
  if (shown.head) {
    const [x, y] = view.at(shown.head[0], shown.head[1]);
    pen.beginPath();
    pen.arc(x, y, 5 * view.dense, 0, 2 * Math.PI);
    pen.fillStyle = style("--bad");
    pen.fill();
    pen.lineWidth = 1.5 * view.dense;
    pen.strokeStyle = style("--field");
    pen.stroke();
  }
}

function again() {
  base = null;
  draw();
}

new ResizeObserver(again).observe(byId("sheet-canvas"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
