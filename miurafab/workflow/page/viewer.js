// What both drawings share: thick lines in WebGL 2, gestures on a canvas, and numbers as people read them.

const byId = (id) => document.getElementById(id);

/** Base64 text as a typed array of little-endian numbers. */
function decode(text, Type) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  return new Type(bytes.buffer);
}

function clockText(seconds) {
  const whole = Math.round(seconds);
  const two = (number) => String(number).padStart(2, "0");
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return h ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)}`;
}

function lengthText(mm) {
  if (mm >= 1000) return `${(mm / 1000).toFixed(2)} m`;
  return `${mm.toFixed(mm >= 100 ? 0 : 1)} mm`;
}

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** A colour of the page's style sheet, or one written as #rrggbb, as [r, g, b] in 0..1. */
function rgb(name) {
  const text = name.startsWith("--")
    ? getComputedStyle(document.documentElement).getPropertyValue(name).trim()
    : name;
  return [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
}

/** Check boxes for the kinds of line that a drawing can hide; bit k of the answer shows kind k. */
function legend(fieldset, entries, onChange) {
  fieldset.replaceChildren(fieldset.querySelector("legend"));
  const boxes = entries.map((entry) => {
    const box = element("input", { type: "checkbox", checked: entry.shown !== false });
    const swatch = element("span", { className: `swatch ${entry.look || ""}` });
    swatch.style.color = entry.colour.startsWith("--") ? `var(${entry.colour})` : entry.colour;
    fieldset.append(element("label", {}, box, swatch, entry.name, element("small", { textContent: entry.note })));
    box.addEventListener("change", onChange);
    return box;
  });
  return () => entries.reduce((mask, entry, at) => (boxes[at].checked ? mask | (1 << entry.kind) : mask), 0);
}

function compile(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const uniform = new Proxy({}, {
    get: (known, name) => (name in known ? known[name] : (known[name] = gl.getUniformLocation(program, name))),
  });
  return { program, uniform, attribute: (name) => gl.getAttribLocation(program, name) };
}

// Four vertices a segment from p to q: it is widened on the screen to a rectangle of the wanted pixels.
const WIDEN = `
  vec2 s = p.xy / p.w * size * 0.5, t = q.xy / q.w * size * 0.5;
  float corner = float(gl_VertexID & 1), side = float((gl_VertexID >> 1) & 1) * 2.0 - 1.0;
  reach = distance(s, t);
  vec2 way = reach > 0.0 ? (t - s) / reach : vec2(1.0, 0.0);
  half_width = widths[k] * 0.5;
  place = vec2(mix(-0.5, reach + 0.5, corner), side * (half_width + 0.5));
  vec2 spot = s + way * place.x + vec2(-way.y, way.x) * place.y;
  float depth = mix(p.z / p.w, q.z / q.w, corner) - nearer;
  gl_Position = vec4(spot / (size * 0.5), depth, 1.0);
