"""Creases by kind, relief holes, both sides of a sheet, holding bridges: nothing is burnt twice."""

from __future__ import annotations

import dataclasses
import itertools
import math

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, fits_turned, miura, zigzag
from rings import revolved, tube

from miurafab.errors import LayoutError
from miurafab.fabrication.backs import PIN_MM, pin_centres
from miurafab.fabrication.kerf import bridged
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.profiles import OPERATIONS
from miurafab.profiles.material import CREASE_KINDS, MODES, Crease

ENGRAVE, SCORE, PERFORATE, CUT = range(4)
MACHINE = bed(150.0, 120.0)
PATTERNS = {"miura": miura(20, 16), "acute": zigzag(12, 8, a=20.0)}
MACHINES = {"miura": MACHINE, "acute": bed(180.0, 130.0)}
KERF = 0.15


def stock(mountain="perforate", valley="perforate", tab="perforate", hole=0.0):
    modes = {"mountain": mountain, "valley": valley, "tab": tab}
    creases = {kind: Crease(mode) for kind, mode in modes.items()}
    return dataclasses.replace(card(kerf=KERF), creases=creases, relief_hole_mm=hole)


def assert_nothing_is_burnt_twice(toolpath, kerf=KERF):
    """What the beam burns on its way along one stroke and along another has no area in common."""
    burnt = np.array(
        [
            shapely.LineString(toolpath.stroke(k)).buffer(kerf / 2 - 1e-6)
            for k in np.flatnonzero(toolpath.operation != ENGRAVE)
        ]
    )
    one, other = shapely.STRtree(burnt).query(burnt, predicate="intersects")
    pair = one < other
    shared = shapely.area(shapely.intersection(burnt[one[pair]], burnt[other[pair]]))
    # Ends of creases that meet in a vertex at an acute angle may touch in less than a spot.
    assert shared.max(initial=0.0) < kerf**2


def crease_operations(pattern, layout):
    """(edge, operation) of each crease stroke but relief holes, whichever side it is on."""
    found = set()
    for toolpath in layout.passes:
        for k in np.flatnonzero((toolpath.edge >= 0) & (toolpath.operation != ENGRAVE)):
            stroke = toolpath.stroke(k)
            if not np.array_equal(stroke[0], stroke[-1]):
                found.add((int(toolpath.edge[k]), int(toolpath.operation[k])))
    return found


@pytest.mark.parametrize(
    "modes",
    [
        modes
        if (MODES.index(modes[1]) - MODES.index(modes[0])) % 4 < 2
        else pytest.param(modes, marks=pytest.mark.large)
        for modes in itertools.product(MODES, repeat=2)
    ],
)
def test_each_kind_of_crease_is_made_its_own_way_and_once(modes):
    pattern = PATTERNS["miura"]
    mountain, valley = modes
    tab = MODES[(MODES.index(mountain) + 1) % 4]
    layout = lay_out(pattern, MACHINE, stock(mountain, valley, tab))
    tabs = {tab.edge for patch in layout.patches for tab in patch.tabs}
    assert tabs
    expected = set()
    for edge, kind in enumerate(pattern.edges_assignment):
        if kind == "B" or edge in layout.untabbed:
            continue
        mode = tab if edge in tabs else {"M": mountain, "V": valley}[str(kind)]
        if mode != "none":
            expected.add((edge, OPERATIONS.index(mode)))
    assert crease_operations(pattern, layout) == expected


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize("hole", [0.0, 1.0])
@pytest.mark.parametrize("ends", ["bridge", "cut"])
def test_nothing_is_burnt_twice_with_any_ends_and_holes(name, hole, ends):
    material = stock("perforate", "score", hole=hole)
    rule = dataclasses.replace(material.perforation, start_end=ends)
    material = dataclasses.replace(material, perforation=rule)
    layout = lay_out(PATTERNS[name], MACHINES[name], material)
    for toolpath in layout.passes:
        assert_nothing_is_burnt_twice(toolpath)


