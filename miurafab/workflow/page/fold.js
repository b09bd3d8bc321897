// The pattern as it folds: one slider from flat to folded flat and on to its layers apart, the scene in space, the flat
// pattern and a curve beside it. A crease or a facet that is pointed at in one picture is marked in both, with its figures.

// Widths are parts of the thickest line.
const CREASES = {
  M: { name: "Mountain", colour: "--mountain", width: 1 },
  V: { name: "Valley", colour: "--valley", width: 1 },
  B: { name: "Border", colour: "--crease-border", width: 0.8 },
  F: { name: "Flat", colour: "--crease-flat", width: 0.55 },
  U: { name: "Unassigned", colour: "--crease-flat", width: 0.55 },
  C: { name: "Cut", colour: "--cut", width: 0.8 },
  J: { name: "Join", colour: "--crease-flat", width: 0.55 },
  S: { name: "Seam", colour: "--seam", width: 1 },
};
const ONE_WAY = 4500; // ms of a motion that plays, from one end to the other
const REST = 700;
const STILLS = 8; // pictures of a motion that plays for somebody who wants no motion
const APART = 10; // steps of the slider after the last frame, in which the layers part
const SMOOTHED = 4000; // edges; without a graphics card more of them are drawn too slowly
const HALF_TURN = 16383; // of a fold angle

const still = matchMedia("(prefers-reduced-motion: reduce)");

class FoldView {
  constructor(fold) {
    this.fold = fold;
    const kinds = decode(fold.kinds, Uint8Array);
    this.mesh = {
      triangles: decode(fold.triangles, Uint32Array), owners: decode(fold.owners, Uint32Array),
      edges: decode(fold.edges, Uint32Array), kinds,
    };
    this.scene = new Scene(byId("fold-canvas"), {
      antialias: kinds.length < SMOOTHED,
      keys: { " ": () => this.play(!this.playing) },
      hover: (x, y) => this.hover(this.playing ? NONE : this.scene.pick(x, y, 7)),
      leave: () => this.hover(NONE),
      tap: (x, y, slack) => this.pick(this.scene.pick(x, y, slack)),
    });
    this.scene.setMesh(this.mesh);
    this.mesh = { ...this.mesh, facets: this.scene.facets, sides: this.scene.sides, sidesOf: this.scene.sidesOf };
    this.looks = fold.assignments.map((letter) => CREASES[letter]);
    this.scene.kinds = this.looks;
    this.scene.edgeLength = fold.lengths.reduce((sum, length) => sum + length, 0) / kinds.length;
    this.forms = fold.forms.map((form) => ({
      ...form,
      coordinates: this.unpack(form),
      angles: form.angles && decode(form.angles, Int16Array),
    }));
    const flat = this.forms.find((form) => form.flat).coordinates;
    this.flat = flat;
    this.strains = fold.strain && decode(fold.strain.values, Uint16Array);
    if (fold.layers) this.scene.setLifts(decode(fold.layers.shifts, Float32Array), fold.layers.along);
    this.hovered = NONE;
    this.pinned = NONE;
    this.pattern = new FlatPattern(byId("flat-pattern"), this.mesh, flat, this.looks, {
      hover: (found) => this.hover(found), pick: (found) => this.pick(found), chosen: () => this.pinned,
    });
    this.chart = new Chart(byId("curve"), (frame) => {
      this.play(false);
      this.show(frame);
    });
    byId("fold-heading").textContent = fold.word;
    byId("motion-word").textContent = fold.word;
    this.legend();
    this.listen();
    this.thick();
    byId("fold").hidden = false;
    this.playing = false;
    this.choose(Math.min(fold.first, this.forms.length - 1));
  }

  listen() {
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
    byId("by-strain").addEventListener("change", () => this.show(this.frame));
    byId("by-strain").checked = Boolean(this.fold.strain && this.fold.strain.shown);
    byId("fold-fit").addEventListener("click", () => {
      this.scene.reset();
      this.pattern.reset();
    });
    byId("fold-full").hidden = !document.fullscreenEnabled;
    byId("fold-full").addEventListener("click", () => (
      document.fullscreenElement ? document.exitFullscreen() : byId("fold").requestFullscreen()
    ));
    document.addEventListener("fullscreenchange", () => {
      byId("fold-full").textContent = document.fullscreenElement ? "Leave full screen" : "Full screen";
    });
    const look = () => {
      const count = byId("look-kind").value === "edge" ? this.mesh.edges.length / 2 : this.mesh.facets;
      byId("look-number").max = count - 1;
      const number = Number(byId("look-number").value);
      const right = byId("look-number").value !== "" && number in Array.from({ length: count });
      this.pick(right ? { ...NONE, [byId("look-kind").value]: number } : NONE, false);
    };
    byId("look-kind").addEventListener("change", look);
    byId("look-number").addEventListener("input", look);
    byId("fold").addEventListener("keydown", ({ key, target }) => { // Escape would abort a machine, in the studio
      if (key === "Delete" && target.tagName !== "INPUT") this.pick(NONE);
    });
    byId("thickness").addEventListener("input", () => this.solid());
  }

