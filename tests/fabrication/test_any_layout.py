"""Whatever is asked for: a valid layout, or a refusal in one clear sentence."""

from __future__ import annotations

import json
import re
from dataclasses import fields, replace

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import bed, facet_polygons, triangles, without_grid
from gcode_reader import read_strokes
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from readers import assert_same, read_dxf, read_hpgl, read_pdf, read_svg
from rings import revolved, tube
from travel_bound import travel_bound

from miurafab.errors import LayoutError
from miurafab.fabrication.drawing.dxf import VERSIONS, sheet_dxf
from miurafab.fabrication.drawing.hpgl import UNITS_PER_MM, sheet_hpgl
from miurafab.fabrication.drawing.pdf import sheets_pdf
from miurafab.fabrication.drawing.svg import sheet_svg
from miurafab.fabrication.layout import read_layout, write_layout
from miurafab.fabrication.options import TAB_SIDES, LayoutOptions, NestingOptions
from miurafab.fabrication.partition.fit_box import best_turn
from miurafab.fabrication.seams import all_seams
from miurafab.fabrication.sheets import lay_out
from miurafab.posting import post
from miurafab.profiles import OPERATIONS, load_machine
from miurafab.profiles.material import (
    CREASE_KINDS,
    FITS,
    MODES,
    START_ENDS,
    Crease,
    Material,
    Perforation,
    TabRule,
)

CUT = OPERATIONS.index("cut")
MARGIN_MM = 5.0


def ring():
    return revolved("4x8", "140mm")


def small_tube():
    return tube(8, 5, 25.0)


def sizes(low, high):
    return st.floats(low, high).map(lambda x: round(x, 2))


@st.composite
def patterns(draw):
    """Shaken grids with and without their grid told, triangulations, rings and tubes."""
    kind = draw(st.sampled_from(["grid", "grid", "no grid", "triangles", "ring"]))
    seed = draw(st.integers(0, 10_000))
    if kind == "triangles":
        holed = draw(st.booleans())
        return triangles(seed, draw(st.integers(4, 7)), draw(sizes(60.0, 300.0)), hole=holed)
    if kind == "ring":
        return draw(st.sampled_from([ring, small_tube]))()
    rng = np.random.default_rng(seed)
    rows, columns = draw(st.integers(1, 7)), draw(st.integers(1, 7))
    i, j = np.indices((rows + 1, columns + 1))
    points = np.stack([j + (i % 2) * rng.uniform(-0.8, 0.8), i * rng.uniform(0.4, 1.5)], axis=-1)
    points += rng.uniform(-1, 1, points.shape) * draw(sizes(0.0, 0.3))
    pattern = flat_patterns.grid(points * draw(sizes(5.0, 60.0)))
    if draw(st.booleans()):
        letters = pattern.edges_assignment.copy()
        inner = letters != "B"
        letters[inner] = rng.choice(list("MVMVUFJ"), inner.sum())
        pattern = replace(pattern, edges_assignment=letters)
    return pattern if kind == "grid" else without_grid(pattern)


@st.composite
def materials(draw):
    """Any that the profile reader lets through."""
    kerf = draw(sizes(0.0, 0.5))

    def dashes():
        return Perforation(
            draw(sizes(0.1, 4.0)), draw(sizes(0.1, 4.0)), draw(sizes(0.0, 3.0)),
            draw(sizes(0.0, 3.0)), draw(st.sampled_from(START_ENDS)), draw(st.sampled_from(FITS)),
        )  # fmt: skip

    def crease():
        mode, own = draw(st.sampled_from(MODES)), draw(st.none() | st.just(1))
        perforation = None if own is None else dashes()
        if mode == "cut":
            perforation = replace(perforation or dashes(), end_bridge_mm=0.6, start_end="bridge")
        return Crease(mode, perforation)

    return Material(
        name="any",
        title="Any",
        thickness_mm=0.3,
        kerf_mm=kerf,
        perforation=dashes(),
        tabs=TabRule(draw(sizes(0.5, 30.0)), draw(sizes(0.0, 2.0))),
        beams=flat_patterns.card().beams,
        creases={kind: crease() for kind in CREASE_KINDS},
        relief_hole_mm=draw(st.just(0.0) | sizes(kerf + 0.11, 2.0)),
    )


