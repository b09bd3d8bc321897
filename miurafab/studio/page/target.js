// The target as soon as it is chosen: in space, for a mesh with the part that will be covered, which is
// moved and turned by hand; after a fit with its deviation and coverage. What is refused says what mends it.

import { fitOrder } from "./choices.js";
import { layoutMap } from "./layout_map.js";
import { traceProfile } from "./profile.js";
import { CHARTS, DEVIATION, TargetScene, areaOf, unpack } from "./target_scene.js";
import { texts } from "./texts.js";
import { ask, byId, element, hasWebGl, say } from "./tools.js";

const { target } = texts;
const SHAPING = ["close", "poles", "polar_hole", "side", "holes"];
const AGAIN_MS = 150;
const REST_MS = 400;
const USUAL = [20, 20];
const OUTER = 0.01; // of the area: so much more of the file than of the layout is worth showing
const MENDS = {
  "holes keep": target.mend_keep,
  "holes all": target.mend_fill,
  "edge rectangle": target.mend_rectangle,
  region: target.mend_region,
  poles: target.mend_poles,
};

let scene = null;
let map = null;
let key = ""; // of the target on show
let pictures = { file: null, laid: null, fitted: null };
let asking = false;
let again = false;
let resting = null;
let poles = null; // those that were picked so far, while they are picked
let fitted = { file: "", key: "" };
let isOfForm = false; // the last fit is one of the form as it is now

const field = (name) => byId(name);
const top = () => pictures.laid ?? pictures.file;

/** What the target is, without what the page itself can show of it. */
function question() {
  const [route, form] = fitOrder();
  if (route !== "fit") return null;
  const options = {};
  for (const name of SHAPING) if (form.options[name]) options[name] = form.options[name];
  if (options.close && form.options.facets) options.facets = form.options.facets;
  if (form.target.source && form.options.pieces) options.pieces = form.options.pieces;
  return { target: form.target, options };
}

/** Show the target of the form as it is now. */
export async function seeTarget() {
  arrange();
  again = true;
  if (asking) return;
  asking = true;
  while (again) {
    again = false;
    const asked = question();
    const now = JSON.stringify(asked);
    if (now === key) break;
    if (!asked) {
      key = now;
      take({ file: null, laid: null });
      break;
    }
    try {
      const told = await ask("target", asked);
      if (again && JSON.stringify(question()) !== now) continue;
      const same = JSON.parse(key || "null");
      const keep = same && JSON.stringify(same.target) === JSON.stringify(asked.target)
        || same?.target.surface && same.target.surface === asked.target.surface;
      key = now;
      refuse(told);
      byId("target-canvas").classList.toggle("old", Boolean(told.refused));
      if (told.refused) take(keep ? pictures : { file: null, laid: null }, true); // a slip of the hand leaves the picture
      else if (told.more === null) take({ file: null, laid: unpack(told.picture) }, keep);
      else {
        take({ file: told.picture && unpack(told.picture), laid: null }, keep);
        await laid(told.more, now);
      }
    } catch (error) {
      key = now;
      refuse({ refused: error.message, mends: [] });
    }
  }
  asking = false;
}

/** Wait for what a fit makes of a mesh, until another target is chosen. */
async function laid(number, now) {
  byId("target-note").textContent = target.laying;
  for (;;) {
    const told = await ask(`target/${number}`);
    if (told.gone || JSON.stringify(question()) !== now) break;
    if (told.picture) take({ file: unpack(told.picture), laid: null });
    if (!told.wait) {
      refuse(told);
      if (!told.refused) take({ file: pictures.file, laid: unpack(told) }, Boolean(pictures.file));
      break;
    }
    await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS); });
  }
  if (byId("target-note").textContent === target.laying) byId("target-note").textContent = "";
}

function take(found, keep = false) {
  pictures = { ...found, fitted: isOfForm && fitted.picture && fitted.key === key ? fitted.picture : null };
  if (key === JSON.stringify(null)) pictures.laid = pictures.fitted; // a pattern that was opened
  byId("target-panel").hidden = !top() && byId("target-refused").hidden;
  const { laid: picture } = pictures;
  byId("target-findings").replaceChildren(...(picture?.findings ?? []).map(({ sentence }) => element("li", { textContent: sentence })));
  byId("target-place").hidden = picture?.kind !== "disk";
  byId("target-open").hidden = !(picture?.kind === "tube" && picture.poles.length);
  if (picture?.kind === "disk") map.show(picture);
  if (picture?.kind === "map") traceProfile(profileOf(picture));
  showScene(keep);
}

function showScene(keep) {
  const { file, laid: picture, fitted: after } = pictures;
  byId("target-colours").hidden = !after;
  const shown = after && byId("target-colours").value === "deviation" ? after : picture;
  const around = file && shown && areaOf(file) > (1 + OUTER) * areaOf(shown);
  scene?.show([...(around || (file && !shown) ? [file] : []), ...(shown ? [shown] : [])], keep);
  arrange();
}

