// The page: asks for work, follows it, and shows what came of it.

import { fillForms, layoutOrder, restoreForm, showSources, tooLarge } from "./choices.js";
import { showFolding } from "./folding.js";
import { beginLive, changed, fitNow, followLive, restLive } from "./live.js";
import { beginMachine, offerJob } from "./machine.js";
import { beginProfile } from "./profile.js";
import { showJob, showPattern } from "./results.js";
import { beginTarget, followTarget } from "./target.js";
import { texts } from "./texts.js";
import { ask, byId, copy, say } from "./tools.js";

const TABS = ["shape", "fold", "layout", "desk"];
const DOING = { fit: texts.frame.fitting, open: texts.frame.opening, sheets: texts.frame.laying_out };
let following = 0;
let told = "";
let failed = ""; // the last task whose error was told
let ownJob = null;

function show(state) {
  const { task, pattern, job, sources } = state;
  showPattern(pattern);
  showFolding(pattern);
  showJob(job, pattern);
  offerJob(job, ownJob);
  const running = Boolean(task?.running);
  byId("task").hidden = !running;
  if (running) {
    const { kind, note, seconds } = task;
    byId("task-note").textContent = say(
      note ? texts.frame.task : texts.frame.task_begins, { doing: DOING[kind], note, seconds: seconds.toFixed(0) },
    );
    // nothing is known of how long it takes before the first step is done
    if (task.fraction > 0) byId("task-bar").value = task.fraction;
    else byId("task-bar").removeAttribute("value");
  }
  byId("job").classList.toggle("old", running && task.id !== pattern?.id);
  const names = JSON.stringify(sources);
  if (names !== told) showSources(sources);
  told = names;
  if (!running && task?.error && task.id !== failed) {
    failed = task.id;
    fault(task.error);
  }
  followLive(state);
  followTarget(state);
}

function fault(sentence) {
  byId("fault").textContent = sentence;
  byId("fault").hidden = !sentence;
}

/** Ask for the state until nothing is being done any more. */
async function follow() {
  following += 1;
  const mine = following;
  try {
    let state = await ask("state");
    while (mine === following) {
      show(state);
      if (!state.task?.running) break;
      await new Promise((resolve) => { setTimeout(resolve, 200); });
      state = await ask("state");
    }
  } catch (error) {
    byId("task").hidden = true;
    fault(error.message);
  }
}

async function order(route, body) {
  fault("");
  try {
    await ask(route, body);
    await follow();
  } catch (error) {
    fault(error.message);
  }
}

async function open(file) {
  fault(tooLarge(file));
  if (tooLarge(file)) return;
  try {
    const name = encodeURIComponent(file.name);
    const { source, kind, sources } = await ask("upload", file, { "X-File-Name": name });
    told = JSON.stringify(sources);
    showSources(sources, source);
    if (kind === "pattern") await order("open", { source });
    else changed();
  } catch (error) {
    fault(error.message);
  }
}

function turnTo(tab) {
  fault("");
  if (byId(tab).hidden) scrollTo(0, 0);
  for (const each of TABS) {
    const chosen = each === tab;
    byId(each).hidden = !chosen;
    byId(`${each}-tab`).setAttribute("aria-selected", chosen);
    byId(`${each}-tab`).tabIndex = chosen ? 0 : -1;
  }
  showFolding();
}

function listen() {
  for (const [at, tab] of TABS.entries()) {
    const button = byId(`${tab}-tab`);
    button.addEventListener("click", () => turnTo(tab));
    button.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const next = TABS[(at + step + TABS.length) % TABS.length];
      turnTo(next);
      byId(`${next}-tab`).focus();
    });
  }
  byId("fit-form").addEventListener("submit", (event) => {
    event.preventDefault();
    fitNow();
  });
  byId("layout-form").addEventListener("submit", (event) => {
    event.preventDefault();
    order("sheets", layoutOrder());
  });
  document.addEventListener("input", () => fault(""));
  byId("cancel").addEventListener("click", () => {
    restLive();
    order("cancel", {});
  });
  byId("to-machine").addEventListener("click", () => {
    turnTo("desk");
    byId("desk-tab").focus();
  });
  byId("go-on").addEventListener("click", () => {
    turnTo("layout");
    byId("layout-tab").focus();
  });
  for (const id of ["file", "stock-file"]) {
    byId(id).addEventListener("change", ({ target }) => {
      if (target.files.length) open(target.files[0]);
      target.value = "";
    });
  }
  for (const button of document.querySelectorAll("[data-copy]")) {
    button.addEventListener("click", () => copy(button));
  }
  const files = (event) => event.dataTransfer?.types.includes("Files");
  document.addEventListener("dragover", (event) => {
    if (!files(event)) return;
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) document.body.classList.remove("dropping");
  });
  document.addEventListener("drop", (event) => {
    document.body.classList.remove("dropping");
    if (!files(event)) return;
    event.preventDefault();
    turnTo("shape");
    open(event.dataTransfer.files[0]);
  });
  document.addEventListener("visibilitychange", () => { if (!document.hidden) follow(); });
}

async function begin() {
  listen();
  try {
    const catalogue = await ask("catalogue");
    fillForms(catalogue);
    ownJob = catalogue.own_job;
    await beginMachine(catalogue, fault);
    if (ownJob) turnTo("desk");
    const { sources, pattern, task } = await ask("state");
    const form = task?.running ? task.form : pattern?.form; // of what is to be shown next
    told = JSON.stringify(sources);
    showSources(sources, catalogue.first?.source, catalogue.first?.parameters);
    if (form) restoreForm(form);
    beginProfile(changed);
    beginLive(catalogue, { asks: order });
    beginTarget();
    await follow();
  } catch (error) {
    fault(error.message);
  }
  document.documentElement.dataset.ready = "yes";
}

begin();
