// The forms: surfaces, machines and materials filled in from the catalogue, all read back as orders.
// Values stay as they were written.

import { drawnProfile, offerProfile } from "./profile.js";
import { texts } from "./texts.js";
import { byId, element, say } from "./tools.js";

const { layout, shape, words } = texts;

let catalogue;
const OF_ONE_MESH = ["region", "rotate", "poles", "polar_hole"];
let sourcesNow = [];
let shown = ""; // the target whose rows the form has

export function fillForms(given) {
  catalogue = given;
  const { defaults, first } = given;
  byId("version").textContent = given.version;
  byId("facets").value = defaults.facets;
  byId("size").value = defaults.size;
  profileOptions(byId("machine"), given.machines, first?.machine ?? given.machine);
  profileOptions(byId("material"), given.materials, first?.material ?? given.material);
  byId("profile-faults").replaceChildren(...given.faults.map((text) => element("li", { textContent: text })));
  for (const [name, value] of Object.entries(first?.layout ?? {})) {
    const field = byId("layout-options").querySelector(`[name="${name}"]`);
    if (field.type === "checkbox") field.checked = value;
    else field.value = value;
    if (field.selectedIndex < 0) field.value = ""; // the default
  }
  byId("formats").append(...given.formats.map((name) => element(
    "label", { className: "check" }, element("input", { type: "checkbox", value: name }), name,
  )));
  byId("file").accept = given.file_suffixes.join(",");
  byId("file-help").textContent = say(shape.files, { suffixes: given.file_suffixes.join(" "), limit: given.file_limit >> 20 });
  for (const kind of ["input", "change"]) { // a browser tells of both, the form hears the first
    byId("target").addEventListener(kind, () => { if (byId("target").value !== shown) showTarget(); });
  }
  showSources([]);
  if (first?.surface) showTarget(`surface:${first.surface}`, first.parameters, first.profile);
  else showTarget();
}

const group = (label, entries) => (entries.length ? [element("optgroup", { label }, ...entries)] : []);

/** Machines or materials: the person's own before those that came with miurafab. */
export function profileOptions(select, entries, chosen) {
  const made = (own) => entries.filter((each) => each.own === own).map(({ name, title }) => (
    element("option", { value: name, textContent: title, selected: name === chosen })
  ));
  select.append(...group(words.your_own, made(true)), ...group(words.shipped, made(false)));
}

/** The stock files that were brought, beside sheets of the bed's size. */
function showStocks(sources, chosen) {
  const select = byId("stock");
  const before = chosen ?? select.value;
  select.replaceChildren(
    element("option", { value: "", textContent: layout.bed_sheets }),
    ...sources.map(({ id, name }) => element("option", { value: id, textContent: name })),
  );
  select.value = before;
  if (select.selectedIndex < 0) select.value = "";
}

/** The list of targets: the built-in ones, and files that can be fitted or opened. */
export function showSources(all, chosen, parameters) {
  const stocks = all.filter(({ kind }) => kind === "stock");
  const stock = stocks.find(({ id }) => id === chosen);
  showStocks(stocks, stock?.id);
  showTargets(all.filter(({ kind }) => kind !== "stock"), stock ? undefined : chosen, parameters);
}

function showTargets(sources, chosen, parameters) {
  const select = byId("target");
  const before = chosen ? `source:${chosen}` : select.value;
  select.replaceChildren(
    ...group(shape.your_files, sources.map(({ id, name, kind }) => (
      element("option", { value: `source:${id}`, textContent: kind === "pattern" ? say(shape.pattern_file, { name }) : name })
    ))),
    ...group(shape.built_in, catalogue.surfaces.map(({ name }) => (
      element("option", { value: `surface:${name}`, textContent: name })
    ))),
  );
  sourcesNow = sources;
  select.value = before || "surface:hypar";
  if (select.selectedIndex < 0) select.value = "surface:hypar";
  if (select.value !== before || chosen) showTarget("", parameters);
}

function chosenTarget() {
  const [kind, name] = byId("target").value.split(":");
  return kind === "surface"
    ? { surface: catalogue.surfaces.find((each) => each.name === name) }
    : { source: sourcesNow.find((each) => each.id === name) };
}