/** The profile of a surface that has one, as the target has it: the first line of its lattice. */
function profileOf({ points, middle, flat }) {
  const side = Math.round(Math.sqrt(flat.length / 2));
  const at = (vertex) => [0, 1, 2].map((axis) => points[3 * vertex + axis] + middle[axis]);
  const turned = byId("target").value === "surface:revolution";
  return Array.from({ length: side }, (_, k) => {
    const [x, y, z] = at(turned ? k : k * side);
    return turned ? [Math.hypot(x, y), z] : [y, z];
  });
}

const numbers = (text) => text.split(",").map((word) => Number(word));

/** The part in fractions of the box: of the form, or where the fit itself takes a rectangle; null for all. */
function partOf(picture) {
  const [x, y, wide, high] = map.box;
  const text = field("region").value.trim();
  const values = numbers(text);
  if (!picture.deviation && text && values.length === 4 && values.every(Number.isFinite)) return values;
  if (picture.deviation ? picture.edge : text || field("edge").value !== "rectangle") return null;
  const [u0, u1, v0, v1] = picture.rectangle;
  return [(u0 - x) / wide, (u1 - x) / wide, (v0 - y) / high, (v1 - y) / high];
}

function turnOf(picture) {
  if (picture.deviation) return picture.angle;
  const text = field("rotate").value.trim().replace(/\s*(deg|°)$/, "");
  return text && Number.isFinite(Number(text)) ? Number(text) : picture.angle;
}

/** Show what the form says of the part, the grid and the pieces, without asking. */
function arrange() {
  const picture = pictures.fitted && byId("target-colours").value === "deviation" ? pictures.fitted : pictures.laid;
  const size = /^\s*(\d+)\s*[x×]\s*(\d+)\s*$/.exec(field("facets").value);
  const cells = size ? [Number(size[1]), Number(size[2])] : USUAL;
  const pieces = Math.max(1, Number(field("pieces").value) || 1);
  const view = { turn: [1, 0], box: [0, 0, 1, 1], part: [0, 1, 0, 1], cells, pieces, colours: CHARTS };
  if (picture?.kind === "tube") {
    Object.assign(view, { box: [picture.start, 0, picture.girth, picture.length], pieces: picture.gores });
  } else if (picture?.kind === "disk") {
    const turn = turnOf(picture);
    map.set(turn, null);
    const part = partOf(picture);
    map.set(turn, part);
    Object.assign(view, { turn: map.axes, box: map.box, part: part ?? view.part });
    if (picture.edge) view.cells = [0, 0]; // where a sheet was cut along the outline, its grid is not known
    byId("target-turn").value = turn;
    byId("target-turn").setAttribute("aria-valuetext", say(target.degrees, { degrees: turn.toFixed(0) }));
    byId("target-whole").disabled = !part;
    byId("target-part").disabled = Boolean(part);
    byId("target-place-note").textContent = map.beyond ? target.beyond : part ? target.part_help : target.whole_help;
  }
  if (picture?.deviation) view.colours = DEVIATION;
  scene?.set(view);
  showWords(picture, view);
}

const swatch = (name, words) => element("span", {}, element("i", { className: name }), words);

function showWords(picture, { pieces, part, colours }) {
  const shown = picture ?? pictures.file;
  byId("target-size").textContent = shown && shown.kind !== "map" && shown.size.length
    ? say(target.size, { box: shown.size.map((side) => side.toPrecision(4).replace(/\.?0+$/, "")).join(" × ") }) : "";
  const words = [];
  if (colours === DEVIATION) {
    const most = shown.most.toPrecision(2);
    words.push(element("span", { className: "ramp-key" }, `−${most} mm`, element("i", { className: "ramp" }), `+${most} mm`));
    words.push(swatch("left-out", say(target.not_covered, { share: (100 * missedOf(shown)).toFixed(1) })));
  } else if (picture) {
    const given = field("pieces").value || picture.kind !== "tube"; // else a fit may find that it needs more
    words.push(swatch("paper", pieces > 1 ? say(given ? target.pieces : target.fewest, { count: pieces }) : target.covered));
    const cut = part.some((value, at) => Math.abs(value - [0, 1, 0, 1][at]) > 1e-9);
    if (cut || (pictures.file && areaOf(pictures.file) > (1 + OUTER) * areaOf(picture))) words.push(swatch("left-out", target.left_out));
    if (picture.filled.some(Boolean)) words.push(swatch("filled", target.filled));
    if (pieces > 1) words.push(swatch("seam", target.seams));
  }
  byId("target-key").replaceChildren(...words);
}

/** The share of the area that the sheet does not cover. */
function missedOf(picture) {
  const { faces, missed } = picture;
  if (picture.share === undefined) {
    const out = faces.filter((_, at) => missed[Math.floor(at / 3)]);
    picture.share = areaOf({ points: picture.points, faces: out }) / areaOf(picture);
  }
  return picture.share;
}