  /** (frames x vertices x 3) coordinates in mm about the middle of the form. */
  unpack({ points, box: [, , , sx, sy, sz] }) {
    const packed = decode(points, Uint16Array);
    const span = [sx, sy, sz];
    return Float32Array.from(packed, (value, at) => (value / 65535 - 0.5) * span[at % 3]);
  }

  legend() {
    const entries = this.fold.assignments.map((letter, kind) => ({
      kind, name: CREASES[letter].name, colour: CREASES[letter].colour, note: lengthText(this.fold.lengths[kind]),
    }));
    const shown = legend(byId("creases"), entries, () => {
      this.scene.shown = shown();
      this.pattern.show(shown());
      this.scene.draw();
    });
    if (this.fold.strain) {
      byId("strain-most").textContent = `strain 0 to ${this.fold.strain.most.toExponential(1)}`;
      byId("strain-ramp").style.background = `linear-gradient(to right, ${RAMP.join(", ")})`;
    }
    for (const [name, colour] of [["Front", "--side-a"], ["Back", "--side-b"]]) {
      const swatch = element("span", { className: "swatch area" });
      swatch.style.background = `var(${colour})`;
      byId("creases").append(element("span", {}, swatch, name));
    }
  }

  /** What thickness the facets can be drawn with: as panels that still fold, or a little for paper. */
  thick() {
    const angles = this.forms.find((form) => form.frames === 1 && form.angles)?.angles;
    const edges = this.mesh.edges.length / 2;
    this.loops = outlines(this.mesh);
    const moves = (turns) => tapers(this.loops, this.mesh, this.flat, turns);
    this.moves = moves(Array.from({ length: edges }, (_, edge) => (angles ? (angles[edge] / HALF_TURN) * Math.PI : 0)));
    const most = 0.95 * thickest(this.moves);
    const paper = 0.3 * this.scene.edgeLength;
    this.panels = Boolean(this.fold.rigid && angles) && most > 0.02 * paper;
    if (!this.panels) this.moves = moves(new Float32Array(edges));
    const limit = this.panels ? Math.min(most, paper) : paper;
    const step = 10 ** Math.floor(Math.log10(limit / 20));
    byId("thickness").max = (step * Math.floor(limit / step)).toPrecision(3);
    byId("thickness").step = step;
    byId("thickness").value = this.fold.thickness;
    this.solid();
  }

  solid() {
    const mm = Number(byId("thickness").value);
    this.scene.setPlates(mm ? plates(this.mesh, this.loops, this.moves, this.flat, mm) : null);
    const text = !mm ? "paper" : `${Number(mm.toPrecision(3))} mm${this.panels ? ", cut back at creases" : ""}`;
    byId("thickness-note").value = text;
    byId("thickness").setAttribute("aria-valuetext", text);
    if (this.form) this.show(this.frame);
  }

