// The tab Machine: asks for the state of the session several times a second, and shows it. A state
// that is not asked for is not shown as true: an answer that is late greys it out.

import { profileOptions } from "./choices.js";
import { mark, setSheet } from "./sheet.js";
import { ask, byId, element } from "./tools.js";

const OFTEN_MS = 200;
const SELDOM_MS = 1500;
const LATE_MS = 1500;
const PRESS_MS = 100;
const ABORT_MS = 700;

let control = "";
let taken = -1; // how often control had been taken when this page took it
let heard = 0; // lines of the console up to now
let drawn = ""; // the job and sheet on the canvas
let done = 0; // strokes of that sheet that were burnt when it was last told
let step = 10;
let now = { open: false };
let answered = performance.now();
let asking = null;
let turns = 0;
let fault = () => {};

const controls = () => Boolean(control) && taken === now.taken;

async function order(route, body = {}) {
  try {
    const { control: given, ...state } = await ask(`machine/${route}`, { control, ...body });
    if (given) {
      control = given;
      taken = state.taken;
    }
    fault("");
    show(state, false);
    return true;
  } catch (error) {
    fault(error.message);
    return false;
  }
}

export async function abort() {
  const unheard = () => { if (now.open) fault(byId("abort-late").textContent); };
  const slow = setTimeout(unheard, ABORT_MS);
  try {
    show(await ask("machine/abort", {}), false);
  } catch {
    unheard();
  }
  clearTimeout(slow);
}

const set = (id, text) => {
  const place = byId(id);
  if (place.textContent !== text) place.textContent = text;
};
const toggle = (id, there) => { byId(id).hidden = !there; };

function show(state, asked = true) {
  const before = now.open;
  now = state;
  answered = performance.now();
  document.body.classList.remove("late");
  toggle("watch", state.open);
  toggle("desk-empty", !state.open);
  toggle("connect-form", !state.open);
  toggle("connected", state.open);
  for (const part of document.querySelectorAll("#desk .live")) part.hidden = !state.open;
  if (asked) told(state);
  if (!state.open) {
    set("desk-ended", state.ended);
    if (before && state.ended) fault(state.ended); // on whatever tab
    control = "";
    drawn = "";
    showPorts(state.ports ?? []);
    return;
  }
  const { words } = state;
  set("watch-state", words.title);
  byId("watch-state").dataset.look = words.look;
  byId("status").dataset.look = words.look;
  set("state-title", words.title);
  set("state-advice", words.advice);
  set("trouble", state.trouble);
  toggle("practice", state.practice);
  toggle("watching", !controls());
  set("desk-title", state.machine);
  set("desk-at", state.port);
  for (const [id, text] of Object.entries(state.facts ?? {})) set(id, text);
  byId("beam").classList.toggle("lit", Boolean(state.beam_on));
  showJob(state);
  showArmed(state.armed);
  if (state.settings) showSettings(state.settings);
  enable(state);
}

function told({ said, count }) {
  const lines = byId("lines");
  if (count < heard) lines.replaceChildren();
  if (said.length) {
    const low = lines.scrollTop + lines.clientHeight > lines.scrollHeight - 30;
    lines.append(...said.map((textContent) => element("div", { textContent })));
    while (lines.childElementCount > 400) lines.firstElementChild.remove();
    if (low) lines.scrollTop = lines.scrollHeight;
  }
  heard = count;
}

function showPorts(ports) {
  const select = byId("desk-port");
  const names = JSON.stringify(ports);
  if (select.dataset.ports !== names) {
    const before = select.value;
    select.dataset.ports = names;
    select.replaceChildren(...ports.map(({ name, text }) => (
      element("option", { value: name, textContent: `${name}: ${text}` })
    )));
    select.value = before;
    if (select.selectedIndex < 0) select.value = ports.at(-1)?.name ?? "";
  }
  set("desk-held", ports.find(({ name }) => name === select.value)?.held ?? "");
}