def test_holes_are_circles_on_the_inner_vertices_of_patches_before_everything_else_is_cut():
    pattern = PATTERNS["miura"]
    diameter = 1.0
    layout = lay_out(pattern, MACHINE, stock(hole=diameter))
    seen = 0
    for toolpath in layout.toolpaths:
        cuts = np.flatnonzero(toolpath.operation == CUT)
        holes = cuts[toolpath.edge[cuts] >= 0]
        assert (np.diff(holes) == 1).all()
        assert holes[0] == cuts[0]
        for k in holes:
            ring = toolpath.stroke(k)
            centre = ring[:-1].mean(axis=0)
            np.testing.assert_allclose(
                np.linalg.norm(ring - centre, axis=1), (diameter - KERF) / 2, atol=1e-6
            )
        seen += len(holes)
    home = np.empty(len(pattern.faces_vertices), dtype=int)
    for patch in layout.patches:
        home[patch.faces] = patch.id
    around = [set() for _ in pattern.vertices_coords]
    border = np.zeros(len(around), dtype=bool)
    for face, corners in enumerate(pattern.faces_vertices):
        for vertex in corners:
            around[vertex].add(home[face])
    border[pattern.edges_vertices[pattern.edges_assignment == "B"]] = True
    assert seen == sum(len(patches) == 1 for patches in around) - sum(
        len(around[v]) == 1 for v in np.flatnonzero(border)
    )


def test_vertices_without_room_for_a_hole_are_told():
    layout = lay_out(miura(8, 6, 3.0, 12.0), MACHINE, stock(hole=2.5))
    (finding,) = [each for each in layout.findings if each.code == "relief-holes"]
    assert finding.sentence == "At 35 vertices a crease is too short for a relief hole."


def test_two_sided_working_scores_the_valleys_from_the_back():
    pattern = PATTERNS["miura"]
    material = stock("perforate", "score", "score")
    front = lay_out(pattern, MACHINE, material)
    both = lay_out(pattern, MACHINE, material, options=LayoutOptions(two_sided=True))
    assert not front.backs
    assert crease_operations(pattern, front) == crease_operations(pattern, both)
    assert [each.sheet for each in both.passes] == [
        name for sheet in both.sheets for name in (f"{sheet.name}-back", sheet.name)
    ]
    for sheet, one, face, back in zip(
        both.sheets, front.toolpaths, both.toolpaths, both.backs, strict=True
    ):
        scored = one.operation == SCORE
        valleys = scored.copy()
        valleys[scored] = pattern.edges_assignment[one.edge[scored]] == "V"
        assert sorted(face.edge.tolist()) == sorted(one.edge[~valleys].tolist())
        # Turned over, each score on the back lies where it would have been on the front.
        turned = {}
        for k in np.flatnonzero(back.operation == SCORE):
            turned[int(back.edge[k])] = back.stroke(k) * [-1.0, 1.0] + [back.width_mm, 0.0]
        assert set(turned) == set(one.edge[valleys].tolist())
        for k in np.flatnonzero(valleys):
            here, there = one.stroke(k), turned[int(one.edge[k])]
            assert np.abs(here - there).max() < 1e-9 or np.abs(here - there[::-1]).max() < 1e-9
        pins = np.flatnonzero(back.operation == CUT)
        middles = np.array([back.stroke(k)[:-1].mean(axis=0) for k in pins])
        # The sheet is the card that is needed, so the holes lie on it.
        assert (back.width_mm, back.height_mm) == sheet.card_mm
        on_front = middles * [-1.0, 1.0] + [back.width_mm, 0.0]
        expected = pin_centres(back.width_mm, back.height_mm, 5.0)
        np.testing.assert_allclose(
            on_front[np.lexsort(on_front.T)], expected[np.lexsort(expected.T)], atol=1e-9
        )
        assert (back.points >= 0.0).all()
        assert_nothing_is_burnt_twice(back)
        # The holes lie in the margin, clear of every patch.
        for middle in on_front:
            assert np.linalg.norm(face.points - middle, axis=1).min() > PIN_MM / 2


