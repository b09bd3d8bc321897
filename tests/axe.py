"""What axe-core, the usual checker of accessibility, finds wrong with a page in a browser.

``npm ci --prefix tests/interop`` installs it. Its file is run in the page, which loads nothing.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from browser import CHROMIUM, Browser

AXE = Path(__file__).parent / "interop" / "node_modules" / "axe-core" / "axe.min.js"

needs_axe = pytest.mark.skipif(
    CHROMIUM is None or not AXE.is_file(),
    reason="needs Chromium and `npm ci` in tests/interop",
)

# frames without rights do not answer; each of their pages is checked by itself
_CHECK = """axe.run(document, {
  iframes: false, resultTypes: ["violations"],
}).then(({ violations }) => violations
  .filter(({ impact }) => impact === "serious" || impact === "critical")
  .flatMap(({ id, nodes }) => nodes.map((node) => (
    `${id}: ${node.target.join(" ")}: ${node.failureSummary.split("\\n").slice(1).join("; ")}`
  ))))"""


def dress(page: Browser, theme: str) -> None:
    """Show ``page`` as somebody sees it who likes the ``theme`` (light or dark) and no motion."""
    features = {"prefers-color-scheme": theme, "prefers-reduced-motion": "reduce"}
    page.call(
        "Emulation.setEmulatedMedia",
        features=[{"name": name, "value": value} for name, value in features.items()],
    )


def serious_faults(page: Browser) -> list[str]:
    """All that is serious or critical, as it is shown now, in the light and in the dark theme."""
    if page.run("typeof axe") == "undefined":
        page.run(f"{AXE.read_text(encoding='utf-8')}; 0")
    found = []
    for theme in ("light", "dark"):
        dress(page, theme)
        found += [f"{theme}: {fault}" for fault in page.run(_CHECK)]
    return found
