"""The page of a folding motion, opened in a browser: the slider moves the sheet, offline."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from PIL import Image
from problems import fitted, regular

from miurafab.workflow.fold import fold

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no browser to open the page in")

MOVE = """(async () => {{
  const slider = document.getElementById("motion");
  slider.value = {frame};
  slider.dispatchEvent(new Event("input"));
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}})()"""


def seen(page: Browser) -> np.ndarray:
    """The pixels of the window."""
    shot = base64.b64decode(page.call("Page.captureScreenshot", format="png")["data"])
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)


def covered(page: Browser) -> int:
    """How many pixels the sheet takes of its drawing."""
    box = page.run(
        "(({x, y, width, height}) => [x, y, width, height].map(Math.round))"
        '(document.getElementById("fold-canvas").getBoundingClientRect())'
    )
    x, y, width, height = box
    picture = seen(page)[max(y, 0) : y + height, x : x + width]
    return int((np.abs(picture - picture[4, 4]).sum(axis=2) > 12).sum())


def move(page: Browser, frame: int) -> str:
    page.run(MOVE.format(frame=frame))
    return str(page.run('document.getElementById("motion-frame").value'))


@pytest.mark.parametrize(
    ("cells", "most_bytes"), [(10, 700_000), pytest.param(30, 4_000_000, marks=pytest.mark.large)]
)
def test_the_slider_moves_the_sheet(tmp_path: Path, cells: int, most_bytes: int) -> None:
    pattern = fitted("hypar", 2 * cells, 2 * cells, 0.0).pattern
    assert pattern is not None
    path = tmp_path / "motion.html"
    fold(pattern).save(path, title="hypar")
    assert path.stat().st_size <= most_bytes
    with Browser(tmp_path / "profile") as page:
        page.open(path)
        assert page.run("document.documentElement.dataset.fault") is None
        assert page.run("document.documentElement.dataset.ready") == "fold"
        assert page.run('document.getElementById("motion").max') == "40"
        at_first = page.run('document.getElementById("motion-frame").value')
        assert at_first.endswith("the folded form")
        assert move(page, 0) == "1 of 41, flat"
        flat = covered(page)
        assert move(page, 20).startswith("21 of 41, s = ")
        halfway = covered(page)
        assert move(page, 40) == "41 of 41, folded flat"
        closed = covered(page)
        assert page.run('document.getElementById("layers-bar").hidden') is False
        page.run('document.getElementById("apart").value = 100')
        move(page, 40)
        apart = covered(page)
        move(page, 39)
        assert page.run('document.getElementById("layers-bar").hidden') is True
        assert page.requests == [path.as_uri()]
    assert flat > 1.2 * halfway > 1.44 * closed > 1000
    assert apart > 1.1 * closed


def test_facets_are_coloured_by_strain_when_asked(tmp_path: Path) -> None:
    pattern = fitted("sphere", 10, 10).pattern
    assert pattern is not None
    folding = fold(pattern, 10)
    assert not folding.motion.is_rigid
    path = tmp_path / "motion.html"
    folding.save(path, title="sphere", colour="strain")
    with Browser(tmp_path / "profile") as page:
        page.open(path)
        assert page.run("document.documentElement.dataset.fault") is None
        assert page.run('document.getElementById("by-strain").checked') is True
        assert page.run('document.getElementById("strain-most").textContent').startswith("strain 0")
        move(page, 5)
        strained = seen(page)
        page.run('document.getElementById("by-strain").click()')
        move(page, 5)
        sides = seen(page)
    blue = (strained[..., 2] > strained[..., 0] + 40).sum()
    assert blue > 2 * (sides[..., 2] > sides[..., 0] + 40).sum()


def test_a_rigid_sheet_shows_no_strain(tmp_path: Path) -> None:
    path = tmp_path / "motion.html"
    fold(regular(), 6).save(path, title="regular")
    with Browser(tmp_path / "profile") as page:
        page.open(path)
        assert page.run('document.getElementById("strain-most").textContent') == "no strain"
        assert page.run('document.getElementById("by-strain").checked') is False