  get last() { return this.form.frames - 1; }

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
    byId("curve-figure").hidden = !moves;
    byId("strain-key").hidden = !moves || !this.strains;
    if (moves) {
      byId("motion").max = this.last + (this.fold.layers ? APART : 0);
      byId("motion").value = this.fold.start;
    }
    const first = moves ? this.fold.start : 0;
    this.scene.open(this.points(first).slice(), this.form.flat);
    this.show(first);
    this.curve();
  }

  /** There and back again, with a rest at either end, until it is stopped; in a few stills, once, without motion. */
  play(wanted) {
    if (wanted === this.playing || (wanted && this.form.frames < 2)) return;
    this.playing = wanted;
    byId("fold-play").textContent = wanted ? "Pause" : "Play";
    byId("fold-play").setAttribute("aria-pressed", wanted);
    if (!wanted) return;
    this.hover(NONE);
    const end = Number(byId("motion").max);
    const from = this.frame < end ? this.frame / end : 0;
    const begin = performance.now() - from * ONE_WAY - REST;
    const tick = (moment) => {
      if (!this.playing) return;
      const round = Math.max(moment - begin, 0) % (2 * (ONE_WAY + REST));
      const back = round > ONE_WAY + REST;
      const part = Math.min(Math.max(((back ? round - ONE_WAY - REST : round) - REST) / ONE_WAY, 0), 1);
      this.show((back ? 1 - part : part) * end);
      requestAnimationFrame(tick);
    };
    const step = (number) => {
      if (!this.playing) return;
      this.show(Math.round((end * number) / STILLS));
      if (number < STILLS) setTimeout(() => step(number + 1), 1000);
      else this.play(false);
    };
    if (still.matches) step(Math.floor(from * STILLS + 1e-9));
    else requestAnimationFrame(tick);
  }

  /** Two frames around a moment, and the part of the second. */
  between(frame) {
    const low = Math.min(Math.floor(frame), this.last);
    return [low, Math.min(low + 1, this.last), Math.min(frame, this.last) - low];
  }

  /** The coordinates at `frame`, between two frames blended. */
  points(frame) {
    const count = this.form.coordinates.length / this.form.frames;
    const [low, high, part] = this.between(frame);
    const before = this.form.coordinates.subarray(low * count, (low + 1) * count);
    if (part === 0) return before;
    const after = this.form.coordinates.subarray(high * count, (high + 1) * count);
    this.blend ??= new Float32Array(count);
    for (let at = 0; at < count; at += 1) this.blend[at] = before[at] + part * (after[at] - before[at]);
    return this.blend;
  }

  /** A number of a list of so many a frame, at a moment. */
  blended(list, count, at, frame) {
    const [low, high, part] = this.between(frame);
    return list[low * count + at] + part * (list[high * count + at] - list[low * count + at]);
  }

  /** Put a moment of the form on the stage; after the last frame the layers part. */
  show(frame) {
    this.frame = frame;
    const moves = this.form.frames > 1;
    const whole = Math.min(Math.round(frame), this.last);
    const stacked = Boolean(this.fold.layers) && moves && frame >= this.last;
    const thickness = Number(byId("thickness").value);
    this.scene.apart = 0;
    if (stacked) {
      const { closed, height, levels } = this.fold.layers;
      const part = (frame - this.last) / APART;
      this.scene.apart = Math.max(closed, part, (thickness * (levels - 1)) / height);
      this.gap = (this.scene.apart * height) / Math.max(levels - 1, 1);
      if (part < closed && !thickness) this.gap = 0;
    }
    this.scene.setPoints(this.points(frame));
    const strained = Boolean(this.strains) && moves && byId("by-strain").checked;
    if (strained) this.scene.setAmounts(Float32Array.from(this.strains.subarray(whole * this.mesh.facets, (whole + 1) * this.mesh.facets), (value) => value / 65535));
    else if (this.scene.strained) this.scene.setAmounts(null);
    byId("fold-size").value = this.size(stacked);
    if (moves) {
      if (Number(byId("motion").value) !== Math.round(frame)) byId("motion").value = Math.round(frame);
      const name = this.fold.names[whole];
      const apart = stacked && this.gap ? `, layers ${this.gap < 1 ? Number(this.gap.toPrecision(2)) : this.gap.toFixed(1)} mm apart` : "";
      const text = `${whole + 1} of ${this.form.frames}${name ? `, ${name}` : ""}${apart}`;
      byId("motion-frame").value = text;
      byId("motion").setAttribute("aria-valuetext", text);
      this.chart.at(frame);
    }
    this.tell();
  }

  /** The sides of the box around what is shown; of a sheet that is folded flat, those in its plane. */
  size(stacked) {
    const points = this.scene.points;
    if (stacked) this.plane ??= plane(this.fold.layers.along, points);
    const rows = stacked ? this.plane : [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    const sides = extents(points, this.form.flat ? rows.slice(0, 2) : rows);
    return `${sides.map((mm) => mm.toFixed(mm >= 100 ? 0 : 1)).join(" × ")} mm`;
  }

  hover(found) {
    this.hovered = found;
    this.mark();
  }

  /** Keep something chosen, so that its figures stay while the slider moves. */
  pick(found, told = true) {
    this.pinned = found;
    this.hovered = NONE;
    const kind = found.edge >= 0 ? "edge" : found.facet >= 0 ? "facet" : null;
    if (told) {
      if (kind) byId("look-kind").value = kind;
      byId("look-number").value = kind ? found[kind] : "";
    }
    this.mark();
    byId("fold-said").textContent = kind ? this.figures(found) : "Nothing is chosen.";
  }

  get chosen() { return this.hovered.facet >= 0 || this.hovered.edge >= 0 ? this.hovered : this.pinned; }

  mark() {
    const { chosen } = this;
    if (this.seen && chosen.facet === this.seen.facet && chosen.edge === this.seen.edge) return;
    this.seen = chosen;
    this.scene.mark(chosen);
    this.pattern.mark(chosen);
    this.curve();
    this.tell();
  }

  tell() {
    const text = this.figures(this.chosen);
    if (byId("figures").textContent !== text) byId("figures").textContent = text;
  }

  /** By how much an edge is folded at a moment, degrees, to the side of its letter; null at a border. */
  angle(edge, frame = this.frame) {
    if (this.mesh.sidesOf[edge].length < 2 || !(this.form.angles || this.form.flat)) return null;
    if (this.form.flat) return 0;
    const side = this.fold.assignments[this.mesh.kinds[edge]] === "M" ? -180 : 180;
    return (this.blended(this.form.angles, this.mesh.edges.length / 2, edge, frame) / HALF_TURN) * side || 0;
  }

  figures({ facet, edge }) {
    if (edge >= 0) {
      const [a, b] = [0, 1].map((end) => at3(this.flat, this.mesh.edges[2 * edge + end]));
      const angle = this.angle(edge);
      const folded = angle === null ? "" : `, folded by ${angle.toFixed(1)}° now`;
      const what = this.mesh.sidesOf[edge].length > 1 ? "Crease" : "Edge";
      return `${what} ${edge}: ${this.looks[this.mesh.kinds[edge]].name.toLowerCase()}, ${Math.hypot(...minus(a, b)).toFixed(1)} mm long${folded}`;
    }
    if (facet < 0) return "Point at a crease or a facet in either picture.";
    const moves = this.form.frames > 1 && this.strains;
    const strain = moves ? (this.blended(this.strains, this.mesh.facets, facet, this.frame) / 65535) * this.fold.strain.most : 0;
    const bent = moves ? `, strain ${strain.toExponential(1)} now` : this.fold.rigid ? ", stays flat" : "";
    return `Facet ${facet}: ${this.loops[facet].length} sides, ${this.area(facet).toPrecision(4)} mm²${bent}`;
  }

  area(facet) {
    return this.loops[facet].reduce((sum, vertex, at, loop) => {
      const next = loop[(at + 1) % loop.length];
      return sum + (this.flat[3 * vertex] * this.flat[3 * next + 1] - this.flat[3 * next] * this.flat[3 * vertex + 1]) / 2;
    }, 0);
  }

  /** The median of the fold angles in a frame, degrees. */
  median(frame) {
    const angles = [];
    this.mesh.kinds.forEach((kind, edge) => {
      if ("MV".includes(this.fold.assignments[kind])) angles.push(Math.abs(this.angle(edge, frame) ?? 0));
    });
    return angles.sort((a, b) => a - b)[angles.length >> 1] ?? 0;
  }

  /** The curve: the fold angle of what is chosen, or else the energy (or force), or else the median fold angle. */
  curve() {
    const { frames } = this.form;
    if (frames < 2) return;
    const every = Array.from({ length: frames }, (_, at) => at);
    const { edge } = this.chosen;
    const { curve } = this.fold;
    const note = byId("curve-note");
    if (edge >= 0 && this.angle(edge, 0) !== null) {
      const values = every.map((at) => this.angle(edge, at));
      note.textContent = `Fold angle of crease ${edge}`;
      this.chart.show({ values, places: every, top: `${peak(values).toFixed(0)}°`, bottom: "", colour: this.looks[this.mesh.kinds[edge]].colour });
    } else if (curve) {
      note.textContent = curve.title;
      this.chart.show({ values: curve.values, places: curve.places ?? every, top: curve.top, bottom: curve.bottom });
    } else {
      this.medians ??= every.map((at) => this.median(at));
      const values = this.medians;
      note.textContent = "Median fold angle; the facets stay flat, which takes no energy";
      this.chart.show({ values, places: every, top: `${peak(values).toFixed(0)}°`, bottom: "" });
    }
    this.chart.at(this.frame);
  }
}

const peak = (values) => values.reduce((most, value) => (Math.abs(value) > Math.abs(most) ? value : most), 0);
