// The pattern in space: flat-shaded facets with a colour for each side or for their strain, creases
// by their assignment.

const FACET_VERTEX = `#version 300 es
precision highp float;
in vec3 point;
in float strain;
uniform mat4 camera, view;
out vec3 seen;
flat out float amount;
void main() {
  amount = strain;
  seen = (view * vec4(point, 1.0)).xyz;
  gl_Position = camera * vec4(point, 1.0);
}`;

// The normal of a flat facet is the same all over it: the cross product of how the place seen
// changes from pixel to pixel. It is turned to the viewer; which side is seen is told by winding.
const FACET_FRAGMENT = `#version 300 es
precision highp float;
in vec3 seen;
flat in float amount;
uniform vec3 front, back, ramp[5];
uniform bool strained;
out vec4 result;
vec3 ramped() {
  float at = clamp(amount, 0.0, 1.0) * 4.0;
  int low = min(int(at), 3);
  return mix(ramp[low], ramp[low + 1], at - float(low));
}
void main() {
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
  if (normal.z < 0.0) normal = -normal;
  float key = max(dot(normal, normalize(vec3(-0.45, 0.6, 0.66))), 0.0);
  float fill = max(dot(normal, normalize(vec3(0.7, -0.15, 0.5))), 0.0);
  float shade = 0.5 + 0.42 * key + 0.14 * fill;
  vec3 paper = gl_FrontFacing ? front : back;
  result = vec4((strained ? ramped() : paper) * shade, 1.0);
}`;

// Widths are parts of the thickest line.
const CREASES = {
  M: { name: "Mountain", colour: "#d55e00", width: 1 },
  V: { name: "Valley", colour: "#1a80bf", width: 1 },
  B: { name: "Border", colour: "--crease-border", width: 0.8 },
  F: { name: "Flat", colour: "--crease-flat", width: 0.55 },
  U: { name: "Unassigned", colour: "--crease-flat", width: 0.55 },
  C: { name: "Cut", colour: "#cc79a7", width: 0.8 },
  J: { name: "Join", colour: "--crease-flat", width: 0.55 },
  S: { name: "Seam", colour: "#009e73", width: 1 },
};
const THICKEST = 2.2;
const RAMP = ["#4575b4", "#abd9e9", "#ffffbf", "#fdae61", "#d73027"];
const ONE_WAY = 4500; // ms of a motion that plays, from one end to the other
const REST = 700;
const FIELD = Math.tan((16 * Math.PI) / 180);

/** The screen's axes in space: right, up, and out of it towards the eye. Z is up in space. */
function axes({ yaw, pitch }) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return { right: [cy, sy, 0], up: [-sy * sp, cy * sp, cp], out: [sy * cp, -cy * cp, sp] };
}

/** The points (three numbers each) that `order` names, one after another. */
function gather(points, order) {
  const found = new Float32Array(order.length * 3);
  for (let at = 0; at < order.length; at += 1) {
    const from = 3 * order[at];
    found[3 * at] = points[from];
    found[3 * at + 1] = points[from + 1];
    found[3 * at + 2] = points[from + 2];
  }
  return found;
}

