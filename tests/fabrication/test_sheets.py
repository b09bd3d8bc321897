"""The layout as a whole: what is written in layout.json is what the sheets hold."""

from __future__ import annotations

import dataclasses
import json

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, facet_polygons, miura, triangles, without_grid, zigzag
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.errors import LayoutError
from miurafab.fabrication.layout import SCHEMA, read_layout, write_layout
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.sheets import Layout, lay_out
from miurafab.fabrication.toolpath import Toolpath
from miurafab.profiles import OPERATIONS

CUT, PERFORATE = OPERATIONS.index("cut"), OPERATIONS.index("perforate")
MACHINE = bed(210.0, 160.0)
CASES = {
    "one patch": miura(10, 8),
    "miura": miura(20, 16),
    "acute": zigzag(16, 20),
    "fan": flat_patterns.fan(24, 18, radius=250.0),
    "no grid": without_grid(flat_patterns.fan(20, 14, radius=250.0)),
    "ring": triangles(4, 11, 460.0, hole=True),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    """A pattern, its layout, and the parsed layout.json."""
    pattern = CASES[request.param]
    layout = lay_out(pattern, MACHINE, card())
    return pattern, layout, json.loads(write_layout(layout, "pattern.fold", "0" * 64))


def turn(points, degrees) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray(points, dtype=float) @ np.array([[c, s], [-s, c]])


def on_sheet(document):
    """(patch id, sheet number, patch frame to sheet, pattern to sheet) from the JSON alone."""
    patches = {patch["id"]: patch for patch in document["patches"]}
    for number, sheet in enumerate(document["sheets"]):
        for placed in sheet["placements"]:
            patch = patches[placed["patch"]]

            def from_patch(points, placed=placed):
                shift = np.array([placed["x_mm"], placed["y_mm"]])
                return turn(points, placed["rotation_deg"]) + shift

            def from_pattern(points, patch=patch, from_patch=from_patch):
                return from_patch(
                    turn(points - np.array(patch["origin_mm"]), patch["rotation_deg"])
                )

            yield patch, number, from_patch, from_pattern


def test_a_point_of_the_pattern_lies_on_the_sheet_where_the_file_says(case):
    """Every dash lies on its crease, and every outline is cut where the JSON puts it."""
    pattern, layout, document = case
    seen = 0
    for patch, number, from_patch, from_pattern in on_sheet(document):
        toolpath = layout.toolpaths[number]
        dashes = np.flatnonzero((toolpath.operation == PERFORATE) & (toolpath.patch == patch["id"]))
        ends = pattern.vertices_coords[pattern.edges_vertices[toolpath.edge[dashes]]]
        a, b = from_pattern(ends[:, 0]), from_pattern(ends[:, 1])
        way = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
        for points in (toolpath.starts[dashes], toolpath.ends[dashes]):
            off = (points - a)[:, 0] * way[:, 1] - (points - a)[:, 1] * way[:, 0]
            along = np.einsum("ni,ni->n", points - a, way)
            assert np.abs(off).max(initial=0.0) < 1e-4
            assert (along > -1e-6).all()
            assert (along < np.linalg.norm(b - a, axis=1) + 1e-6).all()
        (outline,) = np.flatnonzero(
            (toolpath.operation == CUT) & (toolpath.patch == patch["id"]) & (toolpath.edge == -1)
        )
        cut = shapely.Polygon(toolpath.stroke(outline))
        expected = shapely.Polygon(from_patch(patch["outline_mm"]))
        assert cut.symmetric_difference(expected).area < 1e-3
        assert np.abs(shapely.bounds(cut) - shapely.bounds(expected)).max() < 1e-4
        seen += 1
    assert seen == len(document["patches"])


def test_each_facet_lies_in_its_patch_and_in_no_other(case):
    pattern, _, document = case
    faces = sorted(face for patch in document["patches"] for face in patch["faces"])
    assert faces == list(range(len(pattern.faces_vertices)))
    for patch, _, from_patch, from_pattern in on_sheet(document):
        outline = shapely.Polygon(from_patch(patch["outline_mm"]))
        parts = [
            shapely.Polygon(from_pattern(pattern.vertices_coords[pattern.faces_vertices[face]]))
            for face in patch["faces"]
        ]
        tabs = [shapely.Polygon(from_patch(tab["polygon_mm"])) for tab in patch["tabs"]]
        assert all(outline.contains(part) for part in parts + tabs)
        assert sum(part.area for part in parts + tabs) < outline.area
        assert shapely.union_all(parts + tabs, grid_size=1e-6).buffer(0.2).contains(outline)


def test_the_tabs_of_the_file_lie_in_the_facets_of_their_mates(case):
    pattern, _, document = case
    facets = facet_polygons(pattern)
    home = {face: patch["id"] for patch in document["patches"] for face in patch["faces"]}
    numbers = []
    for patch in document["patches"]:
        for tab in patch["tabs"]:
            points = turn(tab["polygon_mm"], -patch["rotation_deg"]) + patch["origin_mm"]
            shape = shapely.Polygon(points)
            mates = [f for f in pattern.edges_faces[tab["edge"]] if home[f] == tab["mate_patch"]]
            assert any(facets[f].buffer(1e-4).contains(shape) for f in mates)
            assert tab["mate_patch"] != patch["id"]
            numbers.append(tab["number"])
    assert sorted(numbers) == list(range(1, len(numbers) + 1))


def test_each_crease_is_perforated_once_and_each_outline_is_cut_once(case):
    pattern, layout, _ = case
    made: list[tuple[int, int]] = []
    outlines: list[int] = []
    for toolpath in layout.toolpaths:
        dashes = toolpath.operation == PERFORATE
        made += set(
            zip(toolpath.edge[dashes].tolist(), toolpath.patch[dashes].tolist(), strict=True)
        )
        cuts = toolpath.operation == CUT
        outlines += toolpath.patch[cuts].tolist()
        assert (toolpath.edge[cuts] == -1).all()
    folded = np.flatnonzero(np.isin(pattern.edges_assignment, ["M", "V", "U"]))
    expected = np.setdiff1d(folded, layout.untabbed)
    np.testing.assert_array_equal(sorted(edge for edge, _ in made), expected)
    assert sorted(outlines) == list(range(len(layout.patches)))


def test_nothing_lies_outside_the_bed_or_on_another_patch(case):
    _, layout, _ = case
    margin = MACHINE.bed.margin_mm
    for toolpath, sheet in zip(layout.toolpaths, layout.sheets, strict=True):
        assert toolpath.sheet == sheet.name
        low, high = toolpath.points.min(axis=0), toolpath.points.max(axis=0)
        assert (low >= margin - 1e-5).all()
        assert (high <= np.array([300.0, 200.0]) - margin + 1e-5).all()
        rings = np.flatnonzero((toolpath.operation == CUT) & (toolpath.edge == -1))
        shapes = [shapely.Polygon(toolpath.stroke(ring)) for ring in rings]
        for k, shape in enumerate(shapes):
            assert all(shape.distance(other) >= 2.0 - 1e-5 for other in shapes[:k])
        lines = np.array([shapely.LineString(toolpath.stroke(k)) for k in range(len(toolpath))])
        for ring, shape in zip(rings, shapes, strict=True):
            around = shape.buffer(1e-6)
            shapely.prepare(around)
            own = toolpath.patch == toolpath.patch[ring]
            assert shapely.contains(around, lines[own]).all()


def test_nothing_is_burnt_twice(case):
    """No two strokes of one sheet lie nearer than a kerf along more than a point."""
    _, layout, _ = case
    for toolpath in layout.toolpaths:
        lines = np.array([shapely.LineString(toolpath.stroke(k)) for k in range(len(toolpath))])
        engraved = toolpath.operation == OPERATIONS.index("engrave")
        lines = lines[~engraved]
        one, other = shapely.STRtree(lines).query(lines, predicate="intersects")
        assert (one == other).all()


def test_totals_are_the_sums_of_the_parts(case):
    pattern, layout, _ = case
    totals = layout.totals
    assert totals.patches == len(layout.patches)
    assert totals.sheets == len(layout.sheets) == len(layout.toolpaths)
    assert totals.tabs == sum(len(patch.tabs) for patch in layout.patches)
    cut = sum(shapely.Polygon(patch.outline_mm).length for patch in layout.patches)
    assert totals.cut_mm == pytest.approx(cut, rel=1e-6)
    assert 0.0 < totals.density <= 1.0
    home = np.empty(len(pattern.faces_vertices), dtype=int)
    for patch in layout.patches:
        home[patch.faces] = patch.id
    seam = [
        np.linalg.norm(np.diff(pattern.vertices_coords[ends], axis=0))
        for ends, (f, g) in zip(pattern.edges_vertices, pattern.edges_faces, strict=True)
        if f >= 0 and g >= 0 and home[f] != home[g]
    ]
    assert totals.seam_mm == pytest.approx(sum(seam))


def test_the_file_reads_back_as_it_was_written(case):
    _, layout, document = case
    text = write_layout(layout, "pattern.fold", "0" * 64)
    assert document["schema"] == SCHEMA == "miurafab-layout/1"
    assert document["pattern"] == {"file": "pattern.fold", "sha256": "0" * 64}
    assert set(document["totals"]) == {
        "patches", "sheets", "seam_mm", "tabs", "density", "cut_mm", "perforated_mm",
        "travel_mm", "seconds", "sheets_bound", "border_tabs",
    }  # fmt: skip
    again = read_layout(text)
    assert again.sheets == layout.sheets
    assert again.totals == layout.totals
    assert type(again) is Layout, "a file holds no toolpaths"
    assert write_layout(again, "pattern.fold", "0" * 64) == text


def test_the_same_input_gives_the_same_bytes(case):
    pattern, layout, _ = case
    again = lay_out(pattern, MACHINE, card())
    assert write_layout(again, "p", "s") == write_layout(layout, "p", "s")
    for one, other in zip(again.toolpaths, layout.toolpaths, strict=True):
        assert one.points.tobytes() == other.points.tobytes()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("{", "not valid JSON"),
        ("[]", "schema is None"),
        ('{"schema": "miurafab-layout/9"}', "'miurafab-layout/9'"),
        ('{"schema": "miurafab-layout/1"}', "lacks 'machine'"),
    ],
)
def test_a_file_that_is_no_layout_is_refused(text, complaint):
    with pytest.raises(LayoutError, match=complaint):
        read_layout(text)


