"""The order of layers: closed form against the motion itself, and against complete search.

Numbers of orders that are known by other means: a strip of n equal stamps folds in 1, 2, 6, 16,
50, 144 ways (OEIS A000136), a map of 2 x n in 2, 8, 60 ways (A001415).
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from flat_folds import flaps, grid, pattern_of, strip
from named_patterns import border, drawn
from problems import fitted, regular

from miurafab.errors import InputError, PatternError
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding import order_search
from miurafab.origami.folding.kinematics import fold_angles_at, place
from miurafab.origami.folding.layers import (
    EXACT_WIDTH,
    LayerOrder,
    known_layer_order,
    layer_order,
)
from miurafab.origami.folding.motion import find_motion
from miurafab.origami.folding.order_search import (
    DRAWN_MISS,
    DRAWN_WIDTH,
    broken_rules,
    search_layer_orders,
)
from miurafab.origami.formats.fold import read_fold
from miurafab.workflow.layers import layer_findings, layers

SHEETS = ("plane", "hypar", "paraboloid", "cylinder")


@cache
def exact(name: str, cells: int = 6) -> CreasePattern:
    found = fitted(name, cells, cells, 0.0).pattern
    assert found is not None
    return found


def heights(pattern: CreasePattern, order: LayerOrder, state: float) -> np.ndarray:
    """(n,) how far the first facet of each pair is above the second at ``state``, in the middle of
    their overlap, from the placement of the facets alone; in the frame of the flat-folded sheet.
    """
    folded, pairs = order.folded, order.folded.shared.pairs
    near = place(pattern, fold_angles_at(pattern, np.array([state])))
    turn, shift = near.turn[0], near.shift[0]
    corner = folded.shared.area_of_corner
    count = np.bincount(corner)[:, None]
    middle = np.stack([np.bincount(corner, folded.shared.corners[:, i]) for i in (0, 1)], axis=1)
    middle = middle / count
    above = []
    for side in (0, 1):
        facet = pairs[:, side]
        # solve for the point of the facet that stands over the middle: a linear map of the plane
        flat = np.linalg.solve(turn[facet][:, :2, :2], (middle - shift[facet, :2])[..., None])
        above.append(np.einsum("ni,ni->n", turn[facet, 2, :2], flat[..., 0]) + shift[facet, 2])
    return above[0] - above[1]


@pytest.mark.parametrize("name", SHEETS)
def test_the_closed_form_is_the_order_just_before_the_end(name: str) -> None:
    pattern = exact(name)
    order = layer_order(pattern)
    assert order.known
    assert order.loop_gap < 1e-11
    assert len(order.above) > 300
    apart = heights(pattern, order, 1e7)
    assert (np.sign(apart) == order.above).all()
    # the heights are of first order: ten times nearer to the end they are a tenth
    assert np.allclose(10 * heights(pattern, order, 1e8), apart, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("name", SHEETS)
def test_complete_search_finds_the_closed_form_and_no_other(name: str) -> None:
    order = layer_order(exact(name))
    search = search_layer_orders(exact(name), 4, EXACT_WIDTH)
    assert search.complete
    assert len(search.orders) == 1
    assert np.array_equal(search.folded.shared.pairs, order.folded.shared.pairs)
    assert np.array_equal(search.orders[0].above, order.above)
    assert broken_rules(order) == 0
    assert min(search.rules[kind] for kind in ("letters", "triples", "tortillas")) > 50


@pytest.mark.parametrize("name", ["hypar", "cylinder"])
def test_the_guide_tells_what_is_found(name: str) -> None:
    pattern = exact(name, 8)
    search = search_layer_orders(pattern, 4, EXACT_WIDTH)
    figures = [len(search.folded.shared.pairs), sum(search.rules.values()), len(search.orders)]
    row = f"| {name} 8x8 | {' | '.join(f'{figure:,}' for figure in figures)} |"
    assert row in (Path(__file__).parents[3] / "docs" / "folding.md").read_text()


@pytest.mark.parametrize("pair", range(0, 120, 17))
def test_each_pair_the_other_way_round_breaks_a_rule(pair: int) -> None:
    order = layer_order(exact("plane", 4))
    turned = order.above.copy()
    turned[pair] *= -1
    assert broken_rules(replace(order, above=turned)) > 0


def test_levels_count_the_layers_under_each_facet() -> None:
    order = layer_order(exact("hypar"))
    levels = order.levels
    assert levels is not None
    pairs = order.folded.shared.pairs
    assert (np.sign(levels[pairs[:, 0]] - levels[pairs[:, 1]]) == order.above).all()
    for facet in np.flatnonzero(levels > 0).tolist():  # and the facet below is one level lower
        here = (pairs == facet).any(axis=1)
        other = pairs[here].sum(axis=1) - facet
        assert levels[facet] - 1 in levels[other]


@pytest.mark.parametrize(("stamps", "ways"), [(2, 2), (3, 6), (4, 16), (5, 50), (6, 144)])
def test_a_strip_of_stamps_folds_in_as_many_ways_as_are_known(stamps: int, ways: int) -> None:
    search = search_layer_orders(strip("U" * (stamps - 1)), 1000)
    assert search.complete
    assert len(search.orders) == ways
    assert len({tuple(order.above.tolist()) for order in search.orders}) == ways


@pytest.mark.parametrize(("columns", "ways"), [(1, 2), (2, 8), (3, 60)])
def test_a_map_of_two_rows_folds_in_as_many_ways_as_are_known(columns: int, ways: int) -> None:
    search = search_layer_orders(grid(columns, 2), 1000)
    assert (search.complete, len(search.orders)) == (True, ways)


def test_four_flaps_overlap_in_any_order_and_in_a_circle() -> None:
    # each of the narrow ones overlaps its two neighbours: 2^4 orders, 2 of them circles
    search = search_layer_orders(flaps(0.4), 100)
    assert (search.complete, len(search.orders)) == (True, 16)
    assert sum(order.levels is None for order in search.orders) == 2
    wide = search_layer_orders(flaps(0.7), 100)  # all four meet in the middle: 4! orders
    assert (wide.complete, len(wide.orders)) == (True, 24)
    assert all(broken_rules(order) == 0 for order in search.orders)


def test_a_flat_crease_keeps_its_facets_on_one_side() -> None:
    # the third stamp lies under both halves of a long one, or over both
    crossed = strip("UFU", widths=(0.8, 1.0, 0.6, 1.5))
    search = search_layer_orders(crossed, 100)
    plain = search_layer_orders(strip("UU", widths=(0.8, 1.6, 1.5)), 100)
    assert search.rules["flat creases"] + search.rules["tortillas"] > 0
    assert (search.complete, len(search.orders)) == (True, len(plain.orders))


def test_a_roll_of_equal_stamps_passes_through_itself_and_has_no_order() -> None:
    order = layer_order(strip("VVV", angle=np.radians(120)))
    assert order.crossing.tolist()[0] == [0, 2]
    assert not order.known
    assert order.levels is None
    rolled = search_layer_orders(strip("VVV", widths=(1.0, 1.2, 1.0, 1.2)), 10)
    assert (rolled.complete, rolled.orders) == (True, ())


def test_one_facet_lies_on_nothing() -> None:
    order = layer_order(regular(2, 2))
    assert order.known
    assert len(order.face_orders()) == 0
    assert order.levels.tolist() == [0]


def test_what_has_no_order_after_a_search_is_not_called_closed_form() -> None:
    """A square with a square hole, folded on its diagonals, closes as no frame can."""
    points = [[0, 0], [3, 0], [3, 3], [0, 3], [1, 1], [2, 1], [2, 2], [1, 2]]
    faces = [[k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    found = layers(pattern_of(points, faces, {(k, k + 4): "MV"[k % 2] for k in range(4)}))
    assert (found.closed, found.exists) == (None, False)
    assert found.report()["method"] == "search"


def test_a_map_with_unassigned_creases_is_not_taken_for_a_flat_sheet() -> None:
    """By its motion no crease of it folds: that is no order of its layers."""
    found = layers(grid(2, 2))
    assert (found.report()["method"], found.exists, found.report()["pairs"]) == ("search", True, 6)
    assert repr(found) == "<Layers 6 pairs of facets, orders found: 8>"
    some = layers(strip("UUUU"), orders=5)
    assert repr(some) == "<Layers 10 pairs of facets, orders found: 5 and more>"
    assert [finding.code for finding in some.findings] == ["more-layer-orders"]
    assert "more than 5 orders; the search ended there" in some.findings[0].sentence


def test_a_closed_form_that_crosses_agrees_with_no_order_that_is_found() -> None:
    crossing = layers(strip("VVV", angle=np.radians(120)))
    assert (crossing.report()["agrees"], crossing.exists) == (False, True)
    assert layers(strip("V"), orders=3).report()["agrees"] is True


def test_a_pair_that_the_motion_does_not_order_is_told() -> None:
    order = layer_order(strip("VM"))
    (finding,) = layer_findings(replace(order, above=order.above * [0, 1, 1]))
    assert finding.code == "undecided-layers"
    assert finding.sentence.startswith("The order of 1 of 3 pairs of facets folded flat does not")


def test_what_has_no_order_is_not_written(tmp_path: Path) -> None:
    stiff = layers(fitted("hypar", 8, 8).pattern)
    assert repr(stiff) == "<Layers no order>"
    assert "<svg" not in stiff._repr_mimebundle_()["text/html"]
    with pytest.raises(PatternError, match=r"x\.fold is not written, since the layers have no ord"):
        stiff.save(tmp_path / "x.fold")
    assert not (tmp_path / "x.fold").exists()


def test_a_roll_that_grows_closes_without_crossing_if_its_inner_creases_lead() -> None:
    pattern = strip("VVV", widths=(1.0, 1.2, 1.4, 1.6))
    angles = np.zeros(len(pattern.edges_vertices))
    angles[:3] = 2 * np.arctan([100.0, 10.0, 1.0])  # the inner crease is nearly closed first
    order = layer_order(replace(pattern, edges_fold_angle=angles))
    assert not len(order.crossing)
    assert broken_rules(order) == 0


def test_triples_are_those_of_the_fold_format() -> None:
    # the second stamp lies on the front of the first, and the first on the front of the second
    valley = layer_order(strip("V")).face_orders().tolist()
    mountain = layer_order(strip("M")).face_orders().tolist()
    assert (valley, mountain) == ([[0, 1, 1]], [[0, 1, -1]])
    order = layer_order(exact("hypar"))
    pattern, triples = order.folded.pattern, order.face_orders()
    sides = {(f, g): s for f, g, s in triples.tolist()}
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    for edge in inner.tolist():
        f, g = sorted(pattern.edges_faces[edge].tolist())
        assert sides[f, g] == (1 if pattern.edges_assignment[edge] == "V" else -1)


def test_the_frame_folded_flat_is_written_with_its_order(tmp_path: Path) -> None:
    pattern, path = exact("hypar"), tmp_path / "hypar.fold"
    pattern.save(path)
    frames = json.loads(path.read_text())["file_frames"]
    assert [frame.get("frame_title") for frame in frames] == [None, "folded flat"]
    order = layer_order(pattern)
    assert frames[1]["faceOrders"] == order.face_orders().tolist()
    flat = np.array(frames[1]["vertices_coords"])
    ends = pattern.edges_vertices
    length = np.linalg.norm(np.diff(flat[ends], axis=1)[:, 0], axis=1)
    known = np.linalg.norm(np.diff(pattern.vertices_coords[ends], axis=1)[:, 0], axis=1)
    assert np.abs(length - known).max() < 1e-10 * known.mean()
    again = read_fold(path)
    assert np.array_equal(again.folded_coords, pattern.folded_coords)
    again.save(tmp_path / "again.fold")
    assert json.loads((tmp_path / "again.fold").read_text())["file_frames"] == frames


def test_no_order_is_claimed_for_what_does_not_fold_flat(tmp_path: Path) -> None:
    pattern = fitted("hypar", 8, 8).pattern
    assert pattern is not None
    with pytest.raises(PatternError, match="closed form of folding does not hold"):
        layer_order(pattern)
    with pytest.raises(PatternError, match="does not fold flat"):
        search_layer_orders(pattern)
    assert known_layer_order(pattern) is None
    pattern.save(tmp_path / "hypar.fold")
    assert "faceOrders" not in (tmp_path / "hypar.fold").read_text()
    bent = regular().vertices_coords.copy()
    bent[len(bent) // 2] += 0.5
    with pytest.raises(PatternError, match="does not fold"):
        search_layer_orders(replace(regular(), vertices_coords=bent, folded_coords=None))


def test_a_search_is_not_advised_after_it_was_made() -> None:
    order = layer_order(strip("VM"))
    undecided = replace(order, above=order.above * [0, 1, 1])
    found = replace(layers(strip("VM")), closed=undecided)
    assert [finding.code for finding in found.findings] == ["undecided-layers"]
    assert replace(found, search=search_layer_orders(strip("VM"))).findings == ()


def test_eight_creases_in_turn_have_no_order_and_no_closed_form() -> None:
    """By the speeds of valleys at 90 and mountains at 180 degrees they close at 90 alone."""
    turns = np.radians(np.arange(0, 360, 45))
    ends = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    sizes = {"M": 180.0, "V": 90.0}
    letters = zip(ends, "VM" * 4, strict=True)
    creases = [((0.0, 0.0), (*end,), letter, sizes[letter]) for end, letter in letters]
    found = layers(drawn([*creases, *border(*ends)]))
    assert found.closed is None
    assert (found.exists, found.search.complete) == (False, True)
    assert [finding.code for finding in found.findings] == ["cannot-fold-flat"]


@pytest.mark.parametrize("letters", ["VVM", "VUM"])
def test_a_crease_that_ends_on_another_does_not_fold_flat(letters: str) -> None:
    """All ends meet where two creases in one line fold; the third, between them, stays open."""
    corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    ends = (corners[3], corners[1], corners[2])
    creases = [((0.0, 0.0), end, each, 180.0) for end, each in zip(ends, letters, strict=True)]
    found = drawn([*creases, *border(*corners)])
    assert known_layer_order(found) is None
    with pytest.raises(PatternError, match=r"does not fold flat: .* up to 1\.6 mean edges"):
        search_layer_orders(found)
    assert not layers(found).exists


def test_more_layers_than_can_be_searched_are_refused_by_their_number(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stamps = strip("MVMV")
    monkeypatch.setattr(order_search, "MOST_TRIPLES", 9)
    with pytest.raises(InputError, match=r"5 facets .* in 10 pairs and more than 9 triples"):
        layers(stamps, orders=1)


def test_a_pattern_of_unassigned_creases_is_told_to_need_letters() -> None:
    stamps = strip("UU")
    flat = replace(stamps, edges_fold_angle=np.zeros(len(stamps.edges_vertices)))
    with pytest.raises(PatternError, match="All 2 creases of the pattern are unassigned"):
        find_motion(flat, 4)


def test_a_drawing_of_few_digits_folds_flat_as_its_vertices_do() -> None:
    """Facets of a large rounded sheet miss each other by more than each vertex is off."""
    sheet = exact("plane", 8)
    edge = edge_lengths(sheet.vertices_coords, sheet.edges_vertices).mean()
    off = np.random.default_rng(3).uniform(-1.0, 1.0, sheet.vertices_coords.shape)
    rounded = sheet.vertices_coords + 1e-3 * edge * off
    drawn = replace(sheet, vertices_coords=rounded, folded_coords=None, grid=None, target={})
    search = search_layer_orders(drawn, 2)
    assert DRAWN_WIDTH < search.folded.mismatch < DRAWN_MISS
    assert (len(search.orders), search.complete) == (1, True)
    told = [finding.code for finding in layers(drawn, orders=2).findings]
    assert "rough-layers" in told
    bent = rounded.copy()
    bent[4 * 9 + 4] += 0.1 * edge  # no rounding any more
    with pytest.raises(PatternError, match="does not fold flat"):
        search_layer_orders(replace(drawn, vertices_coords=bent), 2)


def test_search_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(order_search.importlib, "import_module", missing)
    with pytest.raises(InputError, match=r"python-sat.*miurafab\[layers\]"):
        search_layer_orders(strip("V"))


def test_a_sheet_that_folds_to_a_strip_is_drawn_in_its_plane():
    """A Miura-ori of one width lies along a line, about which a turn is left open."""
    pattern = replace(regular(), folded_coords=None)
    order = known_layer_order(pattern)
    flat = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    lengths = edge_lengths(order.folded.vertices, pattern.edges_vertices)
    assert np.abs(lengths - flat).max() <= 1e-12 * flat.max()