/** Say what is refused, with a button for each thing that mends it. */
function refuse({ refused = "", mends = [] }) {
  byId("target-refused").hidden = !refused;
  byId("target-refused-words").textContent = refused;
  byId("target-mends").replaceChildren(...mends.map(({ option, value }) => {
    const words = MENDS[`${option} ${value}`] ?? MENDS[option] ?? say(target.mend, { option, value });
    const button = element("button", { type: "button", textContent: words });
    button.addEventListener("click", () => {
      if (value === null) {
        pickPoles();
        return;
      }
      refuse({});
      put(option, value);
    });
    return button;
  }));
  tellOnce();
}

/** The form says why it has no fit; what stands above the picture is not said there too. */
export function tellOnce() {
  const words = byId("refused").textContent;
  byId("refused").hidden = !words || words === byId("target-refused-words").textContent;
}

/** Write a value into a field of the form as a hand would. */
function put(name, value) {
  field(name).value = value;
  for (const kind of ["input", "change"]) field(name).dispatchEvent(new Event(kind, { bubbles: true }));
}

const written = (part) => part.map((value) => Number(value.toFixed(4))).join(",");

function place({ part, turn }) {
  if (Math.abs(turn - turnOf(pictures.laid)) > 1e-6) put("rotate", `${turn.toFixed(1)}`);
  if (part && written(part) !== field("region").value) put("region", written(part));
  clearTimeout(resting);
  resting = setTimeout(judge, REST_MS);
}

/** Where the part reaches beyond the mesh, ask for the largest that does not. */
async function judge() {
  if (!map.beyond) {
    if (key) refuse({});
    return;
  }
  const asked = question();
  const [region, rotate] = [field("region").value, field("rotate").value];
  try {
    const { more } = await ask("target", { ...asked, options: { ...asked.options, region, ...(rotate ? { rotate } : {}) } });
    let told = { wait: more !== null };
    while (told.wait && field("region").value === region) {
      await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS); });
      told = await ask(`target/${more}`);
    }
    if (field("region").value === region) refuse(told);
  } catch (error) {
    refuse({ refused: error.message });
  }
}

/** Let the two poles of a closed mesh be picked on it: gores run from one to the other. */
function pickPoles() {
  poles = [];
  byId("target-note").textContent = target.pick_first;
  byId("target-canvas").focus();
}

function tapped(spot) {
  if (!poles || !spot) return;
  poles.push(spot);
  byId("target-note").textContent = poles.length < 2 ? target.pick_second : "";
  if (poles.length < 2) return;
  put("poles", poles.flat().map((value) => Number(value.toPrecision(6))).join(","));
  poles = null;
}

/** Whether the last fit is one of the form as it is: of another the colours would be stale. */
export function takeFit(is) {
  if (is === isOfForm) return;
  isOfForm = is;
  take(pictures, true);
}

/** After each answer of the studio: the colours of a fit, once they are there. */
export async function followTarget({ pattern }) {
  if (JSON.stringify(question()) !== key) seeTarget(); // a file was opened
  const file = pattern?.files.target ?? "";
  if (file === fitted.file) return;
  fitted = { file, key: "" };
  if (!file) {
    take(pictures, true);
    return;
  }
  try {
    const picture = unpack(await ask(file));
    if (fitted.file !== file) return;
    fitted = { file, picture, key: pattern.form.target ? keyOfForm(pattern.form) : JSON.stringify(null) };
    take(pictures, true);
  } catch {
    fitted = { file: "", key: "" }; // a newer result has taken its place
  }
}

function keyOfForm({ target: what, options: all }) {
  const options = {};
  for (const name of SHAPING) if (all[name]) options[name] = all[name];
  if (options.close && all.facets) options.facets = all.facets;
  if (what.source && all.pieces) options.pieces = all.pieces;
  return JSON.stringify({ target: what, options });
}

export function beginTarget() {
  byId("target-no-webgl").hidden = hasWebGl;
  byId("target-canvas").hidden = !hasWebGl;
  if (hasWebGl) scene = new TargetScene(byId("target-canvas"), tapped);
  map = layoutMap(place);
  byId("target-home").addEventListener("click", () => scene?.reset());
  byId("target-colours").addEventListener("change", () => showScene(true));
  byId("target-turn").addEventListener("input", ({ currentTarget }) => {
    place({ part: null, turn: Number(currentTarget.value) });
  });
  byId("target-whole").addEventListener("click", () => {
    put("region", "");
    if (field("edge").value === "rectangle") put("edge", "");
    refuse({});
  });
  byId("target-part").addEventListener("click", () => {
    const [x, y, wide, high] = map.box;
    const [u0, u1, v0, v1] = pictures.laid.rectangle;
    const part = [(u0 - x) / wide, (u1 - x) / wide, (v0 - y) / high, (v1 - y) / high];
    put("region", written(part.map((value) => Math.min(Math.max(value, 0.02), 0.98))));
    byId("target-map").focus();
  });
  byId("target-open").addEventListener("click", pickPoles);
  return seeTarget();
}
