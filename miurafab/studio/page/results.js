// What came of it: the pattern in words, in space and flat; the sheets, their totals and warnings.

import { texts } from "./texts.js";
import { byId, element, hasWebGl, say } from "./tools.js";

const { layout, shape, words } = texts;

const terms = (lines) => lines.map(({ name, value, remark, mark }) => (
  element(
    "div", {}, element("dt", { textContent: name }),
    element("dd", { className: mark }, value, ...(remark ? [element("small", { textContent: remark })] : [])),
  )
));

export const showTerms = (id, lines) => byId(id).replaceChildren(...terms(lines));

const items = (texts) => texts.map((text) => element("li", { textContent: text }));

const download = (text, address) => (
  element("a", { className: "button", href: address, download: "", textContent: text })
);

/** Only what has changed is loaded again: a drawing that is being looked at stays as it is. */
function load(view, attribute, address) {
  if (view.getAttribute(attribute) !== address) view.setAttribute(attribute, address);
}

export function showPattern(pattern) {
  if (pattern === null) return;
  const { files } = pattern;
  byId("verdict").classList.toggle("bad", pattern.status !== "converged");
  byId("headline").textContent = pattern.headline;
  byId("advice").textContent = pattern.advice;
  const waiting = pattern.folding ? [shape.folding_comes] : [];
  const findings = pattern.findings.map(({ sentence }) => sentence);
  byId("findings").replaceChildren(...items([...findings, ...waiting, ...(pattern.still ? [pattern.still] : [])]));
  byId("pattern-downloads").replaceChildren(
    ...(files.fold ? [download(shape.save_pattern, `${files.fold}?save`)] : []),
    ...(files.picture ? [download(shape.save_drawing, `${files.picture}?save`)] : []),
    ...(pattern.has_design ? [download(shape.save_design, "design.toml")] : []),
  );
  byId("pattern-views").hidden = !files.fold;
  if (files.fold) {
    byId("space").hidden = !hasWebGl;
    byId("no-space").hidden = hasWebGl;
    if (hasWebGl) load(byId("space"), "src", files.page);
    byId("seam-key").hidden = !pattern.seams;
    load(byId("flat"), "src", files.picture);
    byId("flat-link").href = files.picture;
  }
  showTerms("figures", pattern.lines);
  byId("pattern-command").textContent = pattern.command;
}

byId("flat").addEventListener("load", ({ target }) => {
  byId("pattern-views").classList.toggle("wide", target.naturalWidth > 1.5 * target.naturalHeight);
});

export function showJob(job, pattern) {
  const ready = Boolean(pattern?.files.fold);
  byId("layout-empty").hidden = job !== null;
  byId("layout-hint").textContent = ready
    ? layout.hint_ready : layout.hint_none;
  byId("job").hidden = job === null;
  if (job === null) return;
  const fresh = byId("job").dataset.id !== job.id;
  byId("job").dataset.id = job.id;
  // where the results stand below the form, and somebody waits for them
  if (fresh && matchMedia("(max-width: 760px)").matches) byId("job").scrollIntoView({ block: "start" });
  const { files } = job;
  byId("totals").replaceChildren(...terms(job.lines));
  byId("job-downloads").replaceChildren(
    download(layout.save_job, `${files.zip}?save`),
    download(layout.save_guide, `${files.guide}?save`),
    ...Object.entries(job.every).filter(([name]) => name.endsWith("/assembly.html")).map(([, address]) => (
      download(layout.save_guide_page, `${address}?save`)
    )),
    download(shape.save_pattern, `${pattern.files.fold}?save`),
  );
  byId("every").replaceChildren(...Object.entries(job.every).map(([name, address]) => element(
    "li", {}, element("a", { href: `${address}?save`, download: "", textContent: name.split("/").at(-1) }),
  )));
  const warnings = [...job.doubts, ...job.findings.map(({ sentence }) => sentence)];
  byId("warnings").hidden = warnings.length === 0;
  byId("warnings").lastElementChild.replaceChildren(...items(warnings));
  byId("dry-run").hidden = !hasWebGl;
  byId("pictures").hidden = hasWebGl;
  if (hasWebGl) load(byId("dry-run"), "src", files.page);
  else if (byId("pictures").childElementCount !== job.pictures.length || byId("pictures").dataset.job !== job.id) {
    byId("pictures").dataset.job = job.id;
    byId("pictures").replaceChildren(...job.pictures.map((src, at) => (
      element("img", { src, loading: "lazy", alt: say(words.sheet_number, { number: at + 1 }) })
    )));
  }
  byId("cut-command").textContent = job.cut;
  byId("job-command").textContent = job.command;
}
