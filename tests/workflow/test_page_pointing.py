"""Pointing at the page of a motion: what is chosen is seen in both pictures, with true figures."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from axe import dress
from browser import CHROMIUM, Browser
from problems import fitted
from test_fold_page import move, seen

from miurafab.geometry.polygons import edge_lengths, facet_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import triangulate
from miurafab.workflow.fold import fold
from miurafab.workflow.folding import Folding
from miurafab.workflow.panels import thick_panels

HALF_FIELD = math.tan(math.radians(16))


def sheet() -> CreasePattern:
    pattern = fitted("hypar", 6, 6, 0.0).pattern
    assert pattern is not None
    return pattern


@pytest.fixture(scope="module")
def folding() -> Folding:
    return fold(sheet(), 20)


@pytest.fixture(scope="module")
def page(folding: Folding, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    folder = tmp_path_factory.mktemp("pointing")
    folding.save(folder / "motion.html", title="hypar")
    with Browser(folder / "profile") as browser:
        dress(browser, "light")
        browser.open(folder / "motion.html")
        yield browser


needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no browser to open the page in")


def text(page: Browser, name: str) -> str:
    return str(page.run(f'document.getElementById("{name}").textContent'))


def box(page: Browser, name: str) -> list[float]:
    return list(
        page.run(
            "(({x, y, width, height}) => [x, y, width, height])"
            f'(document.getElementById("{name}").getBoundingClientRect())'
        )
    )


def point(page: Browser, x: float, y: float, kind: str = "mouseMoved") -> str:
    """Point at a place of the window; the figures that are told then."""
    button = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
    page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **button)
    frames = "requestAnimationFrame(() => requestAnimationFrame(done))"
    page.run(f"new Promise((done) => {frames})")
    return text(page, "figures")


def choose(page: Browser, kind: str, number: int) -> str:
    page.run(
        f'document.getElementById("look-kind").value = "{kind}";'
        f'document.getElementById("look-number").value = "{number}";'
        'document.getElementById("look-number").dispatchEvent(new Event("input"))'
    )
    return text(page, "figures")


def chosen_pixels(page: Browser, name: str) -> int:
    """How many pixels of an element are of the purple of what is chosen, which nothing else is."""
    x, y, width, height = (round(value) for value in box(page, name))
    part = seen(page)[max(y, 0) : y + height, x : x + width]
    red, green, blue = np.moveaxis(part, 2, 0)
    return int(((red > green + 50) & (blue > green + 35)).sum())


def inner_edges(pattern: CreasePattern) -> np.ndarray:
    return np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))


@needs_browser
def test_a_facet_or_crease_of_the_flat_pattern_is_found_under_the_pointer(page: Browser) -> None:
    pattern = sheet()
    a, b, c, d, e, f = page.run(
        "(({a, b, c, d, e, f}) => [a, b, c, d, e, f])"
        '(document.getElementById("flat-pattern").getScreenCTM())'
    )
    # the drawing has its y downwards, and its points about the middle of the pattern
    middle = (pattern.vertices_coords.min(axis=0) + pattern.vertices_coords.max(axis=0)) / 2
    flat = (pattern.vertices_coords - middle) * [1, -1]

    def place(at: np.ndarray) -> tuple[float, float]:
        return float(a * at[0] + c * at[1] + e), float(b * at[0] + d * at[1] + f)

    areas = facet_areas(np.pad(pattern.vertices_coords, ((0, 0), (0, 1))), pattern.faces_vertices)
    for facet in (0, 7, 20, 35):
        told = point(page, *place(flat[pattern.faces_vertices[facet]].mean(axis=0)))
        assert told.startswith(f"Facet {facet}: 4 sides, ")
        area = float(told.split(", ")[1].removesuffix(" mm²"))
        assert area == pytest.approx(areas[facet], rel=1e-3)
    ends = pattern.edges_vertices
    lengths = edge_lengths(pattern.vertices_coords, ends)
    for edge in inner_edges(pattern)[::17]:
        told = point(page, *place(flat[ends[edge]].mean(axis=0)))
        letter = {"M": "mountain", "V": "valley"}[str(pattern.edges_assignment[edge])]
        length = re.match(rf"Crease {edge}: {letter}, ([\d.]+) mm long, folded by ", told)
        assert length is not None, told
        assert float(length[1]) == pytest.approx(lengths[edge], abs=0.06)


@needs_browser
def test_a_facet_or_crease_in_space_is_found_under_the_pointer(page: Browser) -> None:
    pattern = sheet()
    page.run('document.getElementById("forms").children[0].click()')
    x, y, width, height = box(page, "fold-canvas")
    middle = (pattern.vertices_coords.min(axis=0) + pattern.vertices_coords.max(axis=0)) / 2
    flat = pattern.vertices_coords - middle
    # looked at from above: the eye is as far as the widest side needs, and a twentieth more
    wide, high = np.abs(flat).max(axis=0)
    far = max(wide / (HALF_FIELD * width / height), high / HALF_FIELD) * 1.05
    pixels = height / (2 * far * HALF_FIELD)

    def place(at: np.ndarray) -> tuple[float, float]:
        return float(x + width / 2 + at[0] * pixels), float(y + height / 2 - at[1] * pixels)

    for facet in (0, 13, 35):
        at = place(flat[pattern.faces_vertices[facet]].mean(axis=0))
        assert point(page, *at).startswith(f"Facet {facet}: ")
        assert chosen_pixels(page, "flat-pattern") > 20
    for edge in inner_edges(pattern)[5::19]:
        at = place(flat[pattern.edges_vertices[edge]].mean(axis=0))
        assert point(page, *at).startswith(f"Crease {edge}: ")
        assert chosen_pixels(page, "flat-pattern") > 20
        assert chosen_pixels(page, "fold-canvas") > 20
    assert point(page, x + 3, y + 3).startswith("Point at")
    assert chosen_pixels(page, "flat-pattern") == chosen_pixels(page, "fold-canvas") == 0
    page.run('document.getElementById("forms").children[2].click()')


@needs_browser
def test_the_fold_angle_that_is_told_is_that_of_the_frame(page: Browser, folding: Folding) -> None:
    motion = folding.motion
    for frame in (0, 7, 20):
        move(page, frame)
        for edge in inner_edges(motion.pattern)[::23]:
            told = re.search(r"folded by (-?[\d.]+)° now", choose(page, "edge", int(edge)))
            assert told is not None
            side = -1 if motion.pattern.edges_assignment[edge] == "M" else 1
            expected = side * math.degrees(motion.fold_angles[frame, edge])
            assert float(told[1]) == pytest.approx(expected, abs=0.07)
    # what is said to a screen reader is what was chosen, and not each frame of the slider
    said = text(page, "fold-said")
    move(page, 3)
    assert text(page, "fold-said") == said != text(page, "figures")


@needs_browser
def test_keys_walk_through_the_flat_pattern_and_let_go(page: Browser) -> None:
    pattern = sheet()
    choose(page, "facet", 14)
    page.run('document.getElementById("flat-pattern").focus()')

    def press(key: str) -> str:
        named = {"key": key, "code": key, "windowsVirtualKeyCode": 0}
        page.call("Input.dispatchKeyEvent", type="keyDown", **named)
        page.call("Input.dispatchKeyEvent", type="keyUp", **named)
        return text(page, "figures")

    def middle(facet: int) -> np.ndarray:
        return np.asarray(pattern.vertices_coords[pattern.faces_vertices[facet]].mean(axis=0))

    at = 14
    for key, way in {"ArrowRight": (1, 0), "ArrowUp": (0, 1), "ArrowLeft": (-1, 0)}.items():
        found = re.match(r"Facet (\d+): ", press(key))
        assert found is not None
        other = int(found[1])
        step = middle(other) - middle(at)
        assert step @ way > 0.7 * np.linalg.norm(step)
        assert set(pattern.faces_edges[at]) & set(pattern.faces_edges[other]) - {-1}
        at = other
    around = []
    for _ in range(4):
        found = re.match(r"(?:Crease|Edge) (\d+): ", press("Enter"))
        assert found is not None
        around.append(int(found[1]))
    assert sorted(around) == sorted(pattern.faces_edges[at])
    assert press("Delete").startswith("Point at")
    assert text(page, "fold-said") == "Nothing is chosen."


@needs_browser
def test_a_click_keeps_a_facet_and_less_motion_is_a_few_stills(page: Browser) -> None:
    move(page, 10)
    x, y, width, height = box(page, "fold-canvas")
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        told = point(page, x + width / 2, y + height / 2, kind)
    assert told.startswith(("Facet", "Crease"))
    assert point(page, 2, 2).split(":")[0] == told.split(":")[0]
    move(page, 0)
    page.run('document.getElementById("fold-play").click()')
    shown = page.run(
        "new Promise((done) => { const all = []; const look = () => {"
        'all.push(Number(document.getElementById("motion").value));'
        "if (new Set(all).size > 2) done([...new Set(all)]);"
        "else requestAnimationFrame(look); }; look(); })"
    )
    page.run('document.getElementById("fold-play").click()')
    assert shown == [0, 4, 8]  # of 20 frames and 10 steps in which the layers part


@needs_browser
def test_a_finger_chooses_what_it_taps(page: Browser) -> None:
    choose(page, "facet", 0)
    for name in ("fold-canvas", "flat-pattern"):
        page.run('document.getElementById("look-number").value = ""')
        x, y, width, height = box(page, name)
        finger = [{"x": x + width / 2, "y": y + height / 2}]
        page.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=finger)
        page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        number = page.run('document.getElementById("look-number").value')
        assert re.match(rf"(Crease|Facet) {number}: ", text(page, "fold-said")), name


@needs_browser
def test_the_picture_can_take_the_whole_screen(page: Browser) -> None:
    click = 'document.getElementById("fold-full").click()'
    for whole, name in (("fold", "Leave full screen"), (None, "Full screen")):
        changed = 'document.addEventListener("fullscreenchange", done, { once: true })'
        page.call(
            "Runtime.evaluate",
            expression=f"new Promise((done) => {{ {changed}; {click}; }})",
            userGesture=True,
            awaitPromise=True,
        )
        assert page.run("document.fullscreenElement?.id ?? null") == whole
        assert text(page, "fold-full") == name


NODE = shutil.which("node")
TELL = """
const given = JSON.parse(require("fs").readFileSync(0, "utf8"));
const mesh = {
  triangles: Uint32Array.from(given.triangles), owners: Uint32Array.from(given.owners),
  edges: Uint32Array.from(given.edges),
};
Object.assign(mesh, neighbours(mesh.triangles, mesh.owners, mesh.edges));
const loops = outlines(mesh);
const moves = tapers(loops, mesh, given.flat, given.angles);
const made = plates(mesh, loops, moves, given.flat, given.thickness);
console.log(JSON.stringify({
  sides: mesh.sides, loops, thickest: thickest(moves), owners: made.owners,
  moves: moves.map((plies) => plies.map((corners) => corners.map(({ move }) => move))),
  local: Array.from(made.local), corners: made.corners.map((frame) => Array.from(frame)),
}));
"""


@pytest.mark.skipif(NODE is None, reason="no node to run the script")
def test_the_plates_of_the_page_are_the_tapered_panels(tmp_path: Path) -> None:
    assert NODE is not None
    pattern = sheet()
    thickness = 2.0
    panels = thick_panels(pattern, thickness)
    folder = resources.files("miurafab.workflow.page")
    parts = [folder.joinpath(name).read_text("utf-8") for name in ("space.js", "plates.js")]
    script = tmp_path / "plates.cjs"
    script.write_text("".join([*parts, TELL]))
    triangles, owners = triangulate(pattern.faces_vertices, pattern.vertices_coords)
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    given = {
        "triangles": triangles.ravel().tolist(),
        "owners": owners.tolist(),
        "edges": pattern.edges_vertices.ravel().tolist(),
        "flat": flat.ravel().tolist(),
        "angles": pattern.edges_fold_angle.tolist(),
        "thickness": thickness,
    }
    done = subprocess.run(
        [NODE, script], input=json.dumps(given), capture_output=True, text=True, check=True
    )
    told = json.loads(done.stdout)
    assert told["thickest"] == pytest.approx(float(panels.limit_mm.min()))
    for facet, corners in enumerate(pattern.faces_vertices):
        assert set(told["sides"][facet]) == set(pattern.faces_edges[facet])
        loop = told["loops"][facet]
        assert sorted(loop) == sorted(corners)
        for ply in (0, 1):
            found = flat[loop][:, :2] + thickness / 2 * np.array(told["moves"][facet][ply])
            expected = panels.plies[ply][facet][[list(corners).index(v) for v in loop]]
            assert found == pytest.approx(expected, abs=1e-9)
    # each plate is closed: its triangles enclose its volume, by the divergence theorem
    local = np.array(told["local"]).reshape(-1, 3, 3)
    volumes = np.bincount(np.array(told["owners"])[::3], np.linalg.det(local) / 6)
    points, solids, facet_of = panels.solids()
    expected = np.bincount(facet_of[solids[:, 0]], np.linalg.det(points[solids]) / 6)
    assert volumes == pytest.approx(expected, rel=1e-6)  # of float32
