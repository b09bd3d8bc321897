"""The drawings, read back by a reader of their own."""

from __future__ import annotations

import dataclasses
import io
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import resvg_py
from flat_patterns import bed, card, fan, miura, triangles, zigzag
from piece_problems import gores
from PIL import Image

from miurafab.fabrication.drawing.layers import LAYERS, layers_of
from miurafab.fabrication.drawing.pdf import draw_for_people
from miurafab.fabrication.drawing.svg import layout_svg, sheet_svg
from miurafab.fabrication.drawing.svg_canvas import SvgCanvas
from miurafab.fabrication.drawing.views import edge_letters
from miurafab.fabrication.sheets import lay_out
from miurafab.origami.picture import CREASES, flat_svg
from miurafab.origami.seam_lines import SEAM_WORDS, seam_lines
from miurafab.profiles import OPERATIONS
from miurafab.profiles.material import CREASE_KINDS, MODES, Crease

SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"


def strokes_of(path: str) -> list[np.ndarray]:
    """The polylines of a path that uses M, L and Z alone."""
    assert re.fullmatch(r"[MLZ0-9.\- ]+", path), path[:80]
    found = []
    for part in path.split("M")[1:]:
        points = [[float(n) for n in point.split()] for point in part.rstrip("Z").split("L")]
        if part.endswith("Z"):
            points.append(points[0])
        found.append(np.array(points))
    return found


@pytest.fixture(scope="module", params=["miura", "acute", "fan"])
def drawn(request):
    """A toolpath and the assignments of the edges of its pattern."""
    make = {"miura": miura(12, 12), "acute": zigzag(12, 14), "fan": fan(20, 14, radius=250.0)}
    pattern = make[request.param]
    layout = lay_out(pattern, bed(300.0, 200.0), card())
    return layout.toolpaths[0], edge_letters(layout, pattern)


def test_a_sheet_is_true_to_scale(drawn):
    root = ElementTree.fromstring(sheet_svg(*drawn))
    assert root.get("width") == "300mm"
    assert root.get("height") == "200mm"
    assert root.get("viewBox") == "0 0 300 200"


def test_mountains_and_valleys_of_an_operation_are_layers_of_their_own(drawn):
    toolpath, letters = drawn
    root = ElementTree.fromstring(sheet_svg(toolpath, letters))
    layers = list(root.iter(SVG + "g"))
    labels = [layer.get(INKSCAPE + "label") for layer in layers]
    assert labels == ["engrave", "perforate-mountain", "perforate-valley", "cut"]
    assert labels == [layer.get("id") for layer in layers]
    assert all(layer.get(INKSCAPE + "groupmode") == "layer" for layer in layers)
    colours = ["#000000", "#0000FF", "#FF00FF", "#FF0000"]
    assert [layer.get("stroke") for layer in layers] == colours
    perforated = toolpath.operation == OPERATIONS.index("perforate")
    for layer, letter in zip(layers[1:3], "MV", strict=True):
        own = perforated & (letters[toolpath.edge] == letter)
        assert sum(path.get("d").count("M") for path in layer) == own.sum() > 0


@pytest.mark.parametrize("mode", MODES[:3])
def test_every_layer_of_a_drawing_is_of_one_fold(mode):
    pattern = miura(4, 4)
    material = dataclasses.replace(card(), creases={kind: Crease(mode) for kind in CREASE_KINDS})
    (path,) = lay_out(pattern, bed(300.0, 200.0), material).toolpaths
    layers = [LAYERS[k] for k in layers_of(path, pattern.edges_assignment).tolist()]
    for k, layer in enumerate(layers):
        assert layer.operation == OPERATIONS[path.operation[k]]
        edge = path.edge[k]
        assert layer.fold == (pattern.edges_assignment[edge] if edge >= 0 else "")
    assert {layer.fold for layer in layers} == {"M", "V", ""}
    assert len({layer.colour for layer in LAYERS}) == len({layer.name for layer in LAYERS})


