// A sheet is every move of its job in order, drawn up to a moment that a slider or a clock chooses.

const CLICK_PX = 4; // a pointer that moves farther drags
const NEAR_PX = 7; // from the edge that a tab is joined to

class SheetView {
  constructor(sheets, layers, tabs) {
    this.sheets = sheets;
    this.layers = layers;
    this.tabs = tabs.filter(({ sheet }) => this.find(sheet) >= 0);
    this.tab = null;
    this.stage = new Stage(byId("sheet-canvas"), false, (gl) => this.paint(gl));
    this.kinds = layers.map((layer) => ({ colour: layer.colour, width: layer.travel ? 1.1 : 1.8, dashed: layer.travel }));
    this.playing = false;
    this.fitted = true;
    for (const [at, sheet] of sheets.entries()) {
      byId("sheet-choice").append(element("option", { value: at, textContent: sheet.name }));
    }
    byId("sheet-choice").addEventListener("change", (event) => this.choose(Number(event.target.value)));
    byId("sheet-before").addEventListener("click", () => this.choose(this.index - 1));
    byId("sheet-after").addEventListener("click", () => this.choose(this.index + 1));
    byId("sheet-fit").addEventListener("click", () => this.fit());
    byId("play").addEventListener("click", () => this.play(!this.playing));
    byId("time").addEventListener("input", (event) => {
      this.play(false);
      this.seek((event.target.value / 1000) * this.sheet.seconds);
    });
    for (const speed of [1, 10, 60, 300]) {
      byId("speed").append(element("option", { value: speed, textContent: `${speed}×` }));
    }
    const canvas = this.stage.canvas;
    gestures(canvas, {
      turn: (dx, dy) => this.shift(dx, dy),
      shift: (dx, dy) => this.shift(dx, dy),
      zoom: (factor, x, y) => this.zoom(factor, x, y),
      keys: {
        0: () => this.fit(), " ": () => this.play(!this.playing),
        t: () => this.step(1), T: () => this.step(-1), m: () => this.toMate(),
      },
    });
    this.offerTabs();
    canvas.addEventListener("pointermove", (event) => this.say(event));
    canvas.addEventListener("pointerleave", () => { byId("sheet-cursor").value = ""; });
    byId("sheets").hidden = false;
    this.choose(0);
  }

  find(name) {
    return this.sheets.findIndex((sheet) => sheet.name === name);
  }

  // Tabs and their mates

