// Live: the form is refitted coarsely while a hand moves it, and wholly when the hand rests. What is
// shown always says what it is a result of; what belongs to another form than the present one is
// greyed, and says so.

import { fitOrder, layoutOrder, restoreForm } from "./choices.js";
import { showTerms } from "./results.js";
import { beginSketch, sketch } from "./sketch.js";
import { beginSliders, placeSliders } from "./sliders.js";
import { seeTarget, takeFit, tellOnce } from "./target.js";
import { texts } from "./texts.js";
import { ask, byId, element, say } from "./tools.js";

const { layout, live } = texts;
const REST_MS = 700;
const AGAIN_MS = 400;
const MOST_ALONE = 1600; // facets of a whole fit that begins by itself

let order = null; // asks for work: order(route, body)
let coarse = null; // the coarse answer on show: { key, form, said }
let refused = ""; // why the present form has none
let asking = false;
let again = false;
let resting = null;
let bench = { pattern: null, task: null };
let fitting = null; // the form that is being fitted wholly, by its key
let alone = false; // it began by itself
let plan = { key: "", bed: null };
const past = { forms: [], at: -1 };

/** A form as one text, however it was written. */
function keyOf(form) {
  const lines = [];
  const walk = (value, path) => {
    if (value && typeof value === "object") Object.keys(value).sort().forEach((name) => walk(value[name], `${path}/${name}`));
    else lines.push(`${path}=${value}`);
  };
  walk(form, "");
  return lines.join("\n");
}

const present = () => fitOrder()[1];
const isFit = () => fitOrder()[0] === "fit";
const follows = () => byId("follow").checked;
const count = ({ options }) => (options.facets ?? "20x20").split("x").reduce((all, each) => all * Number(each), 1);

/** The words of a form: the target, its parameters, the options. */
function subject({ target, options }) {
  const name = byId("target").selectedOptions[0]?.textContent ?? "";
  const given = Object.entries(target.parameters ?? {}).map(([key, value]) => `${key} ${value}`);
  const named = (option) => byId(`${option}-row`)?.querySelector("label")?.firstChild?.textContent.trim() ?? option;
  const set = Object.entries(options).map(([option, value]) => (value === true ? named(option) : `${named(option)} ${value}`));
  return [[name, ...given].join(", "), ...set].join(" · ");
}

/** Ask for the coarse fit of the present form, and of each newer one, one after the other. */
async function pump() {
  again = true;
  if (asking) return;
  asking = true;
  while (again) {
    again = false;
    if (!isFit() || !follows()) break;
    const form = present();
    const words = subject(form);
    try {
      let { number, said } = await ask("live", { ...form, layout: layoutOrder() });
      while (said.wait && !again) ({ said } = await ask(`live/${number}`));
      if (said.gone && !again) await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS); });
      if (said.gone) again ||= keyOf(form) === keyOf(present()) && !document.hidden;
      else if (!said.wait) take(form, words, said);
    } catch (error) {
      take(form, words, { error: error.message });
    }
  }
  asking = false;
  show();
}

function take(form, words, said) {
  const key = keyOf(form);
  if (said.error) {
    if (key === keyOf(present())) refused = said.error;
  } else {
    refused = "";
    coarse = { key, form, words, said: said.answer };
    showCoarse();
    placeSliders();
  }
  show();
}

function showBed(id, bed) {
  const place = byId(id);
  place.hidden = !bed;
  if (!bed) return;
  place.className = `bed ${bed.mark}`;
  const parts = [element("b", { textContent: bed.title }), ` ${bed.remark}`];
  if (bed.mark === "more" && bed.largest_mm) {
    const button = element("button", { type: "button", textContent: say(live.make, { size: `${bed.largest_mm} mm` }) });
    button.addEventListener("click", () => {
      byId("size").value = `${bed.largest_mm}mm`;
      byId("size").dispatchEvent(new Event("input", { bubbles: true }));
      byId("size").focus();
    });
    parts.push(" ", button);
  }
  const words = JSON.stringify(bed);
  if (place.dataset.words !== words) place.replaceChildren(...parts);
  place.dataset.words = words;
}