@st.composite
def all_options(draw):
    """Every field of the options, with the stock of the bed."""
    lines = st.lists(st.integers(1, 7), max_size=2, unique=True).map(lambda n: tuple(sorted(n)))
    pair = st.tuples(sizes(20.0, 300.0), sizes(20.0, 300.0)).map(lambda p: (max(p), min(p)))
    bridges = draw(st.sampled_from([0, 0, 2, 3, 5]))
    given_ = LayoutOptions(
        gap_mm=draw(sizes(0.0, 5.0)),
        offcuts_mm=tuple(draw(st.lists(pair, max_size=1))),
        max_patch_mm=draw(st.none() | pair),
        seam_rows=draw(st.just(()) | lines),
        seam_columns=draw(st.just(()) | lines),
        open_row=draw(st.sampled_from([None] * 15 + [1, 2, 5])),
        open_column=draw(st.sampled_from([None] * 20 + [2])),
        tab_height_mm=draw(st.none() | sizes(0.5, 20.0)),
        tab_inset_mm=draw(st.none() | sizes(0.0, 2.0)),
        tab_angle=draw(st.none() | sizes(0.2, 3.14)),
        tab_side=draw(st.sampled_from(TAB_SIDES)),
        full_facet=draw(st.booleans()),
        two_sided=draw(st.booleans()),
        bridges=bridges,
        bridge_mm=draw(sizes(0.1, 3.0)) if bridges else 0.5,
        spread_heat=draw(st.booleans()),
        nesting=NestingOptions(
            quantity=draw(st.sampled_from([1, 1, 2])),
            margin_mm=draw(st.none() | sizes(0.0, 12.0)),
            rotations=draw(st.sampled_from([(0, 90, 180, 270), (0, 180), (0,)])),
        ),
    )
    drawn = {each.name for each in fields(LayoutOptions)}
    assert drawn == set(vars(given_)), "a new option is drawn here, too"
    return given_


BEDS = st.tuples(sizes(60.0, 400.0), sizes(60.0, 400.0))


def usable_of(machine, options):
    margin = options.nesting.margin_mm
    margin = machine.bed.margin_mm if margin is None else margin
    return machine.bed.width_mm - 2 * margin, machine.bed.height_mm - 2 * margin


def assert_refusal_is_clear(text, pattern, usable):
    assert re.fullmatch(r"[A-Z].*[^.]\.", text), text
    assert "\n" not in text
    assert "Traceback" not in text
    named = re.match(r"Facet (\d+) measures", text)
    if named:
        # Where no turn is left free the facet may fit the bed turned, and not as it must lie.
        assert int(named[1]) < len(pattern.faces_vertices)
        assert "mm x" in text


def carried(points, start, end, to_start, to_end):
    along, to = complex(*(end - start)), complex(*(to_end - to_start))
    moved = (points - start) @ [1, 1j] * (to / along) + complex(*to_start)
    return np.column_stack([moved.real, moved.imag])


def ends_of(pattern, edge, face):
    corners = [v for v in pattern.faces_vertices[face].tolist() if v >= 0]
    at = pattern.faces_edges[face].tolist().index(edge)
    return pattern.vertices_coords[[corners[at], corners[(at + 1) % len(corners)]]]


def assert_tabs(pattern, layout):
    """Each in the facet that it is glued to, off its own patch and every other tab of it."""
    facets = facet_polygons(pattern)
    home = np.empty(len(facets), dtype=int)
    model = layout.model.patches
    for patch in model:
        home[patch.faces] = patch.id
    told = {(tab.edge, tab.mate_edge) for patch in model for tab in patch.tabs}
    assert len(told) == sum(len(patch.tabs) for patch in model)
    seams = all_seams(pattern, home)
    wanted = {frozenset(pair) for pair in seams.edges.tolist()}
    found = {frozenset(pair) for pair in told}
    assert found <= wanted
    assert {min(pair) for pair in wanted - found} <= set(layout.untabbed) | {
        min(p) for p in wanted if set(layout.untabbed) & p
    }
    assert len(wanted - found) == len(layout.untabbed)
    for patch in model:
        body = shapely.union_all(facets[patch.faces], grid_size=1e-9)
        turn = np.radians(patch.rotation_deg)
        matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        shapes = []
        for tab in patch.tabs:
            points = tab.polygon_mm @ matrix + patch.origin_mm
            own = next(f for f in pattern.edges_faces[tab.edge] if f >= 0 and home[f] == patch.id)
            mate = next(
                f
                for f in pattern.edges_faces[tab.mate_edge]
                if f >= 0 and home[f] == tab.mate_patch and (f != own or tab.edge == tab.mate_edge)
            )
            shape = shapely.Polygon(points)
            assert shape.is_valid
            there = points
            if tab.edge != tab.mate_edge:
                (a, b), (c, d) = (
                    ends_of(pattern, tab.edge, own),
                    ends_of(pattern, tab.mate_edge, mate),
                )
                there = carried(points, a, b, d, c)
            assert facets[mate].buffer(2e-5).contains(shapely.Polygon(there))
            assert shapely.intersection(shape, body, grid_size=1e-6).area < 1e-4 * shape.length
            shapes.append(shape)
        if len(shapes) > 1:
            tree = shapely.STRtree(shapes)
            one, other = tree.query(shapes, predicate="intersects")
            for k, m in zip(one.tolist(), other.tolist(), strict=True):
                if k < m:
                    common = shapely.intersection(shapes[k], shapes[m], grid_size=1e-6)
                    assert common.area < 1e-6