/** What may be given of a target: its formulas, its numbers, those of an image. */
function given({ surface, source }) {
  const image = source?.kind === "image" ? Object.entries(catalogue.of_image) : [];
  return [
    ...(surface?.formulas ?? []).map((each) => ({ ...each, unit: "", wide: true })),
    ...(surface?.parameters ?? []),
    ...image.map(([key, meaning]) => ({ key, meaning, unit: "", default: "" })),
  ];
}

function showTarget(value, parameters = {}, profile = null) {
  if (value) byId("target").value = value;
  if (shown !== byId("target").value) for (const name of OF_ONE_MESH) byId(name).value = "";
  shown = byId("target").value;
  const { surface, source } = chosenTarget();
  const pattern = source?.kind === "pattern";
  byId("summary").textContent = surface ? `${capital(surface.summary)}.` : {
    mesh: shape.of_mesh,
    image: shape.of_image,
    design: shape.of_design,
    pattern: shape.of_pattern,
  }[source.kind];
  byId("parameters").replaceChildren(...given({ surface, source }).map((each) => {
    const id = `parameter-${each.key}`;
    const text = parameters[each.key] ?? `${each.default}${each.unit}`;
    return element(
      "div", { className: each.wide ? "row wide" : "row" },
      element("label", { htmlFor: id }, capital(each.key), element("small", { textContent: each.meaning })),
      element("input", { id, name: each.key, value: text, autocomplete: "off", spellcheck: false }),
    );
  }));
  offerProfile(surface, profile);
  byId("close-row").hidden = Boolean(surface && !surface.turned) || ["mesh", "image"].includes(source?.kind);
  byId("mesh-options").hidden = !["mesh", "design"].includes(source?.kind);
  byId("sheet-options").hidden = pattern;
  byId("fit").textContent = pattern ? shape.open : shape.fit;
  const { facets, size } = catalogue.defaults;
  byId("facets").placeholder = source?.kind === "design" ? words.as_it_says : facets;
  byId("size").placeholder = { design: words.as_it_says, mesh: words.as_in_file }[source?.kind] ?? size;
  // the size that was offered belongs to built-in surfaces; files have their own
  if (source && byId("size").value === size) byId("size").value = "";
  if (source?.kind === "design" && byId("facets").value === facets) byId("facets").value = "";
  if (surface && !byId("size").value) byId("size").value = size;
  if (surface && !byId("facets").value) byId("facets").value = facets;
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Why a file cannot be taken, if it cannot; the server would hang up on a larger one. */
export function tooLarge(file) {
  const limit = catalogue.file_limit;
  return file.size > limit ? say(shape.too_large, { file: file.name, limit: limit >> 20 }) : "";
}

/** The route and the order that the first form stands for. */
export function fitOrder() {
  const { surface, source } = chosenTarget();
  if (source?.kind === "pattern") return ["open", { source: source.id }];
  const parameters = {};
  for (const { key, unit, default: usual } of given({ surface, source })) {
    const value = byId(`parameter-${key}`).value.trim();
    if (value && value !== `${usual}${unit}`) parameters[key] = value;
  }
  const target = source ? { source: source.id } : { surface: surface.name };
  if (surface || source.kind === "image") target.parameters = parameters;
  const profile = surface && drawnProfile();
  if (profile) target.profile = profile;
  return ["fit", { target, options: values("sheet-options") }];
}

/** The order that the second form stands for. */
export function layoutOrder() {
  return {
    machine: byId("machine").value, material: byId("material").value, options: values("layout-options"),
    stock: byId("stock").value,
    formats: [...byId("formats").querySelectorAll(":checked")].map(({ value }) => value).join(","),
  };
}

function values(fieldset) {
  const found = {};
  const box = byId(fieldset);
  for (const field of box.querySelectorAll("input[name], select[name]")) {
    const away = box.contains(field.closest("[hidden]")); // a tab that is not in front hides more
    const value = field.type === "checkbox" ? field.checked : field.value.trim();
    if (value && !away) found[field.name] = value;
  }
  return found;
}

/** Put the values of an order of the first form back into it. */
export function restoreForm({ target, source, options = {} }) {
  const file = source ?? target.source;
  byId("target").value = file ? `source:${file}` : `surface:${target.surface}`;
  if (byId("target").selectedIndex < 0) return;
  showTarget("", target?.parameters, target?.profile);
  for (const field of byId("sheet-options").querySelectorAll("input[name], select[name]")) {
    if (field.type === "checkbox") field.checked = Boolean(options[field.name]);
    else field.value = options[field.name] ?? "";
  }
}
