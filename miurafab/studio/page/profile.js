// A profile drawn by hand: points that are dragged or moved by keys, with a symmetric copy. The curve is the
// one that the target has, from the server.

import { texts } from "./texts.js";
import { byId, say } from "./tools.js";

const { profile } = texts;
const WIDE = 300; // units of the drawing
const MARGIN = 22;
const LEAST = 0.02; // of the size: nearer to the axis no point of a revolution comes

let given = null; // { axes, points } of the surface
let points = []; // those that are moved: all, or half of a symmetric profile
let curve = [];
let chosen = 0;
let view = null; // { low, scale, height }
let changed = () => {};

const isTurned = () => given.axes.startsWith("r");
const mirrored = () => (isTurned() ? 1 : 0); // the coordinate that a symmetric copy turns round
const round = (value) => Number(value.toFixed(4));
const size = () => Math.max(...[0, 1].map((axis) => {
  const all = whole().map((point) => point[axis]);
  return Math.max(...all) - Math.min(...all);
}), 1e-6);

function whole() {
  if (!byId("profile-symmetric").checked) return points;
  const axis = mirrored();
  const copy = points.map((point) => point.map((value, at) => (at === axis ? -value : value))).reverse();
  if (Math.abs(points[0][axis]) < 1e-9) copy.pop();
  return [...copy, ...points];
}

/** The profile that was drawn, or null where the surface has its own. */
export function drawnProfile() {
  const drawn = given && !byId("profile-editor").hidden && byId("draw-profile").checked;
  return drawn ? whole().map((point) => point.map(round)) : null;
}

/** Offer the drawing for a surface that takes a profile, with its own as the beginning. */
export function offerProfile(surface, drawn) {
  const takes = Boolean(surface?.profile);
  byId("profile-editor").hidden = !takes;
  if (!takes) {
    given = null;
    return;
  }
  given = surface.profile;
  points = (drawn ?? given.points).map((point) => [...point]);
  curve = [];
  chosen = 0;
  byId("profile-symmetric").checked = false;
  byId("draw-profile").checked = Boolean(drawn);
  byId("profile-drawing").hidden = !drawn;
  byId("profile-help").textContent = say(profile.help, { axes: given.axes });
  frame();
  draw();
}

/** The curve of the target as it is, through the points. */
export function traceProfile(traced) {
  curve = traced;
  if (given && !byId("profile-drawing").hidden) draw();
}

function frame() {
  const all = whole();
  const low = [0, 1].map((axis) => Math.min(...all.map((point) => point[axis])));
  const high = [0, 1].map((axis) => Math.max(...all.map((point) => point[axis])));
  if (isTurned()) low[0] = 0;
  const sides = low.map((value, axis) => Math.max(high[axis] - value, 0.2 * size()));
  const scale = Math.min((WIDE - 2 * MARGIN) / sides[0], (1.25 * WIDE - 2 * MARGIN) / sides[1]);
  view = { low, scale, height: sides[1] * scale + 2 * MARGIN, left: (WIDE - sides[0] * scale) / 2 };
  byId("profile-svg").setAttribute("viewBox", `0 0 ${WIDE} ${view.height.toFixed(1)}`);
}

const place = ([x, y]) => [view.left + (x - view.low[0]) * view.scale, view.height - MARGIN - (y - view.low[1]) * view.scale];
const back = (x, y) => [view.low[0] + (x - view.left) / view.scale, view.low[1] + (view.height - MARGIN - y) / view.scale];
const path = (all) => all.map((point, at) => `${at ? "L" : "M"}${place(point).map((value) => value.toFixed(2)).join(" ")}`).join("");

function label(at) {
  const [first, second] = given.axes.split(", ");
  const [x, y] = points[at].map((value) => value.toFixed(3));
  return say(profile.point, { at: at + 1, count: points.length, first, second, x, y });
}

