"""Ticks: one bar across a mountain, two across a valley, at the ends on the outline."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, facet_polygons, miura, triangles, zigzag

from miurafab.errors import OptionError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.ticks import CLEAR_MM, fold_ticks
from miurafab.profiles import OPERATIONS


@pytest.mark.parametrize(
    "pattern",
    [
        pytest.param(miura(9, 7), id="miura"),
        pytest.param(zigzag(8, 6, a=14.0), id="acute"),
        pytest.param(triangles(3, 5, 200.0), id="triangles"),
    ],
)
def test_bars_cross_their_fold_and_lie_on_its_facets(pattern):
    letters = pattern.edges_assignment
    face_patch = (np.arange(len(pattern.faces_vertices)) > 20).astype(np.int64)
    patch = np.where(pattern.edges_faces >= 0, face_patch[pattern.edges_faces], -1)
    edges = np.flatnonzero((patch[:, 0] == patch[:, 1]) & np.isin(letters, ["M", "V"]))
    ticks = fold_ticks(pattern, face_patch, edges, patch[edges, 0], 1.2)
    rim = np.zeros(len(pattern.vertices_coords), dtype=bool)
    rim[pattern.edges_vertices[patch[:, 0] != patch[:, 1]]] = True
    count = np.bincount(ticks.edge, minlength=len(letters))
    assert len(ticks.ends)
    ends = rim[pattern.edges_vertices[edges]].sum()
    assert ends == len(np.unique(ticks.group)) + ticks.left_out
    assert ticks.left_out < 0.3 * ends
    facets, folds = facet_polygons(pattern), pattern.vertices_coords[pattern.edges_vertices]
    for bar, edge, own in zip(ticks.ends, ticks.edge.tolist(), ticks.patch.tolist(), strict=True):
        line, fold = shapely.LineString(bar), shapely.LineString(folds[edge])
        assert line.length == pytest.approx(1.2)
        assert np.allclose(shapely.get_coordinates(line.centroid), _nearest(fold, line.centroid))
        assert abs((bar[1] - bar[0]) @ (folds[edge][1] - folds[edge][0])) < 1e-9
        both = shapely.union_all([facets[face] for face in pattern.edges_faces[edge]])
        assert both.buffer(-CLEAR_MM + 1e-6).covers(line)
        assert patch[edge].tolist() == [own, own]
        ways = count[edge] / (2 if letters[edge] == "V" else 1)
        assert ways in (1, 2)


def _nearest(line, point):
    return shapely.get_coordinates(line.interpolate(line.project(point)))


def test_a_fold_without_room_for_its_tick_is_told():
    options = LayoutOptions(ticks_mm=3.0)
    layout = lay_out(miura(2, 2, 4.0, 4.0), bed(150, 150), card(), options=options)
    (told,) = (finding for finding in layout.findings if finding.code == "ticks")
    assert told.sentence == "4 ends of folds have no room for a tick."
    assert not layout.toolpaths[0].length_of("engrave")


@pytest.mark.parametrize("marks", ["front", "back"])
def test_ticks_lie_on_the_side_of_the_marks(marks):
    layout = lay_out(
        miura(6, 5), bed(150.0, 150.0), card(), options=LayoutOptions(marks=marks, ticks_mm=1.0)
    )
    ticked = [
        path.sheet.endswith("-back")
        for path in layout.passes
        if ((path.operation == OPERATIONS.index("engrave")) & (path.edge >= 0)).any()
    ]
    assert ticked == [marks == "back"]


def test_clean_facets_bear_no_ticks():
    with pytest.raises(OptionError, match="'marks' is tabs"):
        LayoutOptions(marks="tabs", ticks_mm=1.0)