@pytest.mark.parametrize("wrong", [3, [[1, 2, 3]], [["a", "b"]]])
def test_a_layout_with_a_broken_value_is_refused(wrong):
    document = json.loads(write_layout(lay_out(miura(3, 3), MACHINE, card()), "p", "s"))
    document["patches"][0]["outline_mm"] = wrong
    with pytest.raises(LayoutError, match="is not a layout"):
        read_layout(json.dumps(document))


@pytest.mark.parametrize(
    ("part", "key", "wrong", "words"),
    [
        ("patches", "label", "P1\n", "is not a plain text"),
        ("tabs", "mate_patch", "P2", "'P2' is no mate of a tab"),
        ("tabs", "mate_edge", True, "True is no mate of a tab"),
    ],
)
def test_a_layout_with_a_wrong_name_or_mate_is_refused(part, key, wrong, words):
    options = LayoutOptions(seam_columns=(2,))
    layout = lay_out(miura(5, 3), MACHINE, card(), options=options)
    document = json.loads(write_layout(layout, "p", "s"))
    tabs = [tab for patch in document["patches"] for tab in patch["tabs"]]
    {**document, "tabs": tabs}[part][0][key] = wrong
    with pytest.raises(LayoutError, match=f"is not a layout that .*{words}"):
        read_layout(json.dumps(document))