/** The outline of the flat pattern over a sheet, to scale. */
function drawBed(bed) {
  byId("bed-panel").hidden = !bed?.sheet;
  if (!bed?.sheet) return;
  const [wide, high] = bed.sheet;
  const reach = [0, 1].map((axis) => Math.max(bed.sheet[axis] / 2, ...bed.border.flatMap((edge) => [Math.abs(edge[axis]), Math.abs(edge[axis + 2])])));
  byId("bed-drawing").setAttribute("viewBox", [-reach[0] - 4, -reach[1] - 4, 2 * reach[0] + 8, 2 * reach[1] + 8].map((mm) => mm.toFixed(1)).join(" "));
  byId("bed-sheet").setAttribute("d", `M${-wide / 2} ${-high / 2}H${wide / 2}V${high / 2}H${-wide / 2}Z`);
  byId("bed-border").setAttribute("d", bed.border.map(([x, y, u, v]) => `M${x} ${-y}L${u} ${-v}`).join(""));
  byId("bed-border").classList.toggle("over", bed.mark === "more");
  byId("bed-size").textContent = `${wide} × ${high} mm`;
}

function showCoarse() {
  const { said, words } = coarse;
  byId("coarse-subject").textContent = words;
  byId("coarse-headline").textContent = said.headline;
  byId("coarse-verdict").classList.toggle("bad", said.status !== "converged");
  byId("coarse-advice").textContent = said.advice;
  byId("coarse-findings").replaceChildren(...said.findings.map(({ sentence }) => element("li", { textContent: sentence })));
  byId("coarse-size").textContent = said.box_mm ? say(live.box, { box: said.box_mm.map((mm) => mm.toFixed(0)).join(" × ") }) : "";
  const [columns, rows] = said.facets ?? [];
  const note = said.way === "scaled" ? live.scaled : said.fewer ? live.fewer : live.not_polished;
  byId("coarse-note").textContent = say(note, { columns, rows });
  showBed("coarse-bed", said.bed);
  drawBed(said.bed);
  byId("sketch").hidden = !said.picture;
  sketch(said.picture);
  showTerms("coarse-figures", said.lines);
}

/** Which pattern the tabs Fold and Layout have, and whether the form asks for another. */
function showResultOf(pattern, whole) {
  const words = !pattern?.files.fold ? "" : say(whole ? layout.for_pattern : layout.for_other, pattern);
  byId("layout-of").textContent = words;
  byId("fold-of").textContent = words;
}

/** What is on show, and what is said of it. */
function show() {
  const form = present();
  const key = keyOf(form);
  const { pattern, task } = bench;
  const whole = pattern && keyOf(pattern.form) === key;
  const quick = coarse?.key === key;
  const useCoarse = Boolean(coarse) && !whole && (quick || follows()) && isFit();
  for (const part of ["coarse", "sketch-panel", "coarse-rest"]) {
    byId(part).hidden = !useCoarse;
    byId(part).classList.toggle("behind", useCoarse && !quick);
  }
  byId("pattern").hidden = useCoarse || !pattern;
  const stale = !useCoarse && Boolean(pattern) && !whole;
  byId("pattern").classList.toggle("old", stale);
  byId("stale").hidden = !stale;
  if (stale) byId("stale-words").textContent = say(live.stale, { subject: pattern.subject });
  byId("refused").textContent = refused;
  tellOnce();
  byId("subject").textContent = pattern?.subject ?? "";
  byId("go-on").disabled = stale;
  showResultOf(pattern, whole);
  takeFit(Boolean(whole));
  byId("fit").disabled = false;
  const runs = Boolean(task?.running);
  byId("lay-out").disabled = runs || !whole || !pattern.files.fold;
  const comes = runs && task.kind === "fit" && quick ? live.coming : "";
  const instead = refused ? live.refused : live.behind;
  byId("coming").textContent = useCoarse && !quick ? instead : comes;
  byId("shape-empty").hidden = useCoarse || Boolean(pattern);
  byId("undo").disabled = past.at < 1;
  byId("redo").disabled = past.at >= past.forms.length - 1;
  if (whole && pattern.files.fold) askPlan(pattern);
  else showBed("bed", null);
}

