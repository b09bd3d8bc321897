"""Patterns of several pieces, with holes and trimmed facets, on their way to the sheets."""

from __future__ import annotations

from dataclasses import replace

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, facet_polygons, fits_turned
from piece_problems import gores, trimmed, two_pieces, two_trimmed_pieces

from miurafab.errors import LayoutError
from miurafab.fabrication.assembly import assembly_order
from miurafab.fabrication.glue import _joined
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.partition.pieces import full_grid, hanging_together
from miurafab.fabrication.partition.split import split
from miurafab.fabrication.seams import border_seams
from miurafab.fabrication.sheets import lay_out
from miurafab.origami.crease_pattern import CreasePattern

PATTERNS = {"gores": gores(), "two": two_pieces(), "trimmed pieces": two_trimmed_pieces()}


def plugged(size=30.0):
    """A ring of eight squares, and a square that fills its hole, laid beside it."""
    i, j = np.indices((4, 4))
    ring = flat_patterns.grid(np.stack([j * size, i * size], axis=-1))
    faces = ring.faces_vertices
    outer = np.delete(np.arange(9), 4)
    middle = faces[4]
    points = np.concatenate([ring.vertices_coords, ring.vertices_coords[middle] + [3 * size, 0]])
    plug = np.arange(16, 20)
    sides = np.stack([plug, np.roll(plug, -1)], axis=1)
    ends = np.sort(ring.edges_vertices, axis=1)
    around = [
        int(np.flatnonzero((ends == np.sort(pair)).all(axis=1))[0])
        for pair in np.stack([middle, np.roll(middle, -1)], axis=1)
    ]
    letters = np.append(ring.edges_assignment, ["B"] * 4)
    letters[around] = "B"
    folded = np.pad(
        np.concatenate([ring.vertices_coords, ring.vertices_coords[middle]]), ((0, 0), (0, 1))
    )
    return CreasePattern(
        vertices_coords=points,
        edges_vertices=np.concatenate([ring.edges_vertices, sides]),
        edges_assignment=letters,
        edges_fold_angle=np.zeros(len(letters)),
        faces_vertices=np.concatenate([faces[outer], plug[None]]),
        folded_coords=folded,
        pieces=np.array([0] * 8 + [1]),
        seams=np.column_stack([around, np.arange(4) + len(ring.edges_vertices)]),
    )


@pytest.mark.parametrize("name", PATTERNS)
def test_pieces_that_fit_stay_whole_wherever_they_lie(name):
    pattern = PATTERNS[name]
    owner = np.empty(len(pattern.vertices_coords), dtype=np.int64)
    for piece, corners in zip(pattern.pieces, pattern.faces_vertices, strict=True):
        owner[corners[corners >= 0]] = piece
    far = replace(
        pattern, vertices_coords=pattern.vertices_coords + 5000.0 * owner[:, None] * [1.0, 0.3]
    )
    for placed in (pattern, far):
        found = split(placed, 360.0, 260.0, card())
        np.testing.assert_array_equal(found, pattern.pieces)


@pytest.mark.parametrize("side", ["lower", "upper", "alternate"])
@pytest.mark.parametrize("name", PATTERNS)
def test_patches_of_pieces_fit_with_their_tabs(name, side):
    pattern = PATTERNS[name]
    options = LayoutOptions(tab_side=side)
    outlined = outline_patches(pattern, 120.0, 75.0, card(kerf=0.4), options)
    assert outlined.face_patch.max() + 1 > pattern.pieces_count
    for number, patch in enumerate(outlined.patches):
        assert fits_turned(patch.cut_lines[0], 120.0, 75.0)
        assert len(np.unique(pattern.pieces[outlined.face_patch == number])) == 1
    seams = border_seams(pattern).edges[:, 0]
    tabbed = np.concatenate([outlined.tabs.seams.edges.min(axis=1), outlined.untabbed])
    assert set(seams.tolist()) <= set(tabbed.tolist())


def test_seams_are_those_that_the_pattern_names():
    pattern = gores()
    told = border_seams(pattern)
    found = border_seams(replace(pattern, seams=None))
    np.testing.assert_array_equal(told.edges, found.edges)
    np.testing.assert_array_equal(told.fold, found.fold)
    assert (border_seams(replace(pattern, folded_coords=None)).fold == "U").all()
    few = replace(pattern, seams=pattern.seams[:3])
    assert len(border_seams(few)) == 3