def test_a_path_of_no_strokes_travels_nowhere():
    codes = np.zeros(0, dtype=np.int64)
    path = Toolpath("s", 9.0, 9.0, np.empty((0, 2)), np.zeros(1, dtype=np.int64), *[codes] * 3)
    assert path.travel_mm == 0.0
    assert path.length_of("cut") == 0.0


def test_flat_edges_and_joins_are_not_perforated():
    pattern = miura(6, 6)
    kinds = pattern.edges_assignment.copy()
    inner = np.flatnonzero(kinds != "B")
    kinds[inner[::3]], kinds[inner[1::3]] = "F", "J"
    flat = dataclasses.replace(pattern, edges_assignment=kinds)
    (toolpath,) = lay_out(flat, MACHINE, card()).toolpaths
    perforated = np.unique(toolpath.edge[toolpath.operation == PERFORATE])
    np.testing.assert_array_equal(perforated, inner[2::3])


def test_many_small_patches_share_a_sheet():
    layout = lay_out(miura(30, 1, 12.0, 12.0), bed(200.0, 150.0), card())
    assert layout.totals.patches > layout.totals.sheets == 1


def random_pattern(seed: int, columns: int, rows: int, shake: float, gridded: bool):
    rng = np.random.default_rng(seed)
    i, j = np.indices((rows + 1, columns + 1))
    zigzag = (i % 2) * rng.uniform(-0.8, 0.8)
    points = np.stack([j + zigzag, i * rng.uniform(0.4, 1.5)], axis=-1)
    points += rng.uniform(-shake, shake, points.shape)
    pattern = flat_patterns.grid(points * rng.uniform(5.0, 60.0))
    return pattern if gridded else without_grid(pattern)