@pytest.mark.parametrize(
    ("ring", "fold"), [(tube, "mountain"), (lambda: revolved("4x8", "120mm"), "valley")]
)
def test_valleys_of_a_ring_seam_are_scored_from_the_back(ring, fold):
    """Its edges are borders of the sheet, so only the seam knows which way they fold."""
    pattern = ring()
    material = stock("perforate", "score", "score")
    layout = lay_out(pattern, bed(300.0, 300.0), material, options=LayoutOptions(two_sided=True))
    placed = {p.patch: (k, p) for k, sheet in enumerate(layout.sheets) for p in sheet.placements}
    seen = []
    for patch in layout.patches:
        number, placement = placed[patch.id]
        for tab in patch.tabs:
            closes = tab.edge != tab.mate_edge
            assert not closes or pattern.edges_assignment[tab.edge] == "B"
            back = tab.fold == "valley"
            path = layout.backs[number] if back else layout.toolpaths[number]
            (score,) = np.flatnonzero((path.operation == SCORE) & (path.edge == tab.edge))
            stroke = path.stroke(score)
            if back:
                stroke = stroke * [-1.0, 1.0] + [path.width_mm, 0.0]
            base = shapely.LineString(placement.from_patch(tab.polygon_mm[:2]))
            assert shapely.LineString(stroke).hausdorff_distance(base) < material.tabs.height_mm / 4
            assert shapely.distance(shapely.points(stroke), base).max() < 1e-5
            seen.append((closes, tab.fold))
    assert {each for closes, each in seen if closes} == {fold}


@pytest.mark.parametrize("size", [(300.0, 200.0), (400.0, 400.0)])
def test_no_wrong_way_of_laying_the_sheet_down_matches_its_holes(size):
    pins = pin_centres(*size, 5.0)
    centre = np.array(size) / 2
    for quarter, mirror in itertools.product(range(4), (1.0, -1.0)):
        c, s = round(np.cos(quarter * np.pi / 2)), round(np.sin(quarter * np.pi / 2))
        moved = ((pins - centre) * [mirror, 1.0]) @ np.array([[c, s], [-s, c]]) + centre
        off = np.linalg.norm(moved[:, None] - pins[None], axis=2).min(axis=1).max()
        assert off < 1e-9 if (quarter, mirror) == (0, 1.0) else off > 10.0


def test_two_sided_working_without_scored_valleys_or_margin_is_refused():
    options = LayoutOptions(two_sided=True)
    with pytest.raises(LayoutError, match=r"does not score them; write mode = 'score'"):
        lay_out(miura(4, 4), MACHINE, card(), options=options)
    narrow = bed(300.0, 200.0, margin=2.0)
    with pytest.raises(LayoutError, match="a margin of 3 mm for its registration holes"):
        lay_out(miura(4, 4), narrow, stock(valley="score"), options=options)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_holding_bridges_leave_gaps_of_their_length_in_every_outline(count):
    pattern = PATTERNS["miura"]
    options = LayoutOptions(bridges=count, bridge_mm=0.5)
    whole = lay_out(pattern, MACHINE, card(kerf=KERF))
    held = lay_out(pattern, MACHINE, card(kerf=KERF), options=options)
    outlines = {patch.id: 0 for patch in held.patches}
    for one, other in zip(whole.toolpaths, held.toolpaths, strict=True):
        for patch in np.unique(other.patch[other.operation == CUT]):
            strokes = np.flatnonzero((other.operation == CUT) & (other.patch == patch))
            (ring,) = np.flatnonzero((one.operation == CUT) & (one.patch == patch))
            outlines[int(patch)] = len(strokes)
            line = shapely.LineString(one.stroke(ring))
            parts = shapely.MultiLineString([other.stroke(k) for k in strokes])
            left = shapely.difference(line, parts.buffer(1e-7))
            gaps = shapely.length(shapely.get_parts(shapely.line_merge(left)))
            assert gaps.sum() == pytest.approx(count * (0.5 + KERF), abs=1e-5)
            assert parts.length == pytest.approx(line.length - gaps.sum(), abs=1e-5)
            # The pieces are cut in turn.
            assert (np.diff(strokes) == 1).all()
    assert set(outlines.values()) == {count}