def test_the_gores_of_a_tube_are_glued_one_by_one_and_closed_last():
    pattern = gores()
    layout = lay_out(pattern, bed(400.0, 400.0), card())
    steps = assembly_order(layout, pattern)
    assert [step.closes for step in steps] == [False] * 4 + [True]
    beside = {0: {1, 3}, 1: {0, 2}, 2: {1, 3}, 3: {2, 0}}
    done = {steps[0].patch}
    for step in steps[1:]:
        (mate,) = step.onto
        assert mate in beside[step.patch] & done
        assert len(step.tabs) == 6
        assert len(step.edges) == 12
        done.add(step.patch)
    assert sorted(n for step in steps for n in step.tabs) == list(range(1, 25))


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_hole_is_cut_out_and_a_piece_is_glued_into_it(side):
    pattern = plugged()
    outlined = outline_patches(pattern, 300.0, 300.0, card(), LayoutOptions(tab_side=side))
    ring, plug = outlined.patches
    assert (len(ring.faces), len(plug.faces)) == (8, 1)
    assert len(ring.cut_lines) == 2
    assert (len(ring.tabs), len(plug.tabs)) == ((4, 0) if side == "lower" else (0, 4))
    facets = facet_polygons(pattern)
    tabs = outlined.tabs
    for patch in (ring, plug):
        paper = shapely.union_all(
            [*facets[patch.faces], *(shapely.Polygon(tabs.polygon(t)) for t in patch.tabs)],
            grid_size=1e-9,
        )
        line = shapely.Polygon(patch.cut_lines[0], patch.cut_lines[1:])
        assert line.is_valid
        assert shapely.hausdorff_distance(line, paper) < 0.2
    layout = lay_out(pattern, bed(400.0, 400.0), card(), options=LayoutOptions(tab_side=side))
    first, last = assembly_order(layout, pattern)
    assert (first.patch, last.patch) == (0, 1)
    assert last.all_round
    assert last.tabs == (1, 2, 3, 4)


def test_a_tab_is_not_made_on_a_short_edge():
    pattern = two_pieces()
    lengths = np.linalg.norm(
        np.diff(pattern.vertices_coords[pattern.edges_vertices[pattern.seams[:, 0]]], axis=1),
        axis=2,
    )
    small = 1.9 / lengths.max()
    tiny = replace(pattern, vertices_coords=pattern.vertices_coords * small)
    layout = lay_out(tiny, bed(200.0, 200.0), card())
    assert layout.totals.tabs == 0
    (found,) = [each for each in layout.findings if each.code == "untabbed"]
    assert found.where == tuple(np.sort(pattern.seams.min(axis=1)).tolist())
    assert "8 seam edges bear no tab, 8 of them shorter than 2.5 mm" in str(found)


def test_cells_give_the_lines_for_seams_where_there_is_no_whole_grid():
    pattern = trimmed()
    found = split(pattern, 500.0, 500.0, card(), LayoutOptions(seam_rows=(4,), seam_columns=(6,)))
    cells = pattern.cells - pattern.cells.min(axis=0)
    wanted = 2 * (cells[:, 1] >= 4) + (cells[:, 0] >= 6)
    np.testing.assert_array_equal(found, wanted)
    rows = int(cells[:, 1].max()) + 1
    with pytest.raises(LayoutError, match=f"between the {rows} rows of facets, at 1 to {rows - 1}"):
        split(pattern, 500.0, 500.0, card(), LayoutOptions(seam_rows=(rows,)))


def test_a_whole_piece_is_a_grid_and_a_trimmed_one_is_not():
    for piece in hanging_together(two_pieces()):
        grid = full_grid(piece.pattern)
        assert grid.shape == (8, 4)
        row, column = np.indices(grid.shape)
        cells = piece.pattern.cells[grid]
        np.testing.assert_array_equal(cells[..., 0] - cells[0, 0, 0], column)
        np.testing.assert_array_equal(cells[..., 1], row)
    for piece in hanging_together(two_trimmed_pieces()):
        assert full_grid(piece.pattern) is None


def test_a_piece_of_which_no_seam_is_measured_has_no_place_in_the_shell():
    pattern = two_pieces()
    shell = pattern.folded_coords.copy()
    other = np.unique(pattern.faces_vertices[pattern.pieces == 1])
    moved = shell.copy()
    moved[other] += [5.0, -3.0, 8.0]
    assert _joined(pattern, pattern.pieces, moved.copy()) == pytest.approx(shell)
    moved[np.intersect1d(other, pattern.seam_vertices)] = np.nan
    lost = _joined(pattern, pattern.pieces, moved.copy())
    assert np.isnan(lost[other]).all()
    one = np.setdiff1d(np.arange(len(shell)), other)
    assert np.array_equal(lost[one], shell[one])