def assert_strokes(pattern, material, options, layout):
    """Each crease and each outline made exactly once, where the layout says."""
    count = len(layout.model.patches)
    home = np.empty(len(pattern.faces_vertices), dtype=int)
    for patch in layout.model.patches:
        home[patch.faces] = patch.id
    sides = pattern.edges_faces
    inner = (sides >= 0).all(axis=1) & (home[sides[:, 0]] == home[sides[:, 1]])
    expected = set()
    for edge in np.flatnonzero(inner & np.isin(pattern.edges_assignment, ["M", "V", "U"])).tolist():
        kind = "valley" if pattern.edges_assignment[edge] == "V" else "mountain"
        if material.creases[kind].mode != "none":
            expected.add((edge, int(home[sides[edge, 0]])))
    if material.creases["tab"].mode != "none":
        for patch in layout.model.patches:
            expected |= {
                (t.edge, patch.id)
                for t in patch.tabs
                if t.fold in ("mountain", "valley", "unassigned")
            }
    made: dict[tuple[int, int], list] = {}
    outlines: dict[int, list] = {}
    for path in layout.passes:
        back = path.sheet.endswith("-back")
        for k in range(len(path)):
            points = path.stroke(k) * ([-1.0, 1.0] if back else [1.0, 1.0])
            points = points + ([path.width_mm, 0.0] if back else [0.0, 0.0])
            patch, edge = int(path.patch[k]), int(path.edge[k])
            if edge >= 0 and len(points) == 2:
                made.setdefault((edge, patch), []).append(points)
            elif edge < 0 and path.operation[k] == CUT and patch >= 0:
                outlines.setdefault(patch, []).append(points)
    whole = {(edge, patch + count * c) for edge, patch in expected for c in range(layout.copies)}
    assert set(made) == whole
    placed = {p.patch: p for sheet in layout.sheets for p in sheet.placements}
    assert sorted(placed) == sorted(outlines) == list(range(len(layout.patches)))
    for (edge, patch), pieces in made.items():
        ends = pattern.vertices_coords[pattern.edges_vertices[edge]]
        a, b = placed[patch].from_patch(layout.patches[patch].from_pattern(ends))
        length = np.linalg.norm(b - a)
        way = (b - a) / length
        points = np.array(pieces)
        off = (points - a) @ np.array([-way[1], way[0]])
        assert np.abs(off).max() < 1e-4
        along = np.sort((points - a) @ way, axis=1)
        along = along[np.argsort(along[:, 0])]
        assert along[0, 0] > -1e-5
        assert along[-1, 1] < length + 1e-5
        assert (along[1:, 0] >= along[:-1, 1] - 1e-9).all(), "burnt twice"
    for patch, lines in outlines.items():
        rings = [layout.patches[patch].outline_mm, *layout.patches[patch].waste_mm]
        rings = [placed[patch].from_patch(np.vstack([ring, ring[:1]])) for ring in rings]
        nominal = shapely.MultiLineString([ring.tolist() for ring in rings])
        drawn = shapely.MultiLineString([line.tolist() for line in lines])
        assert nominal.buffer(1e-4).contains(drawn)
        left = nominal.length - drawn.length
        if options.bridges == 0:
            assert left == pytest.approx(0.0, abs=1e-3)
        else:
            gaps = round(left / (options.bridge_mm + material.kerf_mm), 3)
            assert gaps == round(gaps)
            assert gaps in (0, *range(2, options.bridges + 1))


