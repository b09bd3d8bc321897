// The target in space: its triangles with the grid of facets, the pieces and the part that is covered;
// after a fit with the deviation as colour. What is covered is decided for each pixel from its place in
// the flat layout, so a hand that turns or moves the part sees it at once. The eye that goes around it is
// that of Scene (workflow/page/scene.js), which the page loads before.

/* global Scene, compile, decode, hit, minus, rgb, FIELD, RAMP */

const VERTEX = `#version 300 es
precision highp float;
in vec3 point, normal;
in vec2 place;
in float state, deviation;
uniform mat4 camera;
uniform mat3 turned;
uniform vec3 offset;
out vec3 facing;
out vec2 flat_place;
out float gap;
flat out float kind;
void main() {
  facing = turned * normal;
  flat_place = place;
  gap = deviation;
  kind = state;
  gl_Position = camera * vec4(point + offset, 1.0);
}`;

// `turn` is the cosine and sine by which the layout is turned back, `box` the corner and the size of the
// turned layout, `part` the rectangle in it. `kind` is 0 for the target, 1 for what fills a hole, 2 for what
// the sheet has left out.
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 facing;
in vec2 flat_place;
in float gap;
flat in float kind;
uniform vec2 turn;
uniform vec4 box, part;
uniform vec2 cells; // none: no grid
uniform float pieces, most;
uniform int colours;
uniform bool all_round;
uniform vec3 paper, other, left_out, filled, grid, seam, ramp[5];
out vec4 result;
float line(float at, float pixels) {
  float width = max(fwidth(at), 1e-9);
  return clamp(pixels * 0.5 + 0.5 - abs(fract(at + 0.5) - 0.5) / width, 0.0, 1.0) * clamp(0.6 / (width * pixels), 0.0, 1.0);
}
void main() {
  vec2 at = vec2(turn.x * flat_place.x + turn.y * flat_place.y, turn.x * flat_place.y - turn.y * flat_place.x);
  at = ((at - box.xy) / box.zw - part.xz) / (part.yw - part.xz);
  bool inside = all_round || (min(at.x, at.y) >= -1e-4 && max(at.x, at.y) <= 1.0001);
  float column = line(at.x * cells.x, 1.0) * step(1.0, cells.x), row = line(at.y * cells.y, 1.0) * step(1.0, cells.y);
  float cut = line(at.x * pieces, 2.6);
  if (!all_round) cut *= step(0.5 / pieces, at.x) * step(at.x, 1.0 - 0.5 / pieces);
  vec3 colour = left_out;
  if (colours == 1) {
    colour = mod(floor((all_round ? fract(at.x) : clamp(at.x, 0.0, 0.9999)) * pieces), 2.0) < 0.5 ? paper : other;
    colour = mix(colour, grid, 0.55 * max(column, row));
    colour = mix(colour, seam, cut);
    if (kind > 0.5) colour = filled;
    if (!inside) colour = left_out;
  } else if (colours == 2 && kind < 1.5) {
    float level = clamp(0.5 + 0.5 * gap / most, 0.0, 1.0) * 4.0;
    int low = min(int(level), 3);
    colour = mix(ramp[low], ramp[low + 1], level - float(low));
    colour = mix(colour, grid, 0.3 * max(column, row) * float(inside));
  }
  vec3 normal = normalize(facing);
  if (normal.z < 0.0) normal = -normal;
  float key = max(dot(normal, vec3(-0.451, 0.601, 0.661)), 0.0);
  float fill = max(dot(normal, vec3(0.801, -0.172, 0.573)), 0.0);
  result = vec4(colour * (0.5 + 0.42 * key + 0.14 * fill), 1.0);
}`;

const PLAIN = 0;
export const CHARTS = 1;
export const DEVIATION = 2;
const NUMBERS = 10; // of a corner: point, normal, place, state, deviation

/** The numbers of a picture. */
export function unpack(picture) {
  const { points, faces, flat, filled, deviation, missed } = picture;
  return {
    ...picture,
    points: decode(points, Float32Array),
    faces: decode(faces, Uint32Array),
    flat: decode(flat, Float32Array),
    filled: decode(filled, Uint8Array),
    deviation: deviation && decode(deviation, Float32Array),
    missed: missed && decode(missed, Uint8Array),
  };
}

/** The normals at the vertices, each as long as the triangles about it are large. */
function normalsOf({ points, faces }) {
  const found = new Float32Array(points.length);
  for (let at = 0; at < faces.length; at += 3) {
    const [a, b, c] = [3 * faces[at], 3 * faces[at + 1], 3 * faces[at + 2]];
    const [px, py, pz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
    const [qx, qy, qz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    const normal = [py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx];
    for (const vertex of [a, b, c]) for (let axis = 0; axis < 3; axis += 1) found[vertex + axis] += normal[axis];
  }
  return found;
}

/** The area of the triangles. */
export function areaOf({ points, faces }) {
  let sum = 0;
  for (let at = 0; at < faces.length; at += 3) {
    const [a, b, c] = [3 * faces[at], 3 * faces[at + 1], 3 * faces[at + 2]];
    const [px, py, pz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
    const [qx, qy, qz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    sum += Math.hypot(py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx) / 2;
  }
  return sum;
}

function cornersOf(picture) {
  const { points, faces, flat, filled, deviation, missed, girth } = picture;
  const normals = normalsOf(picture);
  const made = new Float32Array(NUMBERS * faces.length);
  for (let at = 0; at < faces.length; at += 1) {
    const vertex = faces[at];
    const triangle = Math.floor(at / 3);
    made.set(points.subarray(3 * vertex, 3 * vertex + 3), NUMBERS * at);
    made.set(normals.subarray(3 * vertex, 3 * vertex + 3), NUMBERS * at + 3);
    made[NUMBERS * at + 6] = flat[2 * vertex];
    made[NUMBERS * at + 7] = flat[2 * vertex + 1];
    made[NUMBERS * at + 8] = missed?.[triangle] ? 2 : filled[triangle];
    made[NUMBERS * at + 9] = deviation ? deviation[vertex] : 0;
  }
  if (girth) acrossTheStart(made, girth);
  return made;
}

/** Triangles of a tube that lie across the start of u have all their corners on one side of it. */
function acrossTheStart(corners, girth) {
  for (let at = 0; at < corners.length; at += 3 * NUMBERS) {
    const of = [0, 1, 2].map((corner) => at + corner * NUMBERS + 6);
    const highest = Math.max(...of.map((u) => corners[u]));
    for (const u of of) if (highest - corners[u] > girth / 2) corners[u] += girth;
  }
}

export class TargetScene extends Scene {
  constructor(canvas, tap) {
    super(canvas, { tap: (x, y) => tap(this.spot(x, y)) });
    this.program = compile(this.stage.gl, VERTEX, FRAGMENT);
    this.layers = [];
    this.points = new Float32Array(0);
    this.view = { turn: [1, 0], box: [0, 0, 1, 1], part: [0, 1, 0, 1], cells: [1, 1], pieces: 1, colours: CHARTS };
    this.open(this.points);
  }

  /** Show pictures one over the other, the last on top; the eye keeps its place where `keep` says so. */
  show(pictures, keep) {
    const { gl } = this.stage;
    for (const { array, buffer } of this.layers) {
      gl.deleteVertexArray(array);
      gl.deleteBuffer(buffer);
    }
    this.layers = pictures.map((picture) => this.layer(picture));
    this.points = pictures.at(-1)?.points ?? new Float32Array(0);
    if (keep) this.draw();
    else this.open(this.points);
  }

  layer(picture) {
    const { gl } = this.stage;
    const corners = cornersOf(picture);
    const array = gl.createVertexArray();
    const buffer = gl.createBuffer();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    const parts = [["point", 3, 0], ["normal", 3, 3], ["place", 2, 6], ["state", 1, 8], ["deviation", 1, 9]];
    for (const [name, size, from] of parts) {
      const at = this.program.attribute(name);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, gl.FLOAT, false, 4 * NUMBERS, 4 * from);
    }
    gl.bindVertexArray(null);
    return { array, buffer, picture, count: corners.length / NUMBERS };
  }

  /** The place of the target under a point of the canvas, in its own coordinates; null for none. */
  spot(x, y) {
    const top = this.layers.at(-1)?.picture;
    if (!top || !this.rows) return null;
    const { width, height } = this.stage;
    const screen = [((2 * x) / width - 1) * FIELD * this.aspect, (1 - (2 * y) / height) * FIELD, -1];
    const ray = [0, 1, 2].map((axis) => this.rows.reduce((sum, row, at) => sum + row[axis] * screen[at], 0));
    let nearest = Infinity;
    for (let at = 0; at < top.faces.length; at += 3) {
      const [p, q, r] = [0, 1, 2].map((step) => top.points.subarray(3 * top.faces[at + step], 3 * top.faces[at + step] + 3));
      nearest = Math.min(nearest, hit(this.eye, ray, p, minus(q, p), minus(r, p)));
    }
    return nearest < Infinity ? this.eye.map((value, axis) => value + nearest * ray[axis] + top.middle[axis]) : null;
  }

  /** What is drawn: see FRAGMENT. */
  set(view) {
    Object.assign(this.view, view);
    this.draw();
  }

  paint(gl) {
    gl.clearColor(...rgb("--view"), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!this.points.length) return;
    const { program, uniform } = this.program;
    const camera = this.look();
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniform.camera, false, camera);
    gl.uniformMatrix3fv(uniform.turned, false, [0, 1, 2].flatMap((axis) => this.rows.map((row) => row[axis])));
    const { turn, box, part, cells, pieces, colours } = this.view;
    gl.uniform2fv(uniform.turn, turn);
    gl.uniform4fv(uniform.box, box);
    gl.uniform4fv(uniform.part, part);
    gl.uniform2fv(uniform.cells, cells);
    gl.uniform1f(uniform.pieces, pieces);
    const names = { paper: "--side-a", other: "--side-c", left_out: "--left-out", filled: "--filled", grid: "--grid", seam: "--seam" };
    for (const [name, colour] of Object.entries(names)) gl.uniform3fv(uniform[name], rgb(colour));
    gl.uniform3fv(uniform.ramp, RAMP.flatMap(rgb));
    const top = this.layers.at(-1);
    for (const each of this.layers) {
      const plain = each !== top || each.picture.kind === "file";
      gl.uniform1i(uniform.colours, plain ? PLAIN : each.picture.deviation ? colours : CHARTS);
      gl.uniform1i(uniform.all_round, each.picture.kind === "tube");
      gl.uniform1f(uniform.most, each.picture.most || 1);
      gl.uniform3fv(uniform.offset, each.picture.middle.map((value, axis) => value - top.picture.middle[axis]));
      gl.polygonOffset(each === top ? 0 : 2, each === top ? 0 : 2);
      gl.bindVertexArray(each.array);
      gl.drawArrays(gl.TRIANGLES, 0, each.count);
    }
    gl.bindVertexArray(null);
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }
}