def test_the_drawing_holds_the_same_strokes_in_the_same_order_on_each_layer(drawn):
    toolpath, letters = drawn
    root = ElementTree.fromstring(sheet_svg(toolpath, letters))
    found = {
        layer.get("id"): [stroke for path in layer for stroke in strokes_of(path.get("d"))]
        for layer in root.iter(SVG + "g")
    }
    for number, layer in enumerate(LAYERS):
        own = np.flatnonzero(layers_of(toolpath, letters) == number).tolist()
        assert len(own) == len(found.get(layer.name, []))
        for k, stroke in zip(own, found.get(layer.name, []), strict=True):
            # y runs down in the drawing and up on the sheet.
            made = stroke * [1.0, -1.0] + [0.0, 200.0]
            np.testing.assert_allclose(made, toolpath.stroke(k), atol=1e-4)


def test_each_crease_and_each_outline_is_one_path(drawn):
    toolpath, letters = drawn
    root = ElementTree.fromstring(sheet_svg(toolpath, letters))
    paths = {layer.get("id"): len(layer) for layer in root.iter(SVG + "g")}
    perforated = toolpath.operation == OPERATIONS.index("perforate")
    creases = paths["perforate-mountain"] + paths["perforate-valley"]
    assert creases == len(np.unique(toolpath.edge[perforated]))
    assert paths["cut"] == (toolpath.operation == OPERATIONS.index("cut")).sum()


def test_no_dashed_style_is_used(drawn):
    assert "dasharray" not in sheet_svg(*drawn)


def test_the_same_toolpath_gives_the_same_bytes(drawn):
    assert sheet_svg(*drawn) == sheet_svg(*drawn)


def grey(svg, dots_mm, width_mm):
    """The picture of ``svg`` in grey, 0 black, row 0 at the bottom."""
    pixels = round(dots_mm * width_mm)
    png = resvg_py.svg_to_bytes(svg_string=svg, width=pixels, background="#ffffff")
    return np.asarray(Image.open(io.BytesIO(bytes(png))).convert("L"), dtype=int)[::-1]


def seen(image, points):
    """The grey of the pixels at ``points`` (n, 2), counted in pixels."""
    at = points.astype(int)
    return image[at[:, 1], at[:, 0]]


def test_in_a_grey_print_of_a_sheet_valleys_are_wider():
    pattern = miura(4, 3)
    layout = lay_out(pattern, bed(100.0, 80.0), card())
    (path,) = layout.toolpaths
    letters = pattern.edges_assignment
    svg = re.sub(r'(width|height)="(\d+)mm"', r'\1="\2"', sheet_svg(path, letters))
    image = grey(svg, 40, 100.0)
    widths = {"M": [], "V": []}
    for k in np.flatnonzero(path.operation == OPERATIONS.index("perforate")).tolist():
        a, b = path.stroke(k)
        across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        places = (a + b) / 2 + np.linspace(-0.4, 0.4, 65)[:, None] * across
        widths[str(letters[path.edge[k]])].append((seen(image, places * 40) < 200).sum())
    assert min(widths["V"]) > 1.6 * max(widths["M"]) > 0


@pytest.mark.parametrize("drawing", ["picture", "guide"])
def test_in_a_grey_print_for_people_valleys_are_dashed_and_mountains_are_not(drawing):
    pattern = miura(4, 3)
    layout = lay_out(pattern, bed(100.0, 80.0), card())
    (path,), letters = layout.toolpaths, pattern.edges_assignment
    if drawing == "picture":
        points = pattern.vertices_coords
        size = np.ptp(points, axis=0)
        svg = layout_svg(pattern, layout)
        _, _, width, height = map(float, re.search(r'viewBox="(.*?)"', svg)[1].split())
        low = points.min(axis=0) - 0.02 * size.max()
        below = height - size[1] - 0.04 * size.max()
        ends = points[pattern.edges_vertices] - low + [0.0, below]
        edges = np.flatnonzero(np.isin(letters, ["M", "V"]))
        lines = [(str(letters[edge]), ends[edge]) for edge in edges.tolist()]
    else:
        canvas, width = SvgCanvas(), 100.0
        draw_for_people(canvas, path, letters)
        svg = canvas.text(0, 0, 100, 80, "guide")
        creases = np.unique(path.edge[path.operation == OPERATIONS.index("perforate")])
        own = [np.flatnonzero(path.edge == edge) for edge in creases]
        lines = [
            (str(letters[path.edge[k[0]]]), np.stack([path.starts[k[0]], path.ends[k[-1]]]))
            for k in own
        ]
    dots = 30 if drawing == "guide" else 1200 / width
    # The renderer rounds a size to whole pixels.
    svg = re.sub(r'="([\d.]+)mm"', lambda size: f'="{100 * float(size[1])}"', svg)
    image = grey(svg, dots, width)
    assert {letter for letter, _ in lines} == {"M", "V"}
    for letter, (a, b) in lines:
        along = a + np.linspace(0.1, 0.9, 200)[:, None] * (b - a)
        # The coordinates of the picture are rounded to two pixels.
        near = [
            seen(image, along * dots + [0, up]) for up in ((-2, 0, 2) if width == 100 else (0,))
        ]
        ink = (np.min(near, axis=0) < 160).mean()
        # The name of the patch may hide some of a line.
        assert ink > 0.85 if letter == "M" else 0.3 < ink < 0.75