function showJob({ job, sheet, sheets = [], next, progress, work, practice, reading }) {
  toggle("reading", Boolean(reading));
  if (reading) {
    byId("reading-bar").value = reading.share;
    set("reading-words", reading.words);
  }
  toggle("job-work", job !== null);
  set("job-name", job?.name ?? "");
  toggle("no-job", job === null && !byId("put-on").dataset.from);
  set("next", next ?? "");
  toggle("progress", Boolean(progress));
  if (progress) {
    byId("strokes-bar").value = progress.share;
    set("strokes-words", progress.words);
  }
  if (!job) return;
  set("job-folder", job.folder);
  toggle("go-on-words", !practice);
  const select = byId("sheet-number");
  if (select.childElementCount !== sheets.length || select.dataset.job !== String(job.number)) {
    select.dataset.job = job.number;
    select.replaceChildren(...sheets.map((name, at) => (
      element("option", { value: at + 1, textContent: name })
    )));
  }
  if (document.activeElement !== select) select.value = sheet;
  select.hidden = sheets.length < 2;
  const wanted = `${job.number}/${sheet}`;
  if (drawn !== wanted) {
    drawn = wanted;
    done = 0;
    ask(`machine/sheet/${sheet}`).then(setSheet, () => { drawn = ""; });
  }
  if (progress) done = progress.stroke;
  mark(done, work);
}

function showArmed(armed) {
  const before = byId("armed").hidden;
  toggle("armed", Boolean(armed));
  if (!armed) return;
  byId("start").dataset.code = armed.code;
  byId("armed-facts").replaceChildren(...armed.facts.map(([name, value]) => element(
    "div", {}, element("dt", { textContent: name }), element("dd", { textContent: value }),
  )));
  if (before && controls()) byId("disarm").focus();
}

function showSettings({ verdict, differ, refused, rows }) {
  const table = byId("settings-rows");
  const names = JSON.stringify(rows);
  if (table.dataset.lines === names) return;
  table.dataset.lines = names;
  table.replaceChildren(...rows.map(({ name, wanted, here, same }) => element(
    "tr", { className: same ? "" : "differs" },
    element("td", { textContent: name }), element("td", { textContent: wanted }),
    element("td", { textContent: here }),
  )));
  set("settings-verdict", verdict);
  set("settings-refused", refused);
  if (differ) byId("settings").open = true;
}

function enable({ busy, reading, words, job, state, loaded, material_wanted: wanted }) {
  const mine = controls();
  const idle = mine && !busy && state === "Idle";
  const allowed = {
    home: mine && !busy, unlock: mine && !busy, set_origin: idle, go_to_origin: idle,
    frame: idle && job, fresh: mine && !busy && loaded,
  };
  for (const button of document.querySelectorAll("#desk [data-do]")) button.disabled = !allowed[button.dataset.do];
  for (const button of document.querySelectorAll("#desk [data-key]")) button.disabled = !mine;
  for (const button of document.querySelectorAll("#pad [data-x]")) button.disabled = !mine || Boolean(busy);
  byId("arm").disabled = !(idle && job);
  byId("start").disabled = !mine;
  byId("disarm").disabled = !mine;
  byId("put-on").disabled = !mine || Boolean(busy) || Boolean(reading) || !byId("put-on").dataset.from;
  byId("sheet-number").disabled = !mine || Boolean(busy);
  byId("say").disabled = !mine || Boolean(busy);
  byId("leave").disabled = !mine;
  byId("hold").classList.toggle("primary", words.look === "busy");
  byId("resume").classList.toggle("primary", words.look === "held" && !wanted);
  byId("fresh").classList.toggle("primary", Boolean(wanted));
}

/** Which job the button puts on the desk: that of the last layout, or the one of the command line. */
export function offerJob(job, own) {
  const name = job ? job.name : own;
  const button = byId("put-on");
  button.dataset.from = name ?? "";
  button.hidden = !name;
  set("put-on-name", name ?? "");
}

async function follow() {
  clearTimeout(asking);
  const turn = ++turns; // of two that wait for an answer the later one goes on
  try {
    const state = await ask(`machine?after=${heard}`);
    if (turn !== turns) return;
    show(state);
  } catch (error) {
    if (turn !== turns) return;
    late();
    if (now.open) fault(error.message);
  }
  const often = now.open && !document.hidden;
  asking = setTimeout(follow, often ? OFTEN_MS : SELDOM_MS);
}

function late() {
  if (now.open) document.body.classList.add("late");
}

/** A press of the pad: once, and again while it is held. A button that is disabled meanwhile tells
 * of no release, so that ends it, too. */