`;

// The segment goes from a to b. Dashed ones shorter than a dash are left out: hops over the gaps of a perforation would
// fill them. A segment is drawn while its kind is shown and its time has come; the one under way only in part.
const LINE_VERTEX = `#version 300 es
precision highp float;
in vec3 a, b;
in float kind, begin, end;
uniform mat4 camera;
uniform vec2 size;
uniform float now, nearer;
uniform int shown, dashed;
uniform vec3 colours[8];
uniform float widths[8];
out vec2 place;
flat out float reach, half_width, dash;
flat out vec3 colour;
void main() {
  int k = int(kind + 0.5);
  vec4 p = camera * vec4(a, 1.0);
  vec4 q = camera * vec4(end > now ? mix(a, b, (now - begin) / (end - begin)) : b, 1.0);
  if (((shown >> k) & 1) == 0 || begin > now || p.w <= 0.0 || q.w <= 0.0) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  colour = colours[k];
  dash = ((dashed >> k) & 1) == 1 ? 1.0 : 0.0;
${WIDEN}}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
flat in float reach, half_width, dash;
flat in vec3 colour;
uniform float dash_pixels;
out vec4 result;
void main() {
  float cover = clamp(half_width + 0.5 - abs(place.y), 0.0, 1.0);
  cover *= clamp(place.x + 0.5, 0.0, 1.0) * clamp(reach - place.x + 0.5, 0.0, 1.0);
  if (dash > 0.5) cover *= reach < dash_pixels ? 0.0 : 0.8 * step(mod(place.x, dash_pixels * 1.8), dash_pixels);
  if (cover <= 0.0) discard;
  result = vec4(colour, 1.0) * cover;
}`;

/** A canvas that is drawn when something changed, and never otherwise. Lines smooth themselves. */
class Stage {
  constructor(canvas, antialias, paint) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias, alpha: false });
    if (!this.gl) throw new Error("no WebGL 2");
    this.paint = paint;
    this.waiting = false;
    this.moment = 0;
    this.pace = 0; // ms between frames that follow each other
    this.line = compile(this.gl, LINE_VERTEX, LINE_FRAGMENT);
    new ResizeObserver(() => this.draw()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => location.reload());
  }

  get width() { return this.canvas.clientWidth; }
  get height() { return this.canvas.clientHeight; }
  get ratio() { return window.devicePixelRatio || 1; }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((moment) => {
      this.waiting = false;
      const gap = moment - this.moment;
      this.pace = gap < 150 ? 0.7 * this.pace + 0.3 * gap : 0;
      this.moment = moment;
      if (!this.width || !this.height) return;
      const [width, height] = [Math.round(this.width * this.ratio), Math.round(this.height * this.ratio)];
      if (this.canvas.width !== width || this.canvas.height !== height) {
        this.canvas.width = width;
        this.canvas.height = height;
      }
      this.gl.viewport(0, 0, width, height);
      this.paint(this.gl);
    });
  }

  /** Draw the first ``count`` lines of a batch; ``kinds`` are [{colour, width, dashed}], widths in CSS pixels. */
  lines(batch, count, camera, kinds, { shown = ~0, now = 3e38, nearer = 0 } = {}) {
    const { gl, line: { program, uniform } } = this;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniform.camera, false, camera);
    gl.uniform2f(uniform.size, this.canvas.width, this.canvas.height);
    gl.uniform1f(uniform.now, now);
    gl.uniform1f(uniform.nearer, nearer);
    gl.uniform1i(uniform.shown, shown);
    gl.uniform1i(uniform.dashed, kinds.reduce((mask, kind, at) => (kind.dashed ? mask | (1 << at) : mask), 0));
    gl.uniform1f(uniform.dash_pixels, 5 * this.ratio);
    gl.uniform3fv(uniform.colours, kinds.flatMap((kind) => rgb(kind.colour)));
    gl.uniform1fv(uniform.widths, kinds.map((kind) => kind.width * this.ratio));
    gl.bindVertexArray(batch.array);
    gl.drawElements(gl.TRIANGLES, 6 * count, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
  }
}

/** Every item of ``array``, ``width`` numbers long, four times in a row: once for each corner. */
function fourfold(array, width) {
  const made = new array.constructor(4 * array.length);
  for (let from = 0, to = 0; from < array.length; from += width) {
    const item = array.subarray(from, from + width);
    for (let corner = 0; corner < 4; corner += 1, to += width) made.set(item, to);
  }
  return made;
}

/**
 * Lines on the graphics card: ``kinds`` is a number a line, ``times`` the moments at which it
 * begins and ends. Four vertices a line are drawn faster than an instance by what has no card.
 */
class Lines {
  constructor(stage, kinds, times = null) {
    const { gl, line } = stage;
    this.gl = gl;
    this.line = line;
    this.array = gl.createVertexArray();
    this.buffers = [];
    this.ends = this.buffer();
    gl.bindVertexArray(this.array);
    this.attribute("kind", this.fill(this.buffer(), fourfold(kinds, 1)), 1, gl.UNSIGNED_BYTE, 1, 0);
    if (times) {
      const buffer = this.fill(this.buffer(), fourfold(times, 2));
      this.attribute("begin", buffer, 1, gl.FLOAT, 8, 0);
      this.attribute("end", buffer, 1, gl.FLOAT, 8, 4);
    }
    const corners = new Uint32Array(6 * kinds.length);
    for (let at = 0; at < kinds.length; at += 1) {
      corners.set([4 * at, 4 * at + 1, 4 * at + 2, 4 * at + 2, 4 * at + 1, 4 * at + 3], 6 * at);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
  }

  buffer() {
    this.buffers.push(this.gl.createBuffer());
    return this.buffers.at(-1);
  }

  fill(buffer, array) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, array, this.gl.STATIC_DRAW);
    return buffer;
  }

  attribute(name, buffer, size, type, stride, offset) {
    const at = this.line.attribute(name);
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.enableVertexAttribArray(at);
    this.gl.vertexAttribPointer(at, size, type, type === this.gl.UNSIGNED_SHORT, stride, offset);
  }

  /** Where the lines are: first and last point of each, of ``size`` numbers. 16 bits mean 0..1. */
  place(ends, size) {
    const { gl } = this;
    const type = ends instanceof Uint16Array ? gl.UNSIGNED_SHORT : gl.FLOAT;
    const bytes = size * ends.BYTES_PER_ELEMENT;
    gl.bindVertexArray(this.array);
    this.fill(this.ends, fourfold(ends, 2 * size));
    this.attribute("a", this.ends, size, type, 2 * bytes, 0);
    this.attribute("b", this.ends, size, type, 2 * bytes, bytes);
    gl.bindVertexArray(null);
    return this;
  }

  free() {
    this.gl.deleteVertexArray(this.array);
    this.buffers.forEach((buffer) => this.gl.deleteBuffer(buffer));
  }
}

/**
 * Mouse, touch and keys on a drawing as wishes: turn(dx, dy) and shift(dx, dy) in pixels, zoom(factor, x, y)
 * about a point of the drawing, hover(x, y) and leave() of a pointer that is not pressed, tap(x, y, slack) where
 * one is pressed and let go, with the pixels that its kind may miss by; and keys, a map from a key to what it does.
 */
function gestures(canvas, { turn, shift, zoom, keys, hover = () => {}, leave = () => {}, tap = () => {} }) {
  const fingers = new Map();
  let moved = 0;
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const spread = () => {
    const [p, q] = [...fingers.values()];
    return { x: (p.x + q.x) / 2, y: (p.y + q.y) / 2, apart: Math.hypot(p.x - q.x, p.y - q.y) || 1 };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    moved = fingers.size ? Infinity : 0;
    fingers.set(event.pointerId, place(event));
  });
  canvas.addEventListener("pointerup", (event) => {
    const { x, y } = place(event);
    if (fingers.delete(event.pointerId) && moved < 6) tap(x, y, event.pointerType === "touch" ? 14 : 7);
  });
  canvas.addEventListener("pointercancel", (event) => fingers.delete(event.pointerId));
  canvas.addEventListener("pointerleave", leave);
  canvas.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) {
      const { x, y } = place(event);
      hover(x, y);
      return;
    }
    const before = fingers.get(event.pointerId);
    const spreadBefore = fingers.size === 2 ? spread() : null;
    fingers.set(event.pointerId, place(event));
    const now = fingers.get(event.pointerId);
    moved += Math.hypot(now.x - before.x, now.y - before.y);
    if (spreadBefore) {
      const wide = spread();
      shift(wide.x - spreadBefore.x, wide.y - spreadBefore.y);
      zoom(wide.apart / spreadBefore.apart, wide.x, wide.y);
    } else if (fingers.size === 1) {
      const move = event.shiftKey || event.buttons & 6 ? shift : turn;
      move(now.x - before.x, now.y - before.y);
    }
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const { x, y } = place(event);
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 24 : 1;
    zoom(Math.exp(-event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.0016)), x, y);
  }, { passive: false });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrows = { ArrowLeft: [-30, 0], ArrowRight: [30, 0], ArrowUp: [0, -30], ArrowDown: [0, 30] };
    const { width, height } = canvas.getBoundingClientRect();
    if (event.key in arrows && event.shiftKey) shift(...arrows[event.key]);
    else if (event.key in keys) keys[event.key]();
    else if (event.key in arrows) turn(...arrows[event.key]);
    else if (event.key === "+" || event.key === "=") zoom(1.25, width / 2, height / 2);
    else if (event.key === "-") zoom(0.8, width / 2, height / 2);
    else return;
    event.preventDefault();
  });
}
