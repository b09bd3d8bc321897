"""The page of a folding motion, opened in a browser: the slider moves the sheet, offline."""

from __future__ import annotations

import base64
import io
import math
import re
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from PIL import Image
from problems import fitted, regular

from miurafab.origami.folding.facet_energy import facet_energies
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


def told_size(page: Browser) -> float:
    """The diagonal of the box whose sides the page tells, mm."""
    told = str(page.run('document.getElementById("fold-size").value'))
    return math.hypot(*(float(side) for side in told.removesuffix(" mm").split(" × ")))


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
        assert page.run('document.getElementById("motion").max') == "50"
        at_first = page.run('document.getElementById("motion-frame").value')
        assert at_first.endswith("the folded form")
        assert move(page, 0) == "1 of 41, flat"
        flat, boxes = covered(page), [told_size(page)]
        assert move(page, 20).startswith("21 of 41, median fold angle ")
        halfway = covered(page)
        boxes.append(told_size(page))
        assert move(page, 40) == "41 of 41, folded flat"
        closed = covered(page)
        boxes.append(told_size(page))
        assert page.run('document.getElementById("fold-size").value').count("×") == 1
        together = seen(page)
        assert re.search(r"folded flat, layers 0\.0*[1-9]\d* mm apart$", move(page, 50))
        apart = np.abs(seen(page) - together).sum(axis=2) > 12
        assert page.requests == [path.as_uri()]
    # the view comes nearer as the sheet becomes smaller, and the size of its box is told
    assert min(flat, halfway) > 100_000
    assert closed > 25_000
    assert apart.sum() > closed / 4
    assert boxes == sorted(boxes, reverse=True)


def test_the_page_plays_beside_the_flat_pattern_and_its_energy(tmp_path: Path) -> None:
    pattern = fitted("hypar", 6, 6).pattern
    assert pattern is not None
    path = tmp_path / "motion.html"
    folding = fold(pattern, 8)
    folding.save(path, title="hypar")
    energies = facet_energies(folding.motion)
    assert energies is not None
    dot = 'document.querySelector("#curve .dot").style.transform'
    with Browser(tmp_path / "profile") as page:
        page.open(path)
        top = page.run('document.querySelector("#curve .top").textContent')
        assert float(top.split(" ")[0]) == float(f"{energies.max():.2g}")
        # one line for each kind of edge, of as many pieces as there are edges
        drawn = page.run(
            '[...document.querySelectorAll("#flat-pattern path[stroke-width]")].slice(0, -1)'
            '.map((path) => path.getAttribute("d").split("M").length - 1)'
        )
        assert sum(drawn) == len(pattern.edges_vertices)
        # the mark stands on the curve
        places = []
        for frame in (0, 3, 8):
            move(page, frame)
            places.append([float(n) for n in re.findall(r"[\d.]+(?=px)", page.run(dot))])
        box = page.run('[document.getElementById("curve").clientHeight]')[0]
        heights = [(94 - 100 * y / box) / 88 for _, y in places]
        assert heights == pytest.approx((energies[[0, 3, 8]] / energies.max()).tolist(), abs=0.01)
        move(page, 0)
        start = page.run(dot)
        page.run('document.getElementById("fold-play").click()')
        assert page.run('document.getElementById("fold-play").textContent') == "Pause"
        seen_at = page.run(
            "new Promise((done) => { const wait = () => {"
            'const at = Number(document.getElementById("motion").value);'
            "if (at >= 2) done(at); else requestAnimationFrame(wait); }; wait(); })"
        )
        assert seen_at >= 2
        page.run('document.getElementById("fold-play").click()')
        assert page.run('document.getElementById("fold-play").textContent') == "Play"
        assert page.run(dot) != start
        assert page.requests == [path.as_uri()]


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
        assert page.run('document.getElementById("strain-key").hidden') is True
        note = page.run('document.getElementById("curve-note").textContent')
        assert note.endswith("the facets stay flat, which takes no energy")