@pytest.mark.parametrize("pattern", [miura(6, 5), triangles(1, 6, 200.0)])
def test_the_picture_of_a_layout_shows_every_edge_once(pattern):
    layout = lay_out(pattern, bed(400.0, 400.0), card())
    root = ElementTree.fromstring(layout_svg(pattern, layout))
    # A unit of the drawing is a millimetre.
    size = [float(root.get(side).removesuffix("mm")) for side in ("width", "height")]
    assert size == [float(side) for side in root.get("viewBox").split()[2:]]
    shown = {
        path.get("id"): len(strokes_of(path.get("d")))
        for path in root.iter(SVG + "path")
        if path.get("id")
    }
    for name, letter in (("mountain", "M"), ("valley", "V"), ("border", "B")):
        assert shown[name] == (pattern.edges_assignment == letter).sum()
    _, _, width, height = (float(n) for n in root.get("viewBox").split())
    tall = np.ptp(pattern.vertices_coords, axis=0)
    assert width == pytest.approx(tall[0] + 0.04 * tall.max(), abs=1e-3)
    legend = [text.text for text in root.iter(SVG + "text")][-3:]
    assert legend == ["mountain", "valley", "border"]
    below = (2 * len(legend) + 1) * tall.max() / 45
    assert height == pytest.approx(tall[1] + 0.04 * tall.max() + below, abs=1e-3)


def test_the_picture_of_a_layout_shows_both_sides_of_a_seam_with_one_number():
    pattern = gores()
    root = ElementTree.fromstring(layout_svg(pattern, lay_out(pattern, bed(400, 400), card())))
    texts = [text.text for text in root.iter(SVG + "text")]
    assert sorted(t for t in texts if t.isdecimal()) == sorted("11223344")
    assert texts[-4:] == ["mountain", "valley", "border", SEAM_WORDS]
    shown = {path.get("id"): path for path in root.iter(SVG + "path") if path.get("id")}
    lines = seam_lines(pattern)
    for line in lines:
        path = shown[f"seam-{line.number}"]
        assert path.get("stroke") == line.colour
        assert len(strokes_of(path.get("d"))) == 2 * len(line.edges)
    border = (pattern.edges_assignment == "B").sum()
    sides = sum(line.edges.size for line in lines)
    assert len(strokes_of(shown["border"].get("d"))) == border - sides


def test_the_picture_of_a_pattern_shows_every_edge_once():
    pattern = miura(6, 5)
    root = ElementTree.fromstring(flat_svg(pattern, 640.0))
    shown = {path.get("stroke"): path.get("d").count("M") for path in root.iter(SVG + "path")}
    for letter in "MVB":
        assert shown[CREASES[letter]] == (pattern.edges_assignment == letter).sum()


def test_the_picture_of_a_layout_names_its_patches():
    pattern = miura(20, 18)
    layout = lay_out(pattern, bed(200.0, 150.0), card())
    root = ElementTree.fromstring(layout_svg(pattern, layout))
    names = [text.text for text in root.iter(SVG + "text")][:-3]
    # Each with a rim of its own below: many programs do not know paint-order.
    assert names == [patch.label for patch in layout.patches for _ in range(2)]
    assert [text.get("stroke") for text in root.iter(SVG + "text")][:2] == ["#ffffff", None]
