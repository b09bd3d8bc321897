// The flat pattern, mountains and valleys in their colours; what is chosen in it or in space is marked.

/** An element of a drawing, with attributes, and with styles that may name the page's colours. */
function drawn(tag, attributes, styles) {
  const made = document.createElementNS(byId("flat-pattern").namespaceURI, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  Object.assign(made.style, styles);
  return made;
}

class FlatPattern {
  /** `wishes`: hover(found), pick(found) with what is under a pointer, chosen() with what is chosen now. */
  constructor(svg, mesh, flat, looks, wishes) {
    Object.assign(this, { svg, mesh, flat, looks, wishes });
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let at = 0; at < flat.length; at += 3) {
      const [x, y] = [flat[at], -flat[at + 1]];
      [box[0], box[1]] = [Math.min(box[0], x), Math.min(box[1], y)];
      [box[2], box[3]] = [Math.max(box[2], x), Math.max(box[3], y)];
    }
    const margin = 0.03 * Math.max(box[2] - box[0], box[3] - box[1]);
    this.home = [box[0] - margin, box[1] - margin, box[2] - box[0] + 2 * margin, box[3] - box[1] + 2 * margin];
    const lines = looks.map(() => "");
    mesh.kinds.forEach((kind, edge) => { lines[kind] += this.line(edge); });
    this.paper = drawn("path", { d: Array.from(mesh.owners, (_, at) => this.triangle(at)).join("") }, { fill: "var(--paper)" });
    this.paths = lines.map((line, kind) => {
      const { colour, width } = looks[kind];
      const stroke = colour.startsWith("--") ? `var(${colour})` : colour;
      return drawn("path", { d: line, "stroke-width": 1.3 * width, "vector-effect": "non-scaling-stroke" }, { stroke, fill: "none" });
    });
    this.area = drawn("path", { class: "chosen-facet" }, { fill: "var(--chosen)", fillOpacity: 0.55 });
    this.halo = drawn("path", { class: "chosen-crease", "stroke-width": 4, "vector-effect": "non-scaling-stroke", "stroke-linecap": "round" }, { stroke: "var(--chosen)", fill: "none" });
    svg.append(this.paper, this.area, ...this.paths, this.halo);
    this.reset();
    gestures(svg, {
      turn: (dx, dy) => this.shift(dx, dy),
      shift: (dx, dy) => this.shift(dx, dy),
      zoom: (factor, x, y) => this.zoom(factor, x, y),
      hover: (x, y) => wishes.hover(this.pick(x, y, 7)),
      leave: () => wishes.hover(NONE),
      tap: (x, y, slack) => wishes.pick(this.pick(x, y, slack)),
      keys: {
        0: () => this.reset(),
        ArrowLeft: () => this.step(-1, 0),
        ArrowRight: () => this.step(1, 0),
        ArrowUp: () => this.step(0, 1),
        ArrowDown: () => this.step(0, -1),
        Enter: () => this.crease(),
      },
    });
  }

  spot(vertex) { return [this.flat[3 * vertex], -this.flat[3 * vertex + 1]]; }

  line(edge) {
    const [a, b] = [0, 1].map((end) => this.spot(this.mesh.edges[2 * edge + end]).map((mm) => mm.toFixed(2)).join(" "));
    return `M${a}L${b}`;
  }

  triangle(at) {
    return `M${[0, 1, 2].map((step) => this.spot(this.mesh.triangles[3 * at + step]).map((mm) => mm.toFixed(2)).join(" ")).join("L")}Z`;
  }

  show(shown) {
    this.paths.forEach((path, kind) => { path.style.display = (shown >> kind) & 1 ? "" : "none"; });
  }

  reset() {
    this.box = [...this.home];
    this.look();
  }

  look() { this.svg.setAttribute("viewBox", this.box.map((mm) => mm.toFixed(3)).join(" ")); }

  /** Millimetres to a pixel, and the point of the drawing's middle. */
  get scale() {
    const { width, height } = this.svg.getBoundingClientRect();
    return { mm: Math.max(this.box[2] / (width || 1), this.box[3] / (height || 1)), width, height };
  }

  /** A point of the element in mm, y downwards. */
  under(x, y) {
    const { mm, width, height } = this.scale;
    return [this.box[0] + this.box[2] / 2 + (x - width / 2) * mm, this.box[1] + this.box[3] / 2 + (y - height / 2) * mm];
  }

  shift(dx, dy) {
    const { mm } = this.scale;
    this.box[0] -= dx * mm;
    this.box[1] -= dy * mm;
    this.look();
  }

  zoom(factor, x, y) {
    const [cx, cy] = this.under(x, y);
    const part = Math.min(Math.max(1 / factor, (0.02 * this.home[2]) / this.box[2]), (2 * this.home[2]) / this.box[2]);
    this.box = [cx + (this.box[0] - cx) * part, cy + (this.box[1] - cy) * part, this.box[2] * part, this.box[3] * part];
    this.look();
  }

  /** The facet under a point, or its side within `slack` pixels. */
  pick(x, y, slack) {
    const [px, py] = this.under(x, y);
    const { triangles, owners, sides, edges } = this.mesh;
    const at = owners.findIndex((_, each) => {
      const [[ax, ay], [bx, by], [cx, cy]] = [0, 1, 2].map((step) => this.spot(triangles[3 * each + step]));
      const turns = [[ax, ay, bx, by], [bx, by, cx, cy], [cx, cy, ax, ay]].map(
        ([x0, y0, x1, y1]) => (x1 - x0) * (py - y0) - (y1 - y0) * (px - x0),
      );
      return turns.every((turn) => turn <= 0) || turns.every((turn) => turn >= 0);
    });
    const near = at < 0 ? edges.length / 2 : 0;
    const among = near ? Array.from({ length: near }, (_, edge) => edge) : sides[owners[at]];
    const found = nearestSide(among, (edge) => [0, 1].map((end) => this.spot(edges[2 * edge + end])), px, py);
    if (found.pixels <= slack * this.scale.mm) return { facet: -1, edge: found.edge };
    return at < 0 ? NONE : { facet: owners[at], edge: -1 };
  }

  middle(facet) {
    const corners = this.mesh.sides[facet].flatMap((edge) => [0, 1].map((end) => this.spot(this.mesh.edges[2 * edge + end])));
    return [0, 1].map((axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length);
  }

  /** From the chosen facet over a crease to the neighbour that lies most in a direction (x to the right, y up). */
  step(dx, dy) {
    const { facet, edge } = this.wishes.chosen();
    const from = facet >= 0 ? facet : edge >= 0 ? this.mesh.sidesOf[edge][0] : 0;
    if (facet < 0) {
      this.wishes.pick({ facet: from, edge: -1 });
      return;
    }
    const here = this.middle(from);
    let best = { facet: from, along: 1e-9 };
    for (const side of this.mesh.sides[from]) {
      for (const other of this.mesh.sidesOf[side]) {
        const there = this.middle(other);
        const [x, y] = [there[0] - here[0], here[1] - there[1]];
        const along = (x * dx + y * dy) / (Math.hypot(x, y) || 1);
        if (other !== from && along > best.along) best = { facet: other, along };
      }
    }
    this.wishes.pick({ facet: best.facet, edge: -1 });
  }

  /** From the chosen facet to its first side, from a side to the next one of the same facet. */
  crease() {
    const { facet, edge } = this.wishes.chosen();
    if (facet >= 0) this.around = facet;
    const sides = this.mesh.sides[this.around ?? 0];
    this.wishes.pick({ facet: -1, edge: sides[(sides.indexOf(edge) + 1) % sides.length] });
  }

  mark({ facet, edge }) {
    this.halo.setAttribute("d", edge < 0 ? "" : this.line(edge));
    const own = facet < 0 ? [] : [...this.mesh.owners.keys()].filter((at) => this.mesh.owners[at] === facet);
    this.area.setAttribute("d", own.map((at) => this.triangle(at)).join(""));
  }
}