def test_a_ring_without_long_sides_stays_whole():
    angle = np.linspace(0, 2 * np.pi, 60)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    (same,) = bridged(ring, 3, 0.5)
    assert same is ring


def test_as_many_bridges_as_sides_can_bear_one_each_on_its_own():
    # Three long sides lie close together; the fourth quarter and the half have only short ones.
    short = [(30 + 0.1 * math.cos(a), 0.1 * math.sin(a)) for a in np.linspace(2, 4, 40)]
    corners = np.array([(0, 0), (12, 0), (12, 12), (0, 12), *short], dtype=float)
    ring = np.vstack([corners, corners[:1]])
    able = int((np.linalg.norm(np.diff(ring, axis=0), axis=1) >= 3.0).sum())
    for count in range(2, 9):
        parts = bridged(ring, count, 1.0)
        assert len(parts) == min(count, able)
        left = sum(shapely.LineString(part).length for part in parts)
        assert shapely.LineString(ring).length - left == pytest.approx(len(parts) * 1.0)


def test_bridges_that_find_no_room_are_told():
    layout = lay_out(miura(4, 4), MACHINE, card(), options=LayoutOptions(bridges=3, bridge_mm=20.0))
    (finding,) = layout.findings
    assert finding.code == "bridges"
    assert finding.sentence.startswith("1 outline has no room for 3 holding bridges of 20 mm")


def test_creases_of_no_kind_are_told():
    pattern = miura(4, 4)
    letters = pattern.edges_assignment.copy()
    letters[np.flatnonzero(letters == "M")[:2]] = "U"
    layout = lay_out(dataclasses.replace(pattern, edges_assignment=letters), MACHINE, card())
    (finding,) = layout.findings
    assert finding.code == "unassigned-creases"
    assert finding.sentence == "2 creases are neither mountain nor valley in the pattern."


def test_the_fold_of_a_tab_is_that_of_its_crease():
    pattern = PATTERNS["miura"]
    layout = lay_out(pattern, MACHINE, card())
    words = {"M": "mountain", "V": "valley"}
    tabs = [tab for patch in layout.patches for tab in patch.tabs]
    assert {tab.fold for tab in tabs} == {"mountain", "valley"}
    for tab in tabs:
        assert tab.fold == words[str(pattern.edges_assignment[tab.edge])]


def test_weak_tabs_are_told_by_label():
    material = card()
    material = dataclasses.replace(
        material, tabs=dataclasses.replace(material.tabs, min_area_mm2=60.0)
    )
    layout = lay_out(PATTERNS["miura"], MACHINE, material)
    weak = [
        tab.label
        for patch in layout.patches
        for tab in patch.tabs
        if shapely.Polygon(tab.polygon_mm).area < 60.0
    ]
    assert weak
    (finding,) = (each for each in layout.findings if each.code == "weak-tabs")
    assert finding.code == "weak-tabs"
    total = layout.totals.tabs
    start = f"{len(weak)} of {total} tabs have less than 60 mm2 of glue: "
    assert finding.sentence.startswith(start)
    assert finding.sentence.removeprefix(start).rstrip(".").split(", ") == weak
    assert set(CREASE_KINDS) == {"mountain", "valley", "tab"}


