"""The folder's kit against the pattern: rows, letters, angles, wedges."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from problems import regular

from miurafab.fabrication.kit.gauge import FLAT_DEG, MOST, STEP_DEG, wedges
from miurafab.fabrication.kit.plan import folders_kit, kit_table, read_kit
from miurafab.fabrication.kit.rows import Row, bend_of, crease_lines, named, numbered
from miurafab.origami.crease_pattern import CreasePattern


def trimmed(pattern: CreasePattern, keep: np.ndarray) -> CreasePattern:
    """``pattern`` with the facets ``keep`` alone and its cells told facet by facet."""
    columns = pattern.grid[0] - 1
    number = np.arange(len(pattern.faces_vertices))
    cells = np.stack([number % columns + 4, number // columns + 7], axis=1)
    beside = np.where(pattern.edges_faces >= 0, keep[pattern.edges_faces], False)
    letters = np.where(beside.all(axis=1), pattern.edges_assignment, "B")
    used = beside.any(axis=1)
    return CreasePattern(
        pattern.vertices_coords,
        pattern.edges_vertices[used],
        letters[used],
        np.where(letters == "B", 0.0, pattern.edges_fold_angle)[used],
        pattern.faces_vertices[keep],
        cells=cells[keep],
    )


def test_each_row_of_the_grid_stands_once_in_the_order_and_each_crease_in_one_row():
    pattern = regular(9, 7)
    rows = [row.name for row in folders_kit(pattern).rows]
    assert sorted(rows) == sorted([f"C{n}" for n in range(1, 8)] + [f"R{n}" for n in range(1, 6)])
    edges = np.concatenate([line.edges for line in crease_lines(pattern)])
    creases = np.flatnonzero(np.isin(pattern.edges_assignment, ("M", "V")))
    assert sorted(edges.tolist()) == creases.tolist()


def test_a_row_lies_on_its_grid_line_and_tells_mountain_from_valley():
    pattern = regular(9, 7)
    row, column = np.divmod(pattern.edges_vertices, 9)
    for line in crease_lines(pattern):
        at = row if line.family == "R" else column
        assert (at[line.edges] == line.number).all()
        other = column if line.family == "R" else row
        assert (np.diff(other[line.edges].mean(axis=1)) == 1).all()
        assert line.letters == "".join(pattern.edges_assignment[line.edges])
        assert (pattern.edges_fold_angle[line.edges] > 0).tolist() == [
            letter == "V" for letter in line.letters
        ]


def test_lines_that_can_be_folded_over_in_one_go_come_first():
    """In a regular Miura-ori these are straight, and the others turn by 180 - 2 alpha degrees."""
    lines = crease_lines(regular(9, 7))
    first = [line for line in lines if line.family == lines[0].family]
    then = lines[len(first) :]
    pattern = regular(9, 7)
    assert bend_of(pattern, first) == pytest.approx(0, abs=1e-9)
    assert bend_of(pattern, then) == pytest.approx(math.pi - 2 * math.radians(65))
    assert {line.fold for line in first} == {"MV"}
    assert {line.fold for line in then} == {"M", "V"}


def test_rows_of_a_trimmed_sheet_count_from_its_rim_and_skip_what_is_not_there():
    whole = regular(9, 7)
    keep = np.ones(48, dtype=bool)
    keep[[0, 7, 19, 20, 40]] = False
    pattern = trimmed(whole, keep)
    lines = crease_lines(pattern)
    assert {line.name for line in lines} == {line.name for line in crease_lines(whole)}
    creases = np.isin(pattern.edges_assignment, ("M", "V"))
    assert sum(len(line.edges) for line in lines) == creases.sum()
    assert folders_kit(pattern).unnumbered == 0


def test_creases_of_a_pattern_without_a_lattice_are_counted_and_in_no_row():
    pattern = dataclasses.replace(regular(9, 7), grid=None)
    kit = folders_kit(pattern)
    assert kit.rows == ()
    assert kit.wedges == ()
    assert kit.unnumbered == np.isin(pattern.edges_assignment, ("M", "V")).sum()


def test_the_angles_of_a_row_are_those_of_its_creases():
    pattern = regular(9, 7)
    kit = folders_kit(pattern)
    assert read_kit(kit_table(kit)) == kit
    for line, row in zip(crease_lines(pattern), kit.rows, strict=True):
        sizes = np.degrees(np.abs(pattern.edges_fold_angle[line.edges]))
        told = (row.median_deg, row.least_deg, row.greatest_deg)
        found = (np.median(sizes), sizes.min(), sizes.max())
        assert np.abs(np.array(told) - found).max() <= 0.005 + 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_each_row_has_one_wedge_within_half_a_step(seed):
    rng = np.random.default_rng(seed)
    spread = rng.uniform(1.0, 120.0)
    medians = np.clip(rng.normal(110.0, spread, 60), 1.0, 180.0).round(2).tolist()
    rows = [Row(f"R{k}", "M", angle, angle, angle) for k, angle in enumerate(medians, start=1)]
    made = wedges(rows)
    assert len(made) <= MOST
    names = [name for wedge in made for name in wedge.rows]
    assert sorted(names) == sorted(row.name for row in rows if row.median_deg <= FLAT_DEG)
    step, angles = STEP_DEG, {row.name: row.median_deg for row in rows}
    groups = [[180 - angles[name] for name in wedge.rows] for wedge in made]
    while max(max(group) - min(group) for group in groups) > step:
        step *= 2
    assert step <= 40
    for wedge, group in zip(made, groups, strict=True):
        off = [abs(wedge.opening_deg - opening) for opening in group]
        assert max(off) <= step / 2 + 0.05


def test_names_of_rows_are_drawn_together():
    assert named(["R3", "C1", "R1", "R2", "C7"]) == "C1, C7, R1-R3"
    assert numbered([1, 3, 5, 7], "R") == "R1, R3 ... R7"
    assert numbered([1, 2, 3, 4], "R") == "R1-R4"
    assert numbered([2, 5, 6], "C") == "C2, C5-C6"