  offerTabs() {
    byId("tabs-bar").hidden = this.tabs.length === 0;
    byId("tab-choice").append(...this.tabs.map((tab, at) => element("option", {
      value: at, textContent: `${tab.label}: ${tab.patch}${tab.matePatch ? ` to ${tab.matePatch}` : ", open border"}`,
    })));
    byId("tab-choice").addEventListener("change", ({ target }) => this.pick(this.tabs[target.value] ?? null, true));
    byId("tab-mate").addEventListener("click", () => this.toMate());
    const { canvas } = this.stage;
    let down = null;
    canvas.addEventListener("pointerdown", ({ clientX, clientY }) => { down = [clientX, clientY]; });
    canvas.addEventListener("pointerup", (event) => {
      const still = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) <= CLICK_PX;
      down = null;
      if (still && event.button === 0) this.pick(this.tabAt(...this.place(event)));
    });
  }

  /** The tab at a place of this sheet: under it, or the one whose mate's edge is nearest. */
  tabAt(x, y) {
    const { name } = this.sheet;
    const under = this.tabs.find(({ sheet, polygon }) => sheet === name && holds(polygon, x, y));
    if (under) return under;
    const near = this.tabs.filter(({ mate, mateSheet }) => mate && mateSheet === name)
      .map((tab) => [fromSegment(tab.mate, x, y) * this.scale, tab])
      .filter(([pixels]) => pixels <= NEAR_PX).sort(([a], [b]) => a - b);
    return near[0]?.[1] ?? null;
  }

  /** Mark a tab and its mate, or none; `go` shows the sheet that it is on. */
  pick(tab, go = false) {
    this.tab = tab;
    byId("tab-choice").value = tab ? this.tabs.indexOf(tab) : "";
    byId("tab-mate").disabled = !tab?.mate || this.find(tab.mateSheet) < 0;
    const where = (sheet) => (sheet === this.sheet.name ? "on this sheet" : `on ${sheet}`);
    byId("tab-said").value = !tab ? "" : `Tab ${tab.label} of patch ${tab.patch}, ${where(tab.sheet)}${
      tab.mate ? `, is joined to patch ${tab.matePatch}, ${where(tab.mateSheet)}.` : ", stands on an open border."}`;
    if (tab && go && tab.sheet !== this.sheet.name) this.choose(this.find(tab.sheet));
    else this.stage.draw();
  }

  step(by) {
    if (!this.tabs.length) return;
    const at = this.tab ? this.tabs.indexOf(this.tab) + by : Math.min(by, 0);
    this.pick(this.tabs.at(at % this.tabs.length), true);
  }

  /** Show the sheet of the mate; a second time that of the tab again. */
  toMate() {
    if (!this.tab?.mate) return;
    const { sheet, mateSheet } = this.tab;
    const other = this.sheet.name === mateSheet ? sheet : mateSheet;
    if (this.find(other) >= 0) this.choose(this.find(other));
  }

  /** The lines that mark the chosen tab and its mate on this sheet: kind 0 the tab, kind 1 the mate. */
  markTab() {
    if (this.marked) this.marked.free();
    this.marked = null;
    if (!this.tab) return 0;
    const { polygon, sheet, mate, mateSheet } = this.tab;
    const ends = [];
    const kinds = [];
    if (sheet === this.sheet.name) {
      for (let at = 0; at < polygon.length; at += 2) {
        ends.push(polygon[at], polygon[at + 1], polygon[(at + 2) % polygon.length], polygon[(at + 3) % polygon.length]);
        kinds.push(0);
      }
    }
    if (mate && mateSheet === this.sheet.name) {
      ends.push(...mate);
      kinds.push(1);
    }
    if (kinds.length) this.marked = new Lines(this.stage, new Uint8Array(kinds)).place(new Float32Array(ends), 2);
    return kinds.length;
  }

  choose(index) {
    if (!(index in this.sheets)) return;
    this.play(false);
    const sheet = this.sheets[index];
    this.index = index;
    this.sheet = sheet;
    byId("sheet-choice").value = index;
    byId("sheet-before").disabled = index === 0;
    byId("sheet-after").disabled = index === this.sheets.length - 1;
    const points = decode(sheet.points, Uint16Array);
    this.ends = decode(sheet.ends, Float32Array);
    const marked = decode(sheet.layers, Uint8Array);
    this.strokes = [...marked.keys()].filter((at) => marked[at] & 128);
    this.points = points;
    this.count = this.ends.length;
    const moments = new Float32Array(2 * this.count);
    const ends = new Uint16Array(4 * this.count);
    for (let at = 0; at < this.count; at += 1) {
      moments[2 * at] = at ? this.ends[at - 1] : 0;
      moments[2 * at + 1] = this.ends[at];
      ends.set(points.subarray(2 * at, 2 * at + 4), 4 * at);
    }
    if (this.moves) this.moves.free();
    this.moves = new Lines(this.stage, marked.map((mark) => mark & 127), moments).place(ends, 2);
    this.frame = this.outline(sheet);
    const shown = this.shown ? this.shown() : null;
    const entries = this.layers.flatMap((layer, at) => {
      const length = sheet.lengths[at];
      if (!length) return [];
      return [{
        kind: at, name: layer.name, colour: layer.colour, look: layer.travel ? "dashed" : "",
        note: lengthText(length), shown: shown === null || Boolean(shown & (1 << at)),
      }];
    });
    this.shown = legend(byId("layers"), entries, () => this.stage.draw());
    const best = [1, 10, 60, 300].find((speed) => sheet.seconds / speed <= 45) || 300;
    byId("speed").value = best;
    const times = Object.entries(sheet.operation_seconds).filter(([, seconds]) => seconds >= 0.5);
    byId("operations").replaceChildren(...times.map(([name, seconds]) => element(
      "div", {}, element("dt", { textContent: name }), element("dd", { textContent: clockText(seconds) }),
    )));
    this.seek(sheet.seconds);
    this.fit();
    this.pick(this.tab);
  }

  /** The bed and its margin as eight segments in mm, of kinds 0 and 1. */
  outline({ bed: [width, height, margin] }) {
    const loop = (m) => {
      const [l, b, r, t] = [m, m, width - m, height - m];
      return [l, b, r, b, r, b, r, t, r, t, l, t, l, t, l, b];
    };
    const kinds = new Uint8Array([1, 1, 1, 1, 0, 0, 0, 0]);
    return new Lines(this.stage, kinds).place(new Float32Array([...loop(margin), ...loop(0)]), 2);
  }

  /** Let the bed and everything drawn fill the view, above the ruler. */
  fit() {
    const [left, bottom, right, top] = this.sheet.view;
    const [width, height] = [right - left, top - bottom];
    const ruler = 34;
    this.fitted = true;
    this.scale = Math.max(Math.min((this.stage.width - 28) / width, (this.stage.height - 28 - ruler) / height), 0.01);
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2 - ruler / 2 / this.scale;
    this.stage.draw();
  }

  shift(dx, dy) {
    this.fitted = false;
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    this.stage.draw();
  }

  zoom(factor, x, y) {
    const scale = Math.min(Math.max(this.scale * factor, 0.01), 2000);
    const [dx, dy] = [x - this.stage.width / 2, this.stage.height / 2 - y];
    this.fitted = false;
    this.x += dx / this.scale - dx / scale;
    this.y += dy / this.scale - dy / scale;
    this.scale = scale;
    this.stage.draw();
  }

  /** Where the pointer is, in mm. */
  place(event) {
    const box = this.stage.canvas.getBoundingClientRect();
    return [
      this.x + (event.clientX - box.left - this.stage.width / 2) / this.scale,
      this.y - (event.clientY - box.top - this.stage.height / 2) / this.scale,
    ];
  }

  say(event) {
    const [x, y] = this.place(event);
    byId("sheet-cursor").value = `X ${x.toFixed(1)}  Y ${y.toFixed(1)} mm`;
  }

  seek(seconds) {
    this.now = Math.min(Math.max(seconds, 0), this.sheet.seconds);
    byId("time").value = this.sheet.seconds ? (1000 * this.now) / this.sheet.seconds : 1000;
    const text = `${clockText(this.now)} of ${clockText(this.sheet.seconds)}, stroke ${this.stroke()} of ${this.strokes.length}`;
    byId("clock").value = text;
    byId("time").setAttribute("aria-valuetext", text);
    this.stage.draw();
  }

  play(wanted) {
    if (wanted === this.playing) return;
    this.playing = wanted;
    byId("play").textContent = wanted ? "Pause" : "Play";
    byId("play").setAttribute("aria-pressed", wanted);
    if (!wanted) return;
    if (this.now >= this.sheet.seconds) this.seek(0);
    let before = performance.now();
    const tick = (moment) => {
      if (!this.playing) return;
      this.seek(this.now + (Math.max(moment - before, 0) / 1000) * Number(byId("speed").value));
      before = moment;
      if (this.now >= this.sheet.seconds) this.play(false);
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  /** The number of the stroke that is under way now, or was last; `cut --from-stroke` takes it. */
  stroke() {
    let [low, high] = [0, this.strokes.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      const move = this.strokes[middle];
      if ((move ? this.ends[move - 1] : 0) < this.now) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The move that is under way now. */
  move() {
    let [low, high] = [0, this.count - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.ends[middle] < this.now) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Where the tool is in a move now, in mm. */
  tool(move) {
    const begin = move ? this.ends[move - 1] : 0;
    const part = Math.min(Math.max((this.now - begin) / (this.ends[move] - begin || 1), 0), 1);
    const [x, y, width, height] = this.sheet.box;
    const at = (axis) => this.points[2 * move + axis] * (1 - part) + this.points[2 * move + 2 + axis] * part;
    return [x + (at(0) / 65535) * width, y + (at(1) / 65535) * height];
  }

  camera(x, y, width, height) {
    const [sx, sy] = [(2 * this.scale) / this.stage.width, (2 * this.scale) / this.stage.height];
    return [sx * width, 0, 0, 0, 0, sy * height, 0, 0, 0, 0, 1, 0, sx * (x - this.x), sy * (y - this.y), 0, 1];
  }

  pixel([x, y]) {
    return [this.stage.width / 2 + (x - this.x) * this.scale, this.stage.height / 2 - (y - this.y) * this.scale];
  }

  paint(gl) {
    if (this.fitted && (this.seenWidth !== this.stage.width || this.seenHeight !== this.stage.height)) {
      [this.seenWidth, this.seenHeight] = [this.stage.width, this.stage.height];
      this.fit();
    }
    const ratio = this.stage.ratio;
    gl.clearColor(...rgb("--view"), 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const [paperWidth, paperHeight] = this.sheet.paper;
    const [left, bottom] = this.pixel([0, 0]);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(
      Math.round(left * ratio), Math.round((this.stage.height - bottom) * ratio),
      Math.round(paperWidth * this.scale * ratio), Math.round(paperHeight * this.scale * ratio),
    );
    gl.clearColor(...rgb("--paper"), 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const bed = [{ colour: "--bed", width: 1.2 }, { colour: "--margin", width: 1, dashed: true }];
    this.stage.lines(this.frame, 8, this.camera(0, 0, 1, 1), bed);
    const move = this.move();
    const shown = this.shown();
    const travels = this.layers.reduce((mask, layer, at) => (layer.travel ? mask | (1 << at) : mask), 0);
    const view = this.camera(...this.sheet.box);
    for (const mask of [shown & travels, shown & ~travels]) {
      if (mask) this.stage.lines(this.moves, Math.min(move + 1, this.count), view, this.kinds, { shown: mask, now: this.now });
    }
    const marks = this.markTab();
    if (marks) {
      const looks = [{ colour: "--chosen", width: 4 }, { colour: "--chosen", width: 7 }];
      this.stage.lines(this.marked, marks, this.camera(0, 0, 1, 1), looks);
    }
    const head = byId("sheet-head");
    head.hidden = this.count === 0 || this.now >= this.sheet.seconds;
    if (!head.hidden) {
      const [x, y] = this.pixel(this.tool(move));
      head.style.transform = `translate(${x}px, ${y}px)`;
    }
    this.ruler();
  }

  /** A round length that is 60 to 150 pixels long. */
  ruler() {
    const most = 150 / this.scale;
    const ten = 10 ** Math.floor(Math.log10(most));
    const mm = ten * ([5, 2, 1].find((step) => step * ten <= most) || 1);
    byId("sheet-scale").style.width = `${mm * this.scale}px`;
    byId("sheet-scale").firstElementChild.textContent = `${Number(mm.toPrecision(2))} mm`;
  }
}

/** Whether a polygon, x and y in turn, holds a point: the crossings of a ray are odd. */
function holds(polygon, x, y) {
  let inside = false;
  const corners = polygon.length / 2;
  for (let at = 0, before = corners - 1; at < corners; before = at, at += 1) {
    const [ax, ay, bx, by] = [polygon[2 * at], polygon[2 * at + 1], polygon[2 * before], polygon[2 * before + 1]];
    if ((ay > y) !== (by > y) && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

/** The distance of a point from a segment. */
function fromSegment([ax, ay, bx, by], x, y) {
  const [dx, dy] = [bx - ax, by - ay];
  const part = Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1), 0), 1);
  return Math.hypot(x - ax - part * dx, y - ay - part * dy);
}
