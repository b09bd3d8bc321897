// A curve beside the slider, with a mark that moves along it.

const HIGH = 88; // per cent of the box for the curve; the rest is margin
const LOW = 6;

class Chart {
  /** `seek(frame)` is asked for when somebody points at the curve. */
  constructor(box, seek) {
    this.box = box;
    this.svg = box.querySelector("svg");
    this.dot = box.querySelector(".dot");
    this.rule = box.querySelector(".rule");
    const point = (event) => {
      if (event.type === "pointermove" && !event.buttons) return;
      const { left, width } = box.getBoundingClientRect();
      if (this.places) seek(this.nearest((100 * (event.clientX - left)) / width));
    };
    box.addEventListener("pointerdown", point);
    box.addEventListener("pointermove", point);
    new ResizeObserver(() => {
      [this.wide, this.tall] = [box.clientWidth / 100, box.clientHeight / 100];
      this.at(this.now ?? 0);
    }).observe(box);
  }

  /** Show `values` (y) over `places` (x), with a text above and one below. */
  show({ values, places, top, bottom, colour = "--accent" }) {
    Object.assign(this, { values, places });
    const [low, high] = [Math.min(0, ...values), Math.max(0, ...values)];
    const [left, right] = [Math.min(...places), Math.max(...places)];
    this.across = (x) => 3 + (94 * (x - left)) / (right - left || 1);
    this.height = (y) => LOW + HIGH * (1 - (y - low) / (high - low || 1));
    const path = values.map((value, at) => `${this.across(places[at]).toFixed(2)} ${this.height(value).toFixed(2)}`);
    const line = (d, stroke, width) => drawn(
      "path", { d, "stroke-width": width, "vector-effect": "non-scaling-stroke" }, { stroke: `var(${stroke})`, fill: "none" },
    );
    const base = this.height(0).toFixed(2);
    this.svg.replaceChildren(line(`M3 ${base}H97`, "--rule", 1), line(`M${path.join("L")}`, colour, 2));
    this.box.querySelector(".top").textContent = top;
    this.box.querySelector(".bottom").textContent = bottom;
    this.at(this.now ?? 0);
  }

  /** The frame at a place across the box; of several there, the one nearest to the frame that is shown. */
  nearest(across) {
    const far = this.places.map((place, at) => (
      Math.abs(this.across(place) - across) + (3 * Math.abs(at - this.now)) / this.places.length
    ));
    return far.indexOf(Math.min(...far));
  }

  /** Move the mark to a frame, between two frames blended. */
  at(frame) {
    this.now = frame;
    if (!this.values || !this.wide) return;
    const last = this.values.length - 1;
    const low = Math.min(Math.floor(frame), last);
    const part = Math.min(frame, last) - low;
    const blend = (list) => list[low] + part * ((list[low + 1] ?? list[low]) - list[low]);
    const x = this.across(blend(this.places)) * this.wide;
    this.rule.style.transform = `translateX(${x}px)`;
    this.dot.style.transform = `translate(${x}px, ${this.height(blend(this.values)) * this.tall}px)`;
  }
}