function draw() {
  const svg = byId("profile-svg");
  byId("profile-axis").setAttribute("d", isTurned() ? `M${place([0, 0])[0]} 0V${view.height}` : "");
  byId("profile-line").setAttribute("d", path(whole()));
  byId("profile-curve").setAttribute("d", path(curve.length ? curve : whole()));
  const marks = [...svg.querySelectorAll("circle")];
  while (marks.length > points.length) marks.pop().remove();
  while (marks.length < points.length) marks.push(svg.appendChild(handle(marks.length)));
  marks.forEach((mark, at) => {
    const [x, y] = place(points[at]);
    mark.setAttribute("cx", x.toFixed(2));
    mark.setAttribute("cy", y.toFixed(2));
    mark.setAttribute("aria-label", label(at));
    mark.setAttribute("aria-pressed", at === chosen);
  });
  byId("profile-remove").disabled = points.length < 3;
}

function handle(at) {
  const mark = document.createElementNS(byId("profile-svg").namespaceURI, "circle");
  mark.setAttribute("r", 7);
  mark.setAttribute("tabindex", 0);
  mark.setAttribute("role", "button");
  mark.addEventListener("pointerdown", (event) => {
    mark.setPointerCapture(event.pointerId);
    mark.focus();
  });
  mark.addEventListener("focus", () => {
    chosen = at;
    draw();
  });
  mark.addEventListener("pointermove", (event) => {
    if (mark.hasPointerCapture(event.pointerId)) put(at, back(...inDrawing(event)));
  });
  mark.addEventListener("pointerup", () => {
    frame();
    draw();
  });
  mark.addEventListener("keydown", (event) => keyed(event, at));
  return mark;
}

function inDrawing(event) {
  const svg = byId("profile-svg");
  const box = svg.getBoundingClientRect();
  const scale = WIDE / box.width;
  return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
}

function put(at, [x, y]) {
  const point = [x, y];
  if (isTurned()) point[0] = Math.max(x, LEAST * size());
  if (byId("profile-symmetric").checked) point[mirrored()] = Math.max(point[mirrored()], at ? LEAST * size() : 0);
  points[at] = point.map(round);
  draw();
  changed();
}

function keyed(event, at) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const step = (event.shiftKey ? 0.1 : 0.01) * size();
  const ways = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
  if (event.key in ways) put(at, points[at].map((value, axis) => value + ways[event.key][axis]));
  else if (event.key === "+" || event.key === "Insert") add();
  else if (event.key === "Delete" || event.key === "Backspace") remove();
  else return;
  event.preventDefault();
}

function focusOn(at) {
  chosen = at;
  frame();
  draw();
  byId("profile-svg").querySelectorAll("circle")[at].focus();
  changed();
}

/** A point between the chosen one and the next, or before it at the end. */
function add() {
  const at = Math.min(chosen, points.length - 2);
  points.splice(at + 1, 0, points[at].map((value, axis) => round((value + points[at + 1][axis]) / 2)));
  focusOn(at + 1);
}

function remove() {
  if (points.length < 3) return;
  points.splice(chosen, 1);
  focusOn(Math.min(chosen, points.length - 1));
}

function symmetric() {
  const axis = mirrored();
  if (byId("profile-symmetric").checked) {
    const values = points.map((point) => point[axis]);
    const middle = (Math.min(...values) + Math.max(...values)) / 2;
    const moved = points.map((point) => point.map((value, at) => round(at === axis ? value - middle : value)));
    const half = moved.filter((point) => point[axis] > -1e-9).sort((a, b) => a[axis] - b[axis]);
    points = half.length > 1 ? half : moved.slice(-2).map((point) => point.map((value, at) => (at === axis ? Math.abs(value) : value)));
  } else {
    byId("profile-symmetric").checked = true;
    points = whole();
    byId("profile-symmetric").checked = false;
  }
  focusOn(0);
}

export function beginProfile(onChange) {
  changed = onChange;
  byId("draw-profile").addEventListener("change", ({ currentTarget }) => {
    byId("profile-drawing").hidden = !currentTarget.checked;
    frame();
    draw();
  });
  byId("profile-symmetric").addEventListener("change", symmetric);
  byId("profile-add").addEventListener("click", add);
  byId("profile-remove").addEventListener("click", remove);
  byId("profile-back").addEventListener("click", () => {
    points = given.points.map((point) => [...point]);
    byId("profile-symmetric").checked = false;
    focusOn(0);
  });
}