/** An element of a drawing, with attributes, and with styles that may name the page's colours. */
function drawn(tag, attributes, styles) {
  const made = document.createElementNS(byId("flat-pattern").namespaceURI, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  Object.assign(made.style, styles);
  return made;
}

class FoldView {
  constructor(fold) {
    this.fold = fold;
    this.stage = new Stage(byId("fold-canvas"), true, (gl) => this.paint(gl));
    const { gl } = this.stage;
    this.facet = compile(gl, FACET_VERTEX, FACET_FRAGMENT);
    this.triangles = decode(fold.triangles, Uint32Array);
    this.edges = decode(fold.edges, Uint32Array);
    this.forms = fold.forms.map((form) => ({
      ...form,
      coordinates: this.unpack(form),
      camera: this.home(form),
    }));
    this.pointBuffer = gl.createBuffer();
    this.facets = gl.createVertexArray();
    gl.bindVertexArray(this.facets);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.pointBuffer);
    gl.enableVertexAttribArray(this.facet.attribute("point"));
    gl.vertexAttribPointer(this.facet.attribute("point"), 3, gl.FLOAT, false, 12, 0);
    this.strainBuffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.strainBuffer);
    gl.vertexAttribPointer(this.facet.attribute("strain"), 1, gl.UNSIGNED_BYTE, true, 1, 0);
    gl.bindVertexArray(null);
    this.strains = fold.strain && decode(fold.strain.values, Uint8Array);
    this.owners = fold.strain && decode(fold.strain.owners, Uint32Array);
    this.creases = new Lines(this.stage, decode(fold.kinds, Uint8Array));
    if (fold.layers) this.stack(fold.layers);
    this.crease = fold.lengths.reduce((sum, length) => sum + length, 0) / (this.edges.length / 2);
    this.legend();
    for (const [at, form] of this.forms.entries()) {
      const button = element("button", { type: "button", textContent: form.name });
      button.setAttribute("role", "radio");
      button.addEventListener("click", () => this.choose(at));
      byId("forms").append(button);
    }
    byId("forms").addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      this.choose((this.at + step + this.forms.length) % this.forms.length);
      byId("forms").children[this.at].focus();
    });
    byId("motion").addEventListener("input", (event) => {
      this.play(false);
      this.show(Number(event.target.value));
    });
    byId("fold-play").addEventListener("click", () => this.play(!this.playing));
    byId("apart").addEventListener("input", () => this.show(Number(byId("motion").value)));
    byId("by-strain").addEventListener("change", () => this.stage.draw());
    byId("by-strain").checked = Boolean(fold.strain && fold.strain.shown);
    byId("fold-fit").addEventListener("click", () => this.fit());
    gestures(this.stage.canvas, {
      turn: (dx, dy) => this.turn(dx, dy),
      shift: (dx, dy) => this.shift(dx, dy),
      zoom: (factor) => this.zoom(factor),
      keys: { 0: () => this.fit(), " ": () => this.play(!this.playing) },
    });
    byId("fold").hidden = false;
    this.playing = false;
    if (this.forms.some((form) => form.frames > 1)) this.aside();
    this.choose(Math.min(fold.first, this.forms.length - 1));
  }

  /** What draws the layers of the last frame apart: each facet moves, and with it its own sides. */
  stack(layers) {
    const sides = decode(layers.sides, Uint32Array);
    const kinds = decode(this.fold.kinds, Uint8Array);
    this.layers = {
      closed: layers.closed,
      along: layers.along,
      shifts: decode(layers.shifts, Float32Array),
      owners: decode(layers.owners, Uint32Array),
      sideOwners: decode(layers.side_owners, Uint32Array),
      ends: Uint32Array.from({ length: 2 * sides.length }, (_, at) => this.edges[2 * sides[at >> 1] + (at & 1)]),
      lines: new Lines(this.stage, Uint8Array.from(sides, (side) => kinds[side])),
    };
  }

  /** `points`, of which `each` in a row belong to one of `owners`, moved with their facets by `part`. */
  apart(points, owners, each, part) {
    const { along, shifts } = this.layers;
    for (let at = 0; at < points.length; at += 1) {
      points[at] += part * shifts[owners[Math.floor(at / 3 / each)]] * along[at % 3];
    }
    return points;
  }

  /** (frames x vertices x 3) coordinates in mm about the middle of the form. */
  unpack({ points, box: [, , , sx, sy, sz] }) {
    const packed = decode(points, Uint16Array);
    const span = [sx, sy, sz];
    return Float32Array.from(packed, (value, at) => (value / 65535 - 0.5) * span[at % 3]);
  }

  home({ flat }) {
    return {
      yaw: flat ? 0 : -0.6, pitch: flat ? Math.PI / 2 : 0.62, x: 0, y: 0, near: 1,
    };
  }

  legend() {
    const entries = this.fold.assignments.map((letter, kind) => ({
      kind, name: CREASES[letter].name, colour: CREASES[letter].colour, note: lengthText(this.fold.lengths[kind]),
    }));
    this.shown = legend(byId("creases"), entries, () => this.stage.draw());
    if (this.fold.strain) {
      const { most } = this.fold.strain;
      byId("strain-most").textContent = most ? `strain 0 to ${most.toExponential(1)}` : "no strain";
      byId("strain-ramp").style.background = `linear-gradient(to right, ${RAMP.join(", ")})`;
    }
    for (const [name, colour] of [["Front", "--side-a"], ["Back", "--side-b"]]) {
      const swatch = element("span", { className: "swatch area" });
      swatch.style.background = `var(${colour})`;
      byId("creases").append(element("span", {}, swatch, name));
    }
  }

  choose(at) {
    this.play(false);
    this.at = at;
    this.form = this.forms[at];
    for (const [place, button] of [...byId("forms").children].entries()) {
      button.setAttribute("aria-checked", place === at);
      button.tabIndex = place === at ? 0 : -1;
    }
    const moves = this.form.frames > 1;
    byId("motion-bar").hidden = !moves;
    byId("fold-side").hidden = !moves;
    byId("strain-key").hidden = !moves || !this.strains;
    if (moves && Number(byId("motion").max) !== this.form.frames - 1) {
      byId("motion").max = this.form.frames - 1;
      byId("motion").value = this.fold.start;
    }
    this.show(moves ? Number(byId("motion").value) : 0);
  }

  /** Tell the size of the box around what is shown. */
  measure(points) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let at = 0; at < points.length; at += 1) {
      low[at % 3] = Math.min(low[at % 3], points[at]);
      high[at % 3] = Math.max(high[at % 3], points[at]);
    }
    const size = high.map((most, axis) => (most - low[axis]).toFixed(most - low[axis] >= 100 ? 0 : 1));
    byId("fold-size").value = `${(this.form.flat ? size.slice(0, 2) : size).join(" × ")} mm`;
  }

  /** There and back again, with a rest at either end, until it is stopped. */
  play(wanted) {
    if (wanted === this.playing) return;
    this.playing = wanted;
    byId("fold-play").textContent = wanted ? "Pause" : "Play";
    byId("fold-play").setAttribute("aria-pressed", wanted);
    if (!wanted) return;
    const last = this.form.frames - 1;
    const at = Number(byId("motion").value);
    let begin = performance.now() - (at < last ? at / last : 0) * ONE_WAY - REST;
    const tick = (moment) => {
      if (!this.playing) return;
      const round = Math.max(moment - begin, 0) % (2 * (ONE_WAY + REST));
      const back = round > ONE_WAY + REST;
      const part = Math.min(Math.max(((back ? round - ONE_WAY - REST : round) - REST) / ONE_WAY, 0), 1);
      this.show((back ? 1 - part : part) * last);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  /** The coordinates at `frame`, between two frames blended. */
  points(frame) {
    const count = this.form.coordinates.length / this.form.frames;
    const of = (number) => this.form.coordinates.subarray(number * count, (number + 1) * count);
    const low = Math.floor(frame);
    const part = frame - low;
    if (part === 0) return of(low);
    const [before, after] = [of(low), of(low + 1)];
    return before.map((value, at) => value + part * (after[at] - value));
  }

  /** Beside the view: the flat pattern, and the energy along the motion with a mark at the frame. */
  aside() {
    const flat = this.forms.find((form) => form.flat);
    const [, , , width, height] = flat.box;
    const margin = 0.03 * Math.max(width, height);
    const svg = byId("flat-pattern");
    svg.setAttribute("viewBox", [-margin, -margin, width + 2 * margin, height + 2 * margin].map((mm) => mm.toFixed(2)).join(" "));
    const lines = this.fold.assignments.map(() => "");
    const place = (vertex) => (
      `${(flat.coordinates[3 * vertex] + width / 2).toFixed(2)} ${(height / 2 - flat.coordinates[3 * vertex + 1]).toFixed(2)}`
    );
    decode(this.fold.kinds, Uint8Array).forEach((kind, edge) => {
      lines[kind] += `M${place(this.edges[2 * edge])}L${place(this.edges[2 * edge + 1])}`;
    });
    lines.forEach((line, kind) => {
      const { colour, width: wide } = CREASES[this.fold.assignments[kind]];
      const stroke = colour.startsWith("--") ? `var(${colour})` : colour;
      svg.append(drawn("path", { d: line, "stroke-width": 1.3 * wide, "vector-effect": "non-scaling-stroke" }, { stroke, fill: "none" }));
    });
    const { energy } = this.fold;
    byId("energy-note").textContent = energy
      ? `Bending energy of the facets, at most ${Number(energy.most.toPrecision(2))} ${energy.unit}`
      : "The facets stay flat: bending them takes no energy.";
    const chart = byId("energy");
    chart.setAttribute("viewBox", "0 0 100 60");
    chart.setAttribute("preserveAspectRatio", "none");
    this.height = (at) => 56 - 50 * (energy ? energy.values[at] / energy.most : 0);
    const last = this.forms.at(-1).frames - 1;
    this.across = (at) => 3 + (94 * at) / last;
    const path = Array.from({ length: last + 1 }, (_, at) => `${this.across(at).toFixed(2)} ${this.height(at).toFixed(2)}`);
    chart.append(drawn("path", { d: `M${path.join("L")}`, "stroke-width": 1.8, "vector-effect": "non-scaling-stroke" }, { stroke: "var(--accent)", fill: "none" }));
    this.mark = drawn("path", { "stroke-width": 1.2, "vector-effect": "non-scaling-stroke" }, { stroke: "var(--ink)" });
    chart.append(this.mark);
  }

  /** Put one frame of the form on the stage; while it plays, also what lies between two frames. */
  show(at) {
    const { gl } = this.stage;
    const points = this.points(at);
    const frame = Math.round(at);
    if (this.playing) byId("motion").value = frame;
    if (this.mark && this.form.frames > 1) this.mark.setAttribute("d", `M${this.across(at).toFixed(2)} 2V58`);
    this.shownPoints = points;
    this.radius = 0;
    for (let at = 0; at < points.length; at += 3) {
      this.radius = Math.max(this.radius, Math.hypot(points[at], points[at + 1], points[at + 2]));
    }
    this.measure(points);
    const corners = gather(points, this.triangles);
    this.stacked = Boolean(this.layers) && this.form.frames > 1 && at === this.form.frames - 1;
    byId("layers-bar").hidden = !this.stacked;
    if (this.stacked) {
      const { closed, owners, sideOwners, ends, lines } = this.layers;
      const part = Math.max(closed, Number(byId("apart").value) / 100);
      this.apart(corners, owners, 3, part);
      lines.place(this.apart(gather(points, ends), sideOwners, 2, part), 3);
    } else {
      this.creases.place(gather(points, this.edges), 3);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, this.pointBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.DYNAMIC_DRAW);
    if (this.strains && this.form.frames > 1) this.colour(frame);
    if (this.form.frames > 1) {
      const name = this.fold.names[frame];
      const text = `${frame + 1} of ${this.form.frames}${name ? `, ${name}` : ""}`;
      byId("motion-frame").value = text;
      byId("motion").setAttribute("aria-valuetext", text);
    }
    this.stage.draw();
  }

  /** The strain of each triangle's facet, at each of its corners. */
  colour(frame) {
    const { gl } = this.stage;
    const from = (frame * this.strains.length) / this.form.frames;
    const strain = new Uint8Array(this.triangles.length);
    this.owners.forEach((facet, at) => strain.fill(this.strains[from + facet], 3 * at, 3 * at + 3));
    gl.bindBuffer(gl.ARRAY_BUFFER, this.strainBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, strain, gl.DYNAMIC_DRAW);
  }

  fit() {
    this.form.camera = this.home(this.form);
    this.stage.draw();
  }

  turn(dx, dy) {
    const camera = this.form.camera;
    const limit = Math.PI / 2;
    camera.yaw -= dx * 0.008;
    camera.pitch = Math.min(Math.max(camera.pitch + dy * 0.008, -limit), limit);
    this.stage.draw();
  }

  /** The distance of the eye from the middle at which all points are in view from home. */
  reach(points) {
    const { right, up, out } = axes(this.home(this.form));
    const dot = (axis, at) => axis[0] * points[at] + axis[1] * points[at + 1] + axis[2] * points[at + 2];
    const tangents = [(FIELD * this.stage.width) / this.stage.height, FIELD];
    let most = 0;
    for (let at = 0; at < points.length; at += 3) {
      const ahead = dot(out, at);
      most = Math.max(most, ahead + Math.abs(dot(right, at)) / tangents[0], ahead + Math.abs(dot(up, at)) / tangents[1]);
    }
    return most * 1.06;
  }

  get distance() {
    return this.full * this.form.camera.near;
  }

  shift(dx, dy) {
    const mm = (2 * this.distance * FIELD) / this.stage.height;
    this.form.camera.x += dx * mm;
    this.form.camera.y -= dy * mm;
    this.stage.draw();
  }

  zoom(factor) {
    const camera = this.form.camera;
    camera.near = Math.min(Math.max(camera.near / factor, 0.02), 6);
    this.stage.draw();
  }

  /** The view (world to eye) and the camera (world to clip space), column by column. */
  matrices() {
    const { x, y } = this.form.camera;
    const radius = this.radius * (this.stacked ? 2 : 1.05);
    const { right, up, out } = axes(this.form.camera);
    const z = -this.distance;
    const view = [0, 1, 2].flatMap((axis) => [right[axis], up[axis], out[axis], 0]).concat([x, y, z, 1]);
    const far = this.distance + radius;
    const near = Math.max(this.distance - radius, far / 400);
    const scale = [this.stage.height / this.stage.width / FIELD, 1 / FIELD];
    const [c, d] = [-(far + near) / (far - near), (-2 * far * near) / (far - near)];
    const camera = [];
    for (let column = 0; column < 4; column += 1) {
      const [vx, vy, vz, vw] = view.slice(4 * column, 4 * column + 4);
      camera.push(scale[0] * vx, scale[1] * vy, c * vz + d * vw, -vz);
    }
    return { view, camera };
  }

  paint(gl) {
    const seen = `${this.at} ${this.stage.width} ${this.stage.height}`;
    if (seen !== this.seen) [this.seen, this.most] = [seen, this.reach(this.form.coordinates)];
    // as near as the frame allows, but so that a sheet that closes is still seen to become smaller
    this.full = this.form.frames > 1 ? Math.max(this.reach(this.shownPoints), 0.6 * this.most) : this.most;
    const { view, camera } = this.matrices();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    gl.useProgram(this.facet.program);
    gl.uniformMatrix4fv(this.facet.uniform.camera, false, camera);
    gl.uniformMatrix4fv(this.facet.uniform.view, false, view);
    gl.uniform3fv(this.facet.uniform.front, rgb("--side-a"));
    gl.uniform3fv(this.facet.uniform.back, rgb("--side-b"));
    const strained = Boolean(this.strains) && this.form.frames > 1 && byId("by-strain").checked;
    gl.uniform1i(this.facet.uniform.strained, strained);
    gl.uniform3fv(this.facet.uniform.ramp, RAMP.flatMap(rgb));
    gl.bindVertexArray(this.facets);
    const place = this.facet.attribute("strain");
    if (strained) gl.enableVertexAttribArray(place);
    else gl.disableVertexAttribArray(place);
    gl.drawArrays(gl.TRIANGLES, 0, this.triangles.length);
    gl.bindVertexArray(null);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    const pixels = (this.crease * this.stage.height) / (2 * this.distance * FIELD);
    const thick = Math.min(Math.max(0.09 * pixels, 0.45), THICKEST);
    const kinds = this.fold.assignments.map((letter) => ({ ...CREASES[letter], width: CREASES[letter].width * thick }));
    const [lines, ends] = this.stacked ? [this.layers.lines, this.layers.ends] : [this.creases, this.edges];
    this.stage.lines(lines, ends.length / 2, camera, kinds, { shown: this.shown(), nearer: 4e-4 });
    gl.depthMask(true);
  }
}
