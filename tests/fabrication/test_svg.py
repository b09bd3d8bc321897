"""The drawings, read back by a reader of their own."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from flat_patterns import bed, card, fan, miura, triangles, zigzag

from miurafab.fabrication.drawing.svg import COLOURS, layout_svg, sheet_svg
from miurafab.fabrication.sheets import lay_out
from miurafab.origami.picture import CREASES, flat_svg
from miurafab.profiles import OPERATIONS

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
def toolpath(request):
    pattern = {"miura": miura(12, 12), "acute": zigzag(24, 30), "fan": fan(30, 20, radius=250.0)}
    return lay_out(pattern[request.param], bed(300.0, 200.0), card()).toolpaths[0]


def test_a_sheet_is_true_to_scale(toolpath):
    root = ElementTree.fromstring(sheet_svg(toolpath))
    assert root.get("width") == "300mm"
    assert root.get("height") == "200mm"
    assert root.get("viewBox") == "0 0 300 200"


def test_there_is_one_layer_an_operation_with_its_name_and_colour(toolpath):
    root = ElementTree.fromstring(sheet_svg(toolpath))
    layers = list(root.iter(SVG + "g"))
    assert [layer.get(INKSCAPE + "label") for layer in layers] == list(OPERATIONS)
    assert all(layer.get(INKSCAPE + "groupmode") == "layer" for layer in layers)
    assert [layer.get("stroke") for layer in layers] == [COLOURS[name] for name in OPERATIONS]
    assert COLOURS == {
        "engrave": "#000000", "score": "#00E000", "perforate": "#0000FF", "cut": "#FF0000",
    }  # fmt: skip


def test_the_drawing_holds_the_same_strokes_in_the_same_order(toolpath):
    root = ElementTree.fromstring(sheet_svg(toolpath))
    drawn = [
        (operation, stroke)
        for operation, layer in enumerate(root.iter(SVG + "g"))
        for path in layer
        for stroke in strokes_of(path.get("d"))
    ]
    assert len(drawn) == len(toolpath)
    for k, (operation, stroke) in enumerate(drawn):
        assert operation == toolpath.operation[k]
        # y runs down in the drawing and up on the sheet.
        made = stroke * [1.0, -1.0] + [0.0, 200.0]
        np.testing.assert_allclose(made, toolpath.stroke(k), atol=1e-4)


def test_each_crease_and_each_outline_is_one_path(toolpath):
    root = ElementTree.fromstring(sheet_svg(toolpath))
    paths = {layer.get("id"): len(layer) for layer in root.iter(SVG + "g")}
    perforated = toolpath.operation == OPERATIONS.index("perforate")
    assert paths["perforate"] == len(np.unique(toolpath.edge[perforated]))
    assert paths["cut"] == (toolpath.operation == OPERATIONS.index("cut")).sum()


def test_no_dashed_style_is_used(toolpath):
    assert "dasharray" not in sheet_svg(toolpath)


def test_the_same_toolpath_gives_the_same_bytes(toolpath):
    assert sheet_svg(toolpath) == sheet_svg(toolpath)


@pytest.mark.parametrize("pattern", [miura(6, 5), triangles(1, 6, 200.0)])
def test_the_picture_of_a_layout_shows_every_edge_once(pattern):
    layout = lay_out(pattern, bed(400.0, 400.0), card())
    root = ElementTree.fromstring(layout_svg(pattern, layout))
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


def test_the_picture_of_a_pattern_shows_every_edge_once():
    pattern = miura(6, 5)
    root = ElementTree.fromstring(flat_svg(pattern, 640.0))
    shown = {path.get("stroke"): path.get("d").count("M") for path in root.iter(SVG + "path")}
    for letter in "MVB":
        assert shown[CREASES[letter]] == (pattern.edges_assignment == letter).sum()


def test_the_picture_of_a_layout_names_its_patches():
    pattern = miura(30, 26)
    layout = lay_out(pattern, bed(200.0, 150.0), card())
    root = ElementTree.fromstring(layout_svg(pattern, layout))
    names = [text.text for text in root.iter(SVG + "text")][:-3]
    # Each with a rim of its own below: many programs do not know paint-order.
    assert names == [patch.label for patch in layout.patches for _ in range(2)]
    assert [text.get("stroke") for text in root.iter(SVG + "text")][:2] == ["#ffffff", None]
