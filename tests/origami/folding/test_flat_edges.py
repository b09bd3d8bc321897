"""Lines that nobody folds change nothing: facets are joined over them, and frames hold them."""

from __future__ import annotations

from dataclasses import replace

import named_patterns
import numpy as np
import pytest

from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.ruled import rulings_among as rulings
from miurafab.origami.folding import flat_edges
from miurafab.origami.folding.flat_edges import without_flat_edges
from miurafab.origami.folding.kinematics import CLOSED_FORM, FROM_FLAT
from miurafab.origami.folding.motion import find_motion

CORNERS = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
BASE = [*named_patterns.border(*CORNERS)]
BASE += [((0.0, 0.0), corner, "V", 180.0) for corner in CORNERS]
BASE += [((0.0, 0.0), (x, 0.0), "M", 180.0) for x in (-1.0, 1.0)]
# a cross in the upper facet, whose middle is a vertex of its own, and a line that meets a valley
STRAY = [((-0.5, 0.5), (0.5, 0.5), "F", 0.0), ((0.0, 0.0), (0.0, 1.0), "F", 0.0)]
STRAY += [((0.5, -0.5), (1.0, -0.5), "F", 0.0)]


def folded(pattern: CreasePattern) -> dict[tuple[float, ...], float]:
    """The last fold angle at the middle of each crease, whatever its number."""
    motion = find_motion(pattern, 6).motion
    folds = np.isin(pattern.edges_assignment, ("M", "V"))
    ends = pattern.vertices_coords[pattern.edges_vertices[folds]]
    angle = motion.fold_angles[-1, folds]
    turn = np.degrees(np.arctan2(*(ends.mean(axis=1) - 10.0).T[::-1]))
    return {round(float(t) / 5): float(a) for t, a in zip(turn, angle, strict=True)}


@pytest.mark.parametrize("letter", ["F", "J"])
def test_stray_lines_change_no_fold_angle_and_are_carried_along(letter: str) -> None:
    lines = [(one, other, letter, angle) for one, other, _, angle in STRAY]
    plain, stray = named_patterns.drawn(BASE), named_patterns.drawn(BASE + lines)
    assert len(stray.faces_vertices) > len(plain.faces_vertices)
    assert folded(stray) == pytest.approx(folded(plain), abs=1e-5)
    found = find_motion(stray, 6)
    assert found.motion.method == FROM_FLAT
    assert found.motion.is_rigid
    assert found.motion.frames.shape[1] == len(stray.vertices_coords)
    flat = edge_lengths(stray.vertices_coords, stray.edges_vertices)
    for frame in found.motion.frames:
        assert edge_lengths(frame, stray.edges_vertices) == pytest.approx(flat, abs=1e-9)
    assert not found.motion.fold_angles[:, stray.edges_assignment == letter].any()


def test_what_is_joined_is_a_polygon() -> None:
    stray = named_patterns.drawn(BASE + STRAY)
    lean = without_flat_edges(stray)
    assert len(lean.pattern.faces_vertices) == 6
    assert len(lean.inside) == 1
    # a crease that ends inside keeps its facets apart, and a flat edge that is folded is a crease
    ends_inside = named_patterns.drawn([*BASE, *STRAY, ((0.0, 0.5), (0.2, 0.7), "V", 90.0)])
    plain = without_flat_edges(ends_inside)
    assert plain.pattern.faces_vertices.shape[0] >= 6
    bent = replace(stray, edges_fold_angle=np.where(stray.edges_assignment == "F", 0.1, np.pi))
    assert without_flat_edges(bent).pattern is bent


def squares(creased: set[tuple[tuple[int, int], tuple[int, int]]]) -> CreasePattern:
    """3 x 3 squares; the sides between the ``creased`` pairs of cells are folds, others flat."""
    lines = named_patterns.border((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0))
    for x in range(3):
        for y in range(3):
            for dx, dy in ((1, 0), (0, 1)):
                if max(x + dx, y + dy) < 3:
                    pair = ((x, y), (x + dx, y + dy))
                    start = (float(x + dx), float(y + dy))
                    letter = "M" if pair in creased else "J"
                    angle = 90.0 if letter == "M" else 0.0
                    lines.append((start, (start[0] + dy, start[1] + dx), letter, angle))
    return named_patterns.drawn(lines)


def sides_of(*cells: tuple[int, int]) -> set[tuple[tuple[int, int], tuple[int, int]]]:
    around = [((x, y), (x + dx, y + dy)) for x, y in cells for dx, dy in ((1, 0), (0, 1))]
    return {*around, *(((x - dx, y - dy), (x, y)) for x, y in cells
                       for dx, dy in ((1, 0), (0, 1)))}  # fmt: skip


@pytest.mark.parametrize(
    ("creased", "facets"),
    [
        (set(), 1),
        (sides_of((1, 1)), 9),  # a ring round one facet is no polygon
        (sides_of((0, 0), (1, 1)), 9),  # nor are seven facets that touch in a corner
        ({((0, 1), (1, 1))}, 9),  # nor is a sheet in whose middle a crease ends
        ({((0, y), (1, y)) for y in range(3)}, 2),
    ],
)
def test_facets_are_joined_over_flat_edges_if_they_make_a_polygon(creased, facets) -> None:
    assert len(without_flat_edges(squares(creased)).pattern.faces_vertices) == facets


def test_creases_cut_in_two_by_a_stray_line_keep_the_closed_form() -> None:
    """At a vertex of two creases in a line both fold alike; flat edges do not count."""
    lines = named_patterns.border((0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0))
    lines += [((x, 0.0), (x, 2.0), letter, 180.0) for x, letter in ((1.0, "V"), (2.0, "M"))]
    lines += [((0.0, 1.0), (3.0, 1.0), "F", 0.0)]
    pattern = named_patterns.drawn(lines)
    motion = find_motion(pattern, 6).motion
    assert motion.method == CLOSED_FORM
    assert motion.is_rigid
    angles = np.abs(motion.fold_angles[:, np.isin(pattern.edges_assignment, ("M", "V"))])
    assert angles == pytest.approx(angles[:, :1].repeat(angles.shape[1], 1), abs=1e-12)


def test_the_flat_edges_of_many_facets_are_looked_for_once(monkeypatch) -> None:
    """They were looked for anew for each joined facet: 28,000 facets took minutes. Each cell has a
    vertex in its middle, which stays there."""
    calls = []

    def counted(*given):
        calls.append(given)
        return rulings(*given)

    monkeypatch.setattr(flat_edges, "rulings_among", counted)
    lines = [((0, y), (4, y), "V", 90.0) for y in (1, 2, 3)]
    lines += [((x, 0), (x, 4), "M", 90.0) for x in (1, 2, 3)]
    for x in range(4):
        for y in range(4):
            corners = ((x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1))
            lines += [(corner, (x + 0.25, y + 0.5), "F", 0.0) for corner in corners]
    drawn = named_patterns.drawn([*lines, *named_patterns.border((0, 0), (4, 0), (4, 4), (0, 4))])
    found = flat_edges.without_flat_edges(drawn)
    assert len(drawn.faces_vertices) == 64
    assert found.pattern.faces_vertices.shape == (16, 4)
    assert len(calls) == 1
    corners = found.pattern.vertices_coords[found.corners]
    places = np.einsum("nc,nck->nk", found.places, corners)
    assert places == pytest.approx(drawn.vertices_coords[found.inside])
    assert found.places.min() > -1e-9
    assert len(found.inside) == 16
