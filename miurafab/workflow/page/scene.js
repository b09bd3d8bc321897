// A sheet in space on a canvas: flat-shaded facets, creases, an eye that goes around it, and what
// lies under a pointer. It knows nothing of motions; whoever owns it gives it points to show.
//
//   const scene = new Scene(canvas, { antialias, keys, hover, leave, tap });  // the last are wishes of gestures (viewer.js)
//   scene.setMesh({ triangles, owners, edges, kinds });  // Uint32Array three a triangle; the facet of each
//                                                        // triangle; two vertices an edge; a Uint8 an edge
//   scene.kinds = [{ colour: "#d55e00", width: 1 }, …];  // for each kind; the width is a part of the thickest
//   scene.open(points);                                  // the eye opens on the side where these fill the view
//   scene.setPoints(points);                             // Float32Array, x y z a vertex, mm, z upwards
//   scene.setAmounts(amounts);                           // 0..1 a facet: colours of RAMP; null: of the two sides
//   scene.setLifts(lifts, along);                        // mm a facet, along a unit vector; scene.apart 0..1 of it
//   scene.setPlates(plates(mesh, flat, 3));              // facets as plates (plates.js); null: paper
//   scene.pick(x, y, slack);                             // { facet, edge } under a point of the canvas, -1: none
//   scene.mark({ facet, edge });                         // show one of them in another colour
//   scene.draw();                                        // after setting a property; the methods do it themselves

const THICKEST = 2.2;
const RAMP = ["#4575b4", "#abd9e9", "#ffffbf", "#fdae61", "#d73027"];
const NONE = { facet: -1, edge: -1 };
const EVERY = 0xff;
const HURRY = 33; // ms

class Scene {
  constructor(canvas, { keys = {}, antialias = true, ...wishes } = {}) {
    this.stage = new Stage(canvas, antialias, (gl) => this.paint(gl));
    const { gl } = this.stage;
    this.facet = compile(gl, FACET_VERTEX, FACET_FRAGMENT);
    this.crease = compile(gl, CREASE_VERTEX, CREASE_FRAGMENT);
    this.camera = null;
    this.apart = 0;
    this.along = [0, 0, 1];
    this.shown = EVERY;
    this.marked = NONE;
    this.strained = false;
    this.thickness = 0;
    this.flat = false; // looked at from above, as a drawing
    gestures(canvas, {
      turn: (dx, dy) => this.turn(dx, dy),
      shift: (dx, dy) => this.shift(dx, dy),
      zoom: (factor, x, y) => this.zoom(factor, x, y),
      keys: { 0: () => this.reset(), ...keys },
      ...wishes,
    });
  }

  draw() { this.stage.draw(); }