def sound(pattern, layout, limit):
    """Every patch within ``limit`` and every tab in the facet of its mate."""
    facets = flat_patterns.facet_polygons(pattern)
    home = {face: patch.id for patch in layout.patches for face in patch.faces.tolist()}
    for patch in layout.patches:
        assert fits_turned(patch.outline_mm, *limit)
        for tab in patch.tabs:
            c, s = np.cos(np.radians(patch.rotation_deg)), np.sin(np.radians(patch.rotation_deg))
            points = tab.polygon_mm @ np.array([[c, -s], [s, c]]) + patch.origin_mm
            mates = [f for f in pattern.edges_faces[tab.edge] if home[f] == tab.mate_patch]
            assert tab.mate_patch != patch.id
            assert any(facets[f].buffer(1e-4).contains(shapely.Polygon(points)) for f in mates)


@pytest.mark.parametrize(
    ("side", "full_facet", "gridded"),
    [
        ("lower", False, True),
        ("upper", False, True),
        ("alternate", True, True),
        pytest.param("lower", True, True, marks=pytest.mark.large),
        pytest.param("upper", True, True, marks=pytest.mark.large),
        pytest.param("alternate", False, True, marks=pytest.mark.large),
        pytest.param("alternate", True, False, marks=pytest.mark.large),
    ],
)
def test_tabs_stand_on_the_side_asked_for_and_patches_still_fit(side, full_facet, gridded):
    pattern = PATTERNS["miura"] if gridded else flat_patterns.without_grid(PATTERNS["miura"])
    options = LayoutOptions(tab_side=side, full_facet=full_facet, max_patch_mm=(140.0, 110.0))
    layout = lay_out(pattern, MACHINE, card(), options=options)
    sound(pattern, layout, (140.0, 110.0))
    lower = [tab.mate_patch > patch.id for patch in layout.patches for tab in patch.tabs]
    share = np.mean(lower)
    assert {"lower": share > 0.95, "upper": share < 0.05, "alternate": 0.4 < share < 0.7}[side]
    area = [shapely.Polygon(tab.polygon_mm).area for p in layout.patches for tab in p.tabs]
    facet = flat_patterns.facet_polygons(pattern)[0].area
    if full_facet:
        assert np.max(area) > 0.85 * facet


def test_seams_run_where_they_are_asked_for():
    pattern = miura(10, 8)
    assert lay_out(pattern, MACHINE, card()).totals.patches == 1
    options = LayoutOptions(seam_rows=(3, 5), seam_columns=(4,))
    layout = lay_out(pattern, MACHINE, card(), options=options)
    cells = np.arange(80).reshape(8, 10)
    blocks = [
        cells[r, c] for r in (slice(3), slice(3, 5), slice(5, 8)) for c in (slice(4), slice(4, 10))
    ]
    found = sorted(sorted(patch.faces.tolist()) for patch in layout.patches)
    assert found == sorted(sorted(block.ravel().tolist()) for block in blocks)
    with pytest.raises(LayoutError, match="at 1 to 7"):
        lay_out(pattern, MACHINE, card(), options=LayoutOptions(seam_rows=(8,)))
    flat = flat_patterns.without_grid(pattern)
    with pytest.raises(LayoutError, match="do not form a grid"):
        lay_out(flat, MACHINE, card(), options=LayoutOptions(seam_rows=(3,)))


def test_no_angle_at_the_base_of_a_tab_exceeds_the_limit():
    material = card()
    limit = np.radians(75.0)
    rule = dataclasses.replace(material.tabs, max_angle=limit)
    layout = lay_out(PATTERNS["miura"], MACHINE, dataclasses.replace(material, tabs=rule))
    steepest = 0.0
    for patch in layout.patches:
        for tab in patch.tabs:
            points = tab.polygon_mm
            base = points[1] - points[0]
            for one, other in ((base, points[-1] - points[0]), (-base, points[2] - points[1])):
                cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
                steepest = max(steepest, np.arccos(cosine))
    assert steepest == pytest.approx(limit, abs=1e-4)