def assert_sheets(machine, options, layout):
    """All on the bed, and patches as far apart as asked."""
    margin = options.nesting.margin_mm
    margin = machine.bed.margin_mm if margin is None else margin
    for sheet in layout.sheets:
        shapes = [
            shapely.Polygon(p.from_patch(layout.patches[p.patch].outline_mm))
            for p in sheet.placements
        ]
        for k, shape in enumerate(shapes):
            low_x, low_y, high_x, high_y = shape.bounds
            assert min(low_x, low_y) >= margin - 1e-4
            assert high_x <= sheet.width_mm - margin + 1e-4
            assert high_y <= sheet.height_mm - margin + 1e-4
            assert all(shape.distance(other) >= options.gap_mm - 1e-4 for other in shapes[:k])
            assert all(shape.intersection(other).area < 1e-6 for other in shapes[:k])
        assert sheet.width_mm <= machine.bed.width_mm + 1e-9
        bound = sum(travel_bound(each) for each in layout.passes if each.sheet in sheet.passes)
        assert 0.0 <= bound <= sheet.travel_mm + 1e-3


def check(pattern, size, material, options):
    """The layout that was found sound, or None where it was refused in a clear sentence."""
    machine = bed(*size, MARGIN_MM)
    usable = usable_of(machine, options)
    oversize = [
        face
        for face, shape in enumerate(facet_polygons(pattern))
        if min(usable) > 0 and best_turn(shapely.get_coordinates(shape), *usable) is None
    ]
    try:
        layout = lay_out(pattern, machine, material, options=options)
    except LayoutError as refusal:
        assert_refusal_is_clear(str(refusal), pattern, usable)
        return None
    assert not oversize, "a facet larger than the bed must be named"
    pattern = layout.pattern
    assert_tabs(pattern, layout)
    assert_strokes(pattern, material, options, layout)
    assert_sheets(machine, options, layout)
    text = write_layout(layout, "p", "s")
    assert write_layout(read_layout(text), "p", "s") == text
    assert json.loads(text)["totals"]["tabs"] == sum(len(p.tabs) for p in layout.patches)
    return layout


@settings(derandomize=True, max_examples=25, deadline=None, phases=[Phase.generate])
@given(patterns(), BEDS, materials(), all_options())
def test_anything_asked_for_is_laid_out_soundly_or_refused_clearly(
    pattern, size, material, options
):
    check(pattern, size, material, options)


@pytest.mark.large
@settings(max_examples=1500, derandomize=True, deadline=None)
@given(patterns(), BEDS, materials(), all_options())
def test_anything_asked_for_is_laid_out_soundly_or_refused_clearly_in_a_large_sample(
    pattern, size, material, options
):
    check(pattern, size, material, options)


@settings(derandomize=True, max_examples=12, deadline=None)
@given(patterns(), BEDS, materials(), all_options())
def test_what_is_written_of_anything_reads_back_the_same(pattern, size, material, options):
    """SVG, DXF, PDF, HPGL and G-code, each by a reader that is not the package's own."""
    layout = check(pattern, size, material, options)
    if layout is None:
        return
    machine = replace(load_machine("grbl-laser-400"), bed=bed(*size, MARGIN_MM).bed)
    labels = {patch.id: patch.label for patch in layout.patches}
    for path in layout.passes:
        assert_same(read_svg(sheet_svg(path), path.height_mm), path, 1e-3)
        for version in VERSIONS:
            assert_same(read_dxf(sheet_dxf(path, version)), path, 1e-3)
        ((page, found),) = read_pdf(sheets_pdf((path,), "any"))
        assert page == pytest.approx((path.width_mm, path.height_mm), abs=1e-3)
        assert_same(found, path, 1e-3)
        hpgl = read_hpgl(sheet_hpgl(path))
        assert len(hpgl) == len(path.points) - len(path)
        assert np.abs(np.array(hpgl)[:, 1:]).max() <= max(size) + 1 / UNITS_PER_MM
        strokes, visited, switches = read_strokes(
            post(path, machine, material, patch_labels=labels).text
        )
        assert switches[-2:] == [5, 2], "dark at the end"
        found = [
            (OPERATIONS.index(stroke.operation), *a, *b)
            for stroke in strokes
            for a, b in zip(stroke.points[:-1], stroke.points[1:], strict=True)
        ]
        assert_same(found, path, 1e-3)
        assert (visited >= -1e-9).all()


@pytest.mark.parametrize("side", ["upper", "lower"])
def test_tabs_on_facets_that_are_not_convex_stand_on_their_own_edge(side):
    """The line of an edge runs on inside such a facet, and a whole facet's tab with it."""
    options = LayoutOptions(seam_columns=(1,), tab_side=side, tab_angle=2.22, full_facet=True)
    material = replace(flat_patterns.card(kerf=0.35), tabs=TabRule(26.4, 1.68))
    assert check(ring(), (161.5, 198.26), material, options) is not None