  /** A table of numbers for the shaders, 1024 rows of `width` numbers a line. */
  table(width, rows) {
    const { gl } = this.stage;
    const lines = Math.max(1, Math.ceil(rows / 1024));
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, width === 3 ? gl.RGB32F : gl.RG32F, 1024, lines);
    return { texture, width, lines, values: new Float32Array(1024 * lines * width) };
  }

  fill({ texture, width, lines, values }) {
    const { gl } = this.stage;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 1024, lines, width === 3 ? gl.RGB : gl.RG, gl.FLOAT, values);
  }

  setMesh({ triangles, owners, edges, kinds }) {
    this.free();
    Object.assign(this, { triangles, owners, edges, kindsOfEdges: kinds, ...neighbours(triangles, owners, edges) });
    this.points = new Float32Array(0);
    const vertices = edges.reduce((most, vertex) => Math.max(most, vertex), triangles.reduce((a, b) => Math.max(a, b), 0)) + 1;
    this.table3 = this.table(3, vertices);
    this.table2 = this.table(2, this.facets);
    this.fill(this.table2);
    this.paper = this.corners(triangles.length, (at) => {
      const first = at - (at % 3);
      return [triangles[at], triangles[first + ((at + 1) % 3)], triangles[first + ((at + 2) % 3)]];
    }, (at) => owners[Math.floor(at / 3)]);
    const whole = Array.from(kinds, (kind, edge) => [edges[2 * edge], edges[2 * edge + 1], 0, kind]);
    this.whole = this.lines(whole);
    const sides = this.sides.flatMap((own, facet) => own.map((edge) => (
      [edges[2 * edge], edges[2 * edge + 1], facet, kinds[edge]]
    )));
    this.parted = this.lines(sides);
  }

  /** Corners of triangles: three vertices each, the facet, and of plates where and how they stand. */
  corners(count, vertices, owner, plates = null) {
    const { gl } = this.stage;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const fill = (name, data, size, whole) => {
      const at = this.facet.attribute(name);
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(at);
      if (whole) gl.vertexAttribIPointer(at, size, gl.UNSIGNED_INT, 0, 0);
      else gl.vertexAttribPointer(at, size, gl.FLOAT, false, 0, 0);
      return buffer;
    };
    const all = Uint32Array.from({ length: 3 * count }, (_, at) => vertices((at - (at % 3)) / 3)[at % 3]);
    const buffers = [
      fill("corners", all, 3, true),
      fill("owner", Uint32Array.from({ length: count }, (_, at) => owner(at)), 1, true),
      ...(plates ? [fill("local", plates.local, 3, false), fill("facing", plates.facing, 3, false)] : []),
    ];
    gl.bindVertexArray(null);
    return { array, count, buffers };
  }

  /** Lines [first vertex, last vertex, facet, kind], four vertices each (see LINE_VERTEX). */
  lines(list) {
    const { gl } = this.stage;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const ends = new Uint32Array(12 * list.length);
    const kinds = new Uint8Array(4 * list.length);
    const order = new Uint32Array(8 * list.length); // two triangles a line, and after all of them a line a line
    list.forEach(([first, last, facet, kind], at) => {
      for (let corner = 0; corner < 4; corner += 1) ends.set([first, last, facet], 12 * at + 3 * corner);
      kinds.fill(kind, 4 * at, 4 * at + 4);
      order.set([0, 1, 2, 2, 1, 3].map((corner) => 4 * at + corner), 6 * at);
      order.set([4 * at, 4 * at + 1], 6 * list.length + 2 * at);
    });
    const buffers = [gl.createBuffer(), gl.createBuffer(), gl.createBuffer()];
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, ends, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(this.crease.attribute("ends"));
    gl.vertexAttribIPointer(this.crease.attribute("ends"), 3, gl.UNSIGNED_INT, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[1]);
    gl.bufferData(gl.ARRAY_BUFFER, kinds, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(this.crease.attribute("kind"));
    gl.vertexAttribPointer(this.crease.attribute("kind"), 1, gl.UNSIGNED_BYTE, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[2]);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, order, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { array, count: list.length, buffers };
  }

  free(parts = [this.paper, this.whole, this.parted, this.plates, this.halo]) {
    const { gl } = this.stage;
    for (const part of parts.filter(Boolean)) {
      gl.deleteVertexArray(part.array);
      part.buffers.forEach((buffer) => gl.deleteBuffer(buffer));
    }
    if (parts.length > 1 && this.table3) [this.table3, this.table2].forEach(({ texture }) => gl.deleteTexture(texture));
  }

  setPoints(points) {
    this.points = points;
    this.table3.values.set(points);
    this.fill(this.table3);
    this.draw();
  }

  setAmounts(amounts) {
    this.strained = amounts !== null;
    if (amounts) for (let facet = 0; facet < this.facets; facet += 1) this.table2.values[2 * facet] = amounts[facet];
    this.fill(this.table2);
    this.draw();
  }

  setLifts(lifts, along) {
    this.along = along;
    this.lifts = lifts;
    for (let facet = 0; facet < this.facets; facet += 1) this.table2.values[2 * facet + 1] = lifts[facet];
    this.fill(this.table2);
  }

  mark({ facet, edge }) {
    if (facet === this.marked.facet && edge === this.marked.edge) return;
    this.marked = { facet, edge };
    const edges = edge >= 0 ? [edge] : facet >= 0 ? this.sides[facet] : [];
    this.free([this.halo]);
    const owner = (each) => (facet >= 0 ? facet : this.sidesOf[each][0] ?? 0);
    this.halo = edges.length
      ? this.lines(edges.map((each) => [this.edges[2 * each], this.edges[2 * each + 1], owner(each), 0])) : null;
    this.draw();
  }

  /** Facets as the plates of :func:`plates`, or as paper again (null). */
  setPlates(plates) {
    this.free([this.plates]);
    this.plates = plates && this.corners(
      plates.owners.length, (at) => plates.corners[at], (at) => plates.owners[at], plates,
    );
    this.draw();
  }

  get aspect() { return this.stage.width / Math.max(this.stage.height, 1); }

  /** Open on the side of `points` that fills the view best: somewhat from above, z upwards. */
  open(points, flat = false) {
    this.flat = flat;
    this.first = points;
    this.camera = { yaw: 0, pitch: Math.PI / 2, x: 0, y: 0, near: 1 };
    this.opened = false;
    this.draw();
  }

  /** Choose the side once the size of the canvas is known. */
  choose() {
    this.opened = true;
    if (this.flat) return;
    const every = Math.max(1, Math.floor(this.first.length / 3 / 1500));
    let best = -Infinity;
    for (const pitch of [0.5, 0.66, 0.82]) {
      for (let step = 0; step < 16; step += 1) {
        // the first ones are near the usual view, from the front and a little from the right
        const yaw = -0.6 + (step % 2 ? 1 : -1) * Math.ceil(step / 2) * (Math.PI / 8);
        const { fill } = framed(this.first, axes({ yaw, pitch }), this.aspect, every);
        const score = fill * (1 - 0.01 * step);
        if (score > best) [best, this.camera.yaw, this.camera.pitch] = [score, yaw, pitch];
      }
    }
    this.largest = framed(this.first, axes(this.camera), this.aspect, every).distance;
  }

  reset() { this.open(this.first, this.flat); }

  turn(dx, dy) {
    const { camera } = this;
    camera.yaw -= dx * 0.008;
    camera.pitch = Math.min(Math.max(camera.pitch + dy * 0.008, -Math.PI / 2), Math.PI / 2);
    this.draw();
  }

  get pixel() { return (2 * this.distance * FIELD) / this.stage.height; } // mm

  shift(dx, dy) {
    this.camera.x += dx * this.pixel;
    this.camera.y -= dy * this.pixel;
    this.draw();
  }

  /** Come nearer to what is under a point of the canvas. */
  zoom(factor, x, y) {
    const { camera } = this;
    const near = Math.min(Math.max(camera.near / factor, 0.02), 6);
    const mm = this.pixel * (1 - near / camera.near);
    camera.x -= (x - this.stage.width / 2) * mm;
    camera.y += (y - this.stage.height / 2) * mm;
    camera.near = near;
    this.draw();
  }

  /** The points, and where layers that stand apart are lifted to. */
  reached() {
    if (!(this.apart > 0.02)) return this.points;
    const all = new Float32Array(2 * this.points.length);
    const [low, high] = [Math.min(...this.lifts), Math.max(...this.lifts)];
    this.points.forEach((value, at) => {
      all[at] = value + this.apart * low * this.along[at % 3];
      all[at + this.points.length] = value + this.apart * high * this.along[at % 3];
    });
    return all;
  }

  /** World to clip space, column by column, and the eye in the world. */
  look() {
    if (!this.opened) this.choose();
    const sides = axes(this.camera);
    const home = framed(this.reached(), sides, this.aspect);
    const middle = home.middle;
    // as near as the frame allows, but so that a sheet that closes is still seen to become smaller
    this.full = Math.max(home.distance, this.flat ? 0 : 0.45 * (this.largest ?? 0));
    this.distance = this.full * this.camera.near;
    const { x, y } = this.camera;
    const rows = [sides.right, sides.up, sides.out];
    const moved = [x - dot(rows[0], middle), y - dot(rows[1], middle), -this.distance - dot(rows[2], middle)];
    const far = this.distance + 1.05 * home.radius;
    const near = Math.max(this.distance - 1.05 * home.radius, far / 400);
    const scale = [1 / FIELD / this.aspect, 1 / FIELD];
    const [c, d] = [-(far + near) / (far - near), (-2 * far * near) / (far - near)];
    const clip = (vx, vy, vz, vw) => [scale[0] * vx, scale[1] * vy, c * vz + d * vw, -vz];
    this.rows = rows;
    this.moved = moved;
    this.eye = [0, 1, 2].map((axis) => -rows.reduce((sum, row, at) => sum + row[axis] * moved[at], 0));
    return [0, 1, 2].flatMap((axis) => clip(rows[0][axis], rows[1][axis], rows[2][axis], 0)).concat(clip(...moved, 1));
  }

  paint(gl) {
    gl.clearColor(...rgb("--view"), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!this.points.length) return;
    const camera = this.look();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.table3.texture);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.table2.texture);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    this.paintFacets(gl, camera);
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    const thick = Math.min(Math.max((0.09 * this.edgeLength) / this.pixel, 0.45), THICKEST);
    this.paintLines(gl, this.apart ? this.parted : this.whole, camera, this.kinds, thick, { sketched: this.hurried() });
    if (this.halo) {
      const chosen = [{ colour: "--chosen", width: 1 }];
      gl.disable(gl.DEPTH_TEST);
      this.paintLines(gl, this.halo, camera, chosen, 4, { strength: 0.5 });
      gl.enable(gl.DEPTH_TEST);
      this.paintLines(gl, this.halo, camera, chosen, 4);
    }
    gl.depthMask(true);
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Whether frames follow each other more slowly than thirty a second; once at rest, one is drawn well. */
  hurried() {
    clearTimeout(this.resting);
    this.sketching ||= this.stage.pace > HURRY;
    if (this.sketching) {
      this.resting = setTimeout(() => {
        this.sketching = false;
        this.draw();
      }, 200);
    }
    return this.sketching;
  }

  paintFacets(gl, camera) {
    const { program, uniform } = this.facet;
    const part = this.plates ?? this.paper;
    gl.useProgram(program);
    gl.uniform1i(uniform.points, 0);
    gl.uniform1i(uniform.traits, 1);
    gl.uniformMatrix4fv(uniform.camera, false, camera);
    gl.uniformMatrix3fv(uniform.turned, false, [0, 1, 2].flatMap((axis) => this.rows.map((row) => row[axis])));
    gl.uniform3fv(uniform.eye, this.eye);
    gl.uniform3fv(uniform.along, this.along);
    gl.uniform1f(uniform.apart, this.apart);
    for (const [name, colour] of [["front", "--side-a"], ["back", "--side-b"], ["wall", "--side-c"], ["chosen", "--chosen"]]) {
      gl.uniform3fv(uniform[name], rgb(colour));
    }
    gl.uniform3fv(uniform.ramp, RAMP.flatMap(rgb));
    gl.uniform1i(uniform.strained, this.strained);
    gl.uniform1i(uniform.solid, Boolean(this.plates));
    gl.uniform1i(uniform.marked, this.marked.facet);
    gl.bindVertexArray(part.array);
    gl.vertexAttrib3f(this.facet.attribute("local"), 0, 0, 0);
    gl.vertexAttrib3f(this.facet.attribute("facing"), 0, 0, 1);
    gl.drawArrays(gl.TRIANGLES, 0, part.count);
    gl.bindVertexArray(null);
  }

  paintLines(gl, lines, camera, kinds, pixels, { strength = 1, sketched = false } = {}) {
    const { program, uniform } = this.crease;
    gl.useProgram(program);
    gl.uniform1i(uniform.points, 0);
    gl.uniform1i(uniform.traits, 1);
    gl.uniformMatrix4fv(uniform.camera, false, camera);
    gl.uniform3fv(uniform.along, this.along);
    gl.uniform1f(uniform.apart, this.apart);
    gl.uniform2f(uniform.size, this.stage.canvas.width, this.stage.canvas.height);
    gl.uniform1f(uniform.nearer, 4e-4);
    gl.uniform1f(uniform.strength, strength);
    gl.uniform1i(uniform.shown, lines === this.halo ? EVERY : this.shown);
    gl.uniform3fv(uniform.colours, kinds.flatMap(({ colour }) => rgb(colour)));
    gl.uniform1fv(uniform.widths, kinds.map(({ width }) => width * pixels * this.stage.ratio));
    gl.bindVertexArray(lines.array);
    gl.uniform1i(uniform.sketched, sketched);
    if (sketched) gl.drawElements(gl.LINES, 2 * lines.count, gl.UNSIGNED_INT, 24 * lines.count);
    else gl.drawElements(gl.TRIANGLES, 6 * lines.count, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
  }

  /** A vertex of a facet in space, with the facet's lift. */
  corner(vertex, facet) {
    const point = at3(this.points, vertex);
    if (!this.apart) return point;
    return point.map((value, axis) => value + this.apart * this.lifts[facet] * this.along[axis]);
  }

  /** The front facet under a point of the canvas, and its side within `slack` pixels; -1: none. */
  pick(x, y, slack) {
    if (!this.points.length) return NONE;
    this.look();
    const { width, height } = this.stage;
    const screen = [((2 * x) / width - 1) * FIELD * this.aspect, (1 - (2 * y) / height) * FIELD, -1];
    const ray = [0, 1, 2].map((axis) => this.rows.reduce((sum, row, at) => sum + row[axis] * screen[at], 0));
    let [nearest, facet] = [Infinity, -1];
    for (let at = 0; at < this.triangles.length; at += 3) {
      const owner = this.owners[at / 3];
      const [p, q, r] = [0, 1, 2].map((step) => this.corner(this.triangles[at + step], owner));
      const far = hit(this.eye, ray, p, minus(q, p), minus(r, p));
      if (far < nearest) [nearest, facet] = [far, owner];
    }
    if (facet < 0) return NONE;
    const seen = (point) => {
      const [a, b, c] = this.rows.map((row, at) => dot(row, point) + this.moved[at]);
      return [(width / 2) * (1 - a / c / FIELD / this.aspect), (height / 2) * (1 + b / c / FIELD)];
    };
    const near = nearestSide(this.sides[facet], (edge) => [0, 1].map((end) => seen(this.corner(this.edges[2 * edge + end], facet))), x, y);
    return near.pixels <= slack ? { facet: -1, edge: near.edge } : { facet, edge: -1 };
  }
}
