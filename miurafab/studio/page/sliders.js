// Sliders beside the fields of the first form. A field keeps its text, in whatever unit; the slider
// follows it where it can be read, and writes it where it is moved.

import { texts } from "./texts.js";
import { byId, element, say } from "./tools.js";

const MM = { "": 1, mm: 1, cm: 10, m: 1000, in: 25.4, '"': 25.4 };
const SIZE = { low: 20, high: 600, step: 1, unit: "mm" };
const AMPLITUDE = { low: 0.2, high: 2, step: 0.01, unit: "" };
const FACETS = { low: 4, high: 40, step: 1 };

const slider = ({ low, high, step }, label) => {
  const made = element("input", { type: "range", min: low, max: high, step, className: "slider" });
  made.setAttribute("aria-label", say(texts.live.slider, { name: label }));
  return made;
};

/** Tell the form of a change as a person's own would. */
const tell = (field, kind) => field.dispatchEvent(new Event(kind, { bubbles: true }));

/** The number in `text`, in mm where it is a length; NaN where there is none. */
function read(text, unit) {
  const [, number, written] = /^\s*([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(\D*)$/i.exec(text) ?? [];
  if (number === undefined) return NaN;
  if (unit === "mm") return Number(number) * (MM[written] ?? NaN);
  return written === "" || written === unit ? Number(number) : NaN;
}

/** A slider for a field with one number. `usual` is where it stands while the field is empty. */
function forField(row, field, label, range, usual) {
  const made = slider(range, label);
  const follow = () => {
    const value = read(field.value || String(usual() ?? ""), range.unit);
    if (Number.isFinite(value)) made.value = value;
    made.setAttribute("aria-valuetext", field.value || texts.live.automatic);
  };
  made.addEventListener("input", () => {
    field.value = `${Number(made.value)}${range.unit}`;
    made.setAttribute("aria-valuetext", field.value);
    tell(field, "input");
  });
  field.addEventListener("input", () => { if (document.activeElement !== made) follow(); });
  row.append(made);
  made.follow = follow;
  follow();
  return made;
}

function forFacets(row, field) {
  const made = [slider(FACETS, texts.live.columns), slider(FACETS, texts.live.rows)];
  const follow = () => {
    const numbers = /^\s*(\d+)\s*[x×]\s*(\d+)\s*$/.exec(field.value || field.placeholder);
    made.forEach((each, at) => {
      if (numbers) each.value = numbers[at + 1];
      each.setAttribute("aria-valuetext", numbers ? numbers[at + 1] : field.value);
    });
  };
  for (const each of made) {
    each.addEventListener("input", () => {
      field.value = made.map(({ value }) => value).join("x");
      each.setAttribute("aria-valuetext", each.value);
      tell(field, "input");
    });
  }
  field.addEventListener("input", () => { if (!made.includes(document.activeElement)) follow(); });
  row.append(element("div", { className: "two" }, ...made));
  made[0].follow = follow;
  follow();
  return made[0];
}

/** Where a parameter's slider begins and ends: about its default, within what is allowed. */
function range({ default: usual, low, high, unit }) {
  const at = Number(usual);
  const reach = Math.abs(at) || 1;
  let [from, to] = low < 0 ? [-3 * reach, 3 * reach] : [at / 5, 3 * reach];
  if (unit === "deg") [from, to] = [Math.max(low, 5), high];
  [from, to] = [Math.max(from, low), Math.min(to, high)];
  const step = unit === "deg" ? 1 : 10 ** Math.floor(Math.log10((to - from) / 100));
  const round = (value, how) => Number((how(value / step) * step).toPrecision(6));
  return { low: round(from, Math.ceil), high: round(to, Math.floor), step, unit };
}

const all = [];

/** Every slider where its field says; for fields that were not changed by a person. */
export const placeSliders = () => all.filter((each) => each.isConnected).forEach((each) => each.follow());

/** Put the sliders beside their fields. `amplitude()` is that of the coarse sheet on show. */
export function beginSliders({ surfaces }, amplitude) {
  const own = (id, label, limits, usual) => (
    all.push(forField(byId(`${id}-row`), byId(id), label, limits, usual))
  );
  all.push(forFacets(byId("facets-row"), byId("facets")));
  own("size", texts.live.size, SIZE, () => byId("size").placeholder);
  own("amplitude", texts.live.amplitude, AMPLITUDE, amplitude);
  const parameters = () => {
    const name = byId("target").value.replace(/^surface:/, "");
    const known = surfaces.find((each) => each.name === name)?.parameters ?? [];
    for (const each of known) {
      const field = byId(`parameter-${each.key}`);
      if (!field || field.parentElement.querySelector(".slider")) continue;
      all.push(forField(field.parentElement, field, each.key, range(each), () => each.default));
    }
  };
  new MutationObserver(parameters).observe(byId("parameters"), { childList: true });
  parameters();
}