function pressPad(button) {
  let under = false;
  const over = new AbortController();
  const end = () => { clearInterval(again); over.abort(); };
  const press = async () => {
    if (button.disabled) end();
    if (under || button.disabled) return;
    under = true;
    await order("jog", { x: Number(button.dataset.x), y: Number(button.dataset.y), step });
    under = false;
  };
  const again = setInterval(press, PRESS_MS);
  for (const event of ["pointerup", "pointercancel", "blur"]) {
    window.addEventListener(event, end, { signal: over.signal });
  }
  button.addEventListener("pointerleave", end, { signal: over.signal });
  press();
}

const ARROWS = { ArrowUp: "up", ArrowDown: "down", ArrowLeft: "left", ArrowRight: "right" };

function chooseStep(value) {
  step = value;
  for (const button of byId("steps-mm").children) {
    const chosen = Number(button.value) === value;
    button.setAttribute("aria-checked", chosen);
    button.tabIndex = chosen ? 0 : -1;
  }
}

function listen() {
  byId("connect-form").addEventListener("submit", (event) => {
    event.preventDefault();
    order("connect", { port: byId("desk-port").value, machine: byId("desk-machine").value });
  });
  byId("desk-port").addEventListener("change", () => showPorts(now.ports ?? []));
  for (const [id, route] of [["leave", "leave"], ["take", "take"], ["put-on", "job"], ["arm", "arm"], ["disarm", "disarm"]]) {
    byId(id).addEventListener("click", () => order(route));
  }
  byId("start").addEventListener("click", ({ currentTarget }) => order("start", { code: currentTarget.dataset.code }));
  byId("sheet-number").addEventListener("change", ({ target }) => order("sheet", { number: Number(target.value) }));
  for (const button of document.querySelectorAll("#desk [data-do]")) {
    button.addEventListener("click", () => order("do", { action: button.dataset.do }));
  }
  for (const button of document.querySelectorAll("#desk [data-key]")) {
    button.addEventListener("click", () => order("key", { key: button.dataset.key }));
  }
  for (const button of document.querySelectorAll("#pad [data-x]")) {
    button.addEventListener("pointerdown", (event) => { if (event.button === 0) pressPad(button); });
    button.addEventListener("click", (event) => { // by the keyboard
      if (event.detail === 0) order("jog", { x: Number(button.dataset.x), y: Number(button.dataset.y), step });
    });
  }
  byId("pad").addEventListener("keydown", (event) => {
    const button = ARROWS[event.key] && byId("pad").querySelector(`.${ARROWS[event.key]}`);
    if (!button || button.disabled) return;
    event.preventDefault();
    order("jog", { x: Number(button.dataset.x), y: Number(button.dataset.y), step });
  });
  byId("steps-mm").addEventListener("keydown", (event) => {
    const turn = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!turn) return;
    event.preventDefault();
    const buttons = [...byId("steps-mm").children];
    const at = (buttons.findIndex((each) => Number(each.value) === step) + turn + buttons.length) % buttons.length;
    chooseStep(Number(buttons[at].value));
    buttons[at].focus();
  });
  byId("say-form").addEventListener("submit", async (event) => {
    event.preventDefault();
    if (byId("line").value.trim() && await order("say", { text: byId("line").value })) byId("line").value = "";
  });
  // At the press and not at the release; a click without a press is one of the keyboard.
  byId("abort").addEventListener("pointerdown", abort);
  byId("abort").addEventListener("click", ({ detail }) => { if (detail === 0) abort(); });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || event.isComposing || event.repeat) return;
    abort();
  }, true);
  // A drawing within the page tells of the key when it has the focus; it can do no more than that.
  window.addEventListener("message", ({ data, source }) => {
    const ours = [...document.querySelectorAll("iframe")].some((frame) => frame.contentWindow === source);
    if (ours && data === "Escape") abort();
  });
  document.addEventListener("visibilitychange", () => { if (!document.hidden) follow(); });
  setInterval(() => { if (now.open && performance.now() - answered > LATE_MS) late(); }, 500);
}

export function beginMachine(catalogue, onFault) {
  fault = onFault;
  const { machines, steps, machine, first } = catalogue;
  profileOptions(byId("desk-machine"), machines, first?.machine ?? machine);
  byId("steps-mm").append(...steps.map((value) => {
    const button = element("button", { type: "button", value, textContent: value });
    button.setAttribute("role", "radio");
    button.addEventListener("click", () => chooseStep(value));
    return button;
  }));
  chooseStep(step);
  offerJob(null, catalogue.own_job);
  listen();
  return follow();
}
