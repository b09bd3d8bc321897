"""The topology of quads in charts: whole grids, missing cells, seams and rings."""

from __future__ import annotations

import numpy as np
import pytest

from miurafab.geometry.quads import QuadCharts, QuadGrid


def test_a_whole_grid_has_the_numbering_and_topology_of_a_quad_grid() -> None:
    grid, charts = QuadGrid(6, 4), QuadCharts.of_cells(np.ones((3, 5), dtype=bool))
    assert charts.vertices_count == 24
    for name in ("faces_vertices", "edges_vertices", "interior_vertices", "interior_neighbours"):
        assert np.array_equal(getattr(charts, name), getattr(grid, name)), name
    assert np.array_equal(charts.lattice, np.argwhere(np.ones((4, 6)))[:, ::-1])
    assert len(charts.neighbouring_facets) == 5 * 2 + 4 * 3


@pytest.mark.parametrize("sides", [(1, 4), (4, 1)])
def test_a_grid_of_one_line_has_no_facet(sides: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=f"{sides[0]} x {sides[1]} vertices has no facet"):
        QuadGrid(*sides)


def test_developability_is_asked_only_inside_a_chart() -> None:
    charts = QuadCharts.of_cells(np.ones((4, 6), dtype=bool), np.repeat([0, 1], 3))
    columns, rows = charts.lattice[charts.interior_vertices].T
    assert set(columns.tolist()) == {1, 2, 4, 5}
    assert set(rows.tolist()) == {1, 2, 3}
    assert len(charts.neighbouring_facets) == 2 * 2 * 4 + 6 * 3


def test_a_closed_body_of_gores_shares_its_last_seam_with_the_first() -> None:
    charts = QuadCharts.of_cells(np.ones((5, 8), dtype=bool), np.repeat(range(4), 2), closed=True)
    assert charts.vertices_count == 8 * 6
    assert len(charts.interior_vertices) == 4 * 4
    euler = charts.vertices_count - len(charts.edges_vertices) + len(charts.faces_vertices)
    assert euler == 0


def test_a_ring_of_one_chart_is_developable_all_round() -> None:
    charts = QuadCharts.of_cells(np.ones((3, 8), dtype=bool), closed=True)
    assert len(charts.interior_vertices) == 8 * 2
    right = charts.interior_neighbours[:, 0]
    step = charts.lattice[right, 0] - charts.lattice[charts.interior_vertices, 0]
    assert set((step % 8).tolist()) == {1}


def test_cells_left_out_leave_a_border() -> None:
    kept = np.ones((4, 4), dtype=bool)
    kept[2:, 2:] = False
    charts = QuadCharts.of_cells(kept)
    assert len(charts.faces_vertices) == 12
    assert charts.vertices_count == 25 - 4
    # of the nine inner vertices of the whole grid, the one at the notch and three more are rim
    assert len(charts.interior_vertices) == 9 - 4
    assert np.array_equal(np.unique(charts.faces_vertices), np.arange(charts.vertices_count))
