// Fill the page from its data: the figures first, so that they stand even where no drawing can.

function figures({ facts, machine, findings, sheets, made_by: maker }) {
  byId("made-for").textContent = machine ? `Dry run for ${machine}` : "";
  byId("totals").append(...Object.entries(facts).map(([name, value]) => (
    element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value }))
  )));
  const warnings = [
    ...findings, ...sheets.flatMap((sheet) => sheet.warnings),
  ];
  byId("warnings").hidden = warnings.length === 0;
  byId("warnings").firstElementChild.append(...warnings.map((text) => element("li", { textContent: text })));
  byId("footer").textContent = `${maker}. This page is complete in itself: it asks nothing of any network.`;
}

function table(sheets, choose) {
  if (!sheets.length) return;
  const heads = ["Sheet", "Lines", "Time", "Beam on", "Drawn", "Travel", "Bounds (mm)", "Warnings"];
  const box = byId("table");
  box.querySelector("thead").append(
    element("tr", {}, ...heads.map((text) => element("th", { scope: "col", textContent: text }))),
  );
  box.querySelector("tbody").append(...sheets.map((sheet, at) => {
    const pick = element("button", { type: "button", textContent: sheet.name });
    pick.addEventListener("click", () => choose(at));
    const bounds = sheet.bounds ? sheet.bounds.map((mm) => mm.toFixed(1)) : null;
    const cells = [
      sheet.lines.toLocaleString("en"), clockText(sheet.seconds), clockText(sheet.beam_on_seconds),
      lengthText(sheet.cut_mm), lengthText(sheet.travel_mm),
      bounds ? `${bounds[0]}, ${bounds[1]} to ${bounds[2]}, ${bounds[3]}` : "–", sheet.warnings.length || "none",
    ];
    return element(
      "tr", {}, element("th", { scope: "row" }, pick), ...cells.map((text) => element("td", { textContent: text })),
    );
  }));
  box.hidden = false;
}

// within another page (the studio) the drawing stands alone
const within = window.parent !== window;
document.documentElement.classList.toggle("within", within);
document.documentElement.classList.toggle("whole", location.hash === "#whole"); // with the flat pattern and the curve
if (within) { // where Escape aborts a machine, whatever has the focus
  document.addEventListener("keydown", ({ key, repeat }) => {
    if (key === "Escape" && !repeat) window.parent.postMessage(key, "*");
  });
}
const data = JSON.parse(byId("data").textContent);
const views = {};
figures(data);
table(data.sheets, (at) => {
  if (!views.sheets) return;
  views.sheets.choose(at);
  byId("sheets").scrollIntoView({ block: "nearest" });
});
try {
  document.querySelector("main").classList.toggle("both", data.sheets.length > 0 && data.fold !== null);
  if (data.sheets.length) views.sheets = new SheetView(data.sheets, data.layers, data.tabs);
  if (data.fold) views.fold = new FoldView(data.fold);
  document.documentElement.dataset.ready = Object.keys(views).join(" ");
} catch (fault) {
  byId("no-webgl").hidden = false;
  document.documentElement.dataset.fault = fault.message;
}