@settings(derandomize=True, max_examples=20, deadline=None)
@given(
    st.integers(0, 10_000),
    st.integers(1, 8),
    st.integers(1, 8),
    st.floats(0.0, 0.35),
    st.booleans(),
    st.tuples(st.floats(40.0, 400.0), st.floats(40.0, 400.0), st.floats(0.0, 15.0)),
    st.tuples(st.floats(0.1, 4.0), st.floats(0.1, 4.0), st.floats(0.0, 3.0), st.floats(0.0, 3.0)),
    st.tuples(st.floats(0.5, 30.0), st.floats(0.0, 2.0), st.floats(0.0, 0.5)),
)
def test_random_patterns_beds_and_materials_give_a_sound_layout_or_a_clear_refusal(
    seed, columns, rows, shake, gridded, size, dashes, glue
):
    pattern = random_pattern(seed, columns, rows, shake, gridded)
    machine = bed(*size)
    cut, gap, end_bridge, min_end = dashes
    tab, inset, kerf = glue
    material = card(cut, gap, end_bridge, min_end, tab, inset, kerf)
    try:
        layout = lay_out(pattern, machine, material)
    except LayoutError as refusal:
        text = str(refusal)
        assert text.startswith(("Facet ", "The material "))
        assert text.endswith(".")
        assert "\n" not in text
        return
    case = (pattern, layout, json.loads(write_layout(layout, "p", "s")))
    test_a_point_of_the_pattern_lies_on_the_sheet_where_the_file_says(case)
    test_each_crease_is_perforated_once_and_each_outline_is_cut_once(case)
    test_the_tabs_of_the_file_lie_in_the_facets_of_their_mates(case)
    for toolpath in layout.toolpaths:
        low, high = toolpath.points.min(axis=0), toolpath.points.max(axis=0)
        assert (low >= size[2] - 1e-5).all()
        assert (high <= np.array(size[:2]) - size[2] + 1e-5).all()


def test_offcuts_are_used_up_before_whole_sheets():
    pattern = miura(18, 14, 14.0, 14.0)
    small = (120.0, 90.0)
    options = LayoutOptions(offcuts_mm=((240.0, 180.0), (12.0, 11.0)), max_patch_mm=small)
    layout = lay_out(pattern, bed(260.0, 200.0), card(), options=options)
    sizes = [(sheet.width_mm, sheet.height_mm) for sheet in layout.sheets]
    assert sizes[0] == (240.0, 180.0)
    assert set(sizes[1:]) <= {(260.0, 200.0)}
    assert len(sizes) > 1
    for sheet, toolpath in zip(layout.sheets, layout.toolpaths, strict=True):
        assert (toolpath.width_mm, toolpath.height_mm) == (sheet.width_mm, sheet.height_mm)
        assert (toolpath.points >= 5.0 - 0.2).all()
        assert (toolpath.points <= np.array([sheet.width_mm, sheet.height_mm]) - 5.0 + 0.2).all()
    assert 0 < layout.totals.density < 1
    with pytest.raises(LayoutError, match="off-cut of 12 mm x 9 mm' leaves nothing"):
        lay_out(
            pattern, bed(260.0, 200.0), card(), options=LayoutOptions(offcuts_mm=((12.0, 9.0),))
        )