/** The sheets that the whole result needs, by a plan. */
async function askPlan(pattern) {
  const key = `${pattern.id} ${keyOf(layoutOrder())}`;
  if (plan.key === key) {
    showBed("bed", plan.bed);
    return;
  }
  if (asking) return;
  plan = { key, bed: plan.key.split(" ")[0] === pattern.id ? plan.bed : null };
  showBed("bed", plan.bed);
  try {
    let { number, said } = await ask("live/plan", { layout: layoutOrder() });
    while (said.wait && plan.key === key) ({ said } = await ask(`live/${number}`));
    if (plan.key !== key) return;
    if (said.answer) plan.bed = said.answer.bed;
    else plan.key = "";
    if (bench.pattern?.id === pattern.id && !said.gone) show();
  } catch {
    plan.key = ""; // it is asked again when something changes
  }
}

/** The form was changed by a person. */
export function changed() {
  refused = "";
  clearTimeout(resting);
  resting = setTimeout(rest, REST_MS);
  seeTarget();
  if (alone && fitting !== keyOf(present()) && bench.task?.running && bench.task.kind === "fit") {
    alone = false;
    order("cancel", {}); // nobody asked for it, and nobody waits for it any more
  }
  show();
  if (follows()) pump();
}

/** The hand rests: the form is one to come back to, and is fitted wholly. */
function rest() {
  const form = present();
  const key = keyOf(form);
  remember(form);
  show();
  if (!isFit() || !follows() || key === fitting) return;
  if (asking || coarse?.key !== key) {
    if (!refused) resting = setTimeout(rest, AGAIN_MS);
    return;
  }
  byId("live-said").textContent = [coarse.said.headline, coarse.said.bed?.title, coarse.said.bed?.remark].filter(Boolean).join(" ");
  if (bench.pattern && keyOf(bench.pattern.form) === key) return;
  const mayBegin = !bench.task?.running || fitting !== null;
  if (count(form) <= MOST_ALONE && mayBegin) {
    fitWhole(form);
    alone = true;
  }
}

function fitWhole(form) {
  const { task } = bench;
  fitting = keyOf(form);
  alone = false;
  const replaces = task?.running && task.kind === "fit" ? task.id : "";
  return order("fit", { ...form, replaces });
}

function remember(form) {
  if (past.at >= 0 && keyOf(past.forms[past.at]) === keyOf(form)) return;
  past.forms = [...past.forms.slice(0, past.at + 1), form].slice(-100);
  past.at = past.forms.length - 1;
}

function step(by) {
  remember(present()); // what was not yet at rest is one step, too
  const at = past.at + by;
  if (at < 0 || at >= past.forms.length) return;
  past.at = at;
  putForm(past.forms[at]);
}

function putForm(form) {
  restoreForm(form);
  placeSliders();
  changed();
}

/** The state of the bench, each time that it is asked for. */
export function followLive(state) {
  bench = state;
  if (!state.task?.running) fitting = null;
  show();
}

/** The button Fit: the whole fit of the present form, in place of one that still runs. */
export function fitNow() {
  clearTimeout(resting);
  const [route, body] = fitOrder();
  remember(body);
  return route === "fit" ? fitWhole(body) : order(route, body);
}

/** A person cancelled: nothing begins by itself before the next change. */
export const restLive = () => clearTimeout(resting);

export function beginLive(catalogue, { asks }) {
  order = asks;
  beginSketch();
  beginSliders(catalogue, () => coarse?.said.amplitude);
  const form = byId("fit-form");
  for (const kind of ["input", "change"]) {
    form.addEventListener(kind, ({ target }) => {
      if (target.type !== "file" && target.type !== "range" && target.id !== "follow") changed();
    });
  }
  byId("layout-form").addEventListener("change", () => { if (coarse && follows()) pump(); else show(); });
  byId("follow").addEventListener("change", changed);
  byId("undo").addEventListener("click", () => step(-1));
  byId("redo").addEventListener("click", () => step(1));
  byId("back-to").addEventListener("click", () => putForm(bench.pattern.form));
  document.addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || byId("shape").hidden || !["z", "y"].includes(key)) return;
    const writes = event.target.matches("textarea, input:not([type=range], [type=checkbox])");
    if (writes) return; // a field has an undo of its own
    event.preventDefault();
    step(key === "y" || event.shiftKey ? 1 : -1);
  });
  remember(present());
  show();
}
