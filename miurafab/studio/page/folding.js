// The tab Fold: the page of the folding in a frame, which is loaded once somebody looks at it.

import { texts } from "./texts.js";
import { byId, hasWebGl } from "./tools.js";

let shown = null;

export function showFolding(pattern = shown) {
  shown = pattern;
  const page = hasWebGl ? pattern?.files.page : undefined;
  byId("fold-empty").hidden = Boolean(page);
  byId("folding").hidden = !page;
  byId("fold-hint").textContent = pattern?.files.page ? texts.shape.no_webgl : texts.fold.none;
  const address = `${page}#whole`;
  if (!page || byId("fold").hidden || byId("folding").getAttribute("src") === address) return;
  byId("folding").setAttribute("src", address);
}
