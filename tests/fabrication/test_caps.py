"""Caps: a fan of triangles that closes an open border exactly, and is cut from flat paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_patterns import bed, card
from piece_problems import gores

from miurafab.errors import LayoutError
from miurafab.fabrication.borders import open_borders
from miurafab.fabrication.caps import capped
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.geometry.polygons import signed_areas
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.unfold import unfold_charts
from miurafab.origami.verify import audit


def prism(profile, height=30.0):
    """A tube over the corners ``profile`` (n, 2), in one piece."""
    profile = np.array(profile, dtype=float)
    points = [np.column_stack([profile, np.full(len(profile), z)]) for z in (0.0, height)]
    whole = np.ones((1, len(profile)), dtype=bool)
    return unfold_charts(QuadCharts.of_cells(whole, closed=True), np.concatenate(points))


def hexagon(radius=25.0):
    turn = np.pi / 3 * np.arange(6)
    return radius * np.column_stack([np.cos(turn), np.sin(turn)])


def corner_sum(pattern, points, vertex):
    """The sum of the angles of the facets at ``vertex``."""
    total = 0.0
    for face in pattern.faces_vertices:
        ring = [v for v in face.tolist() if v >= 0]
        if vertex in ring:
            at = ring.index(vertex)
            a, b = (
                points[ring[at - 1]] - points[vertex],
                points[ring[at + 1 - len(ring)]] - points[vertex],
            )
            total += np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
    return total


def test_caps_of_a_zigzag_rim_are_exact_and_close_the_shell():
    pattern = gores()
    made = capped(pattern, LayoutOptions(caps="all"))
    assert made.pieces_count == pattern.pieces_count + 2
    assert open_borders(made) == ()
    assert len(made.seams) == len(pattern.seams) + 24
    checked = audit(made, None)
    assert checked.valid, checked.findings
    assert checked.measurements.max_isometry < 1e-12
    assert checked.measurements.self_intersections == 0
    for number in (1, 2):
        faces = made.faces_vertices[made.pieces == pattern.pieces_count - 1 + number]
        apex = int(faces[0][faces[0] >= 0][-1])
        for points in (made.folded_coords, made.vertices_coords):
            assert corner_sum(made, points, apex) == pytest.approx(2 * np.pi, abs=1e-12)
    # What was there is as it was.
    count = len(pattern.edges_vertices)
    np.testing.assert_array_equal(made.edges_assignment[:count], pattern.edges_assignment)
    np.testing.assert_array_equal(
        made.folded_coords[: len(pattern.folded_coords)], pattern.folded_coords
    )


def test_the_cap_of_a_flat_rim_is_the_flat_polygon_over_it():
    pattern = prism(hexagon())
    made = capped(pattern, LayoutOptions(caps=(1,)))
    assert len(open_borders(made)) == 1
    own = made.pieces == 1
    spokes = made.edges_assignment[len(pattern.edges_vertices) + 6 :]
    assert spokes.tolist() == ["F"] * 6
    areas = signed_areas(made.vertices_coords[made.faces_vertices[own][:, :3]])
    assert areas.sum() == pytest.approx(1.5 * np.sqrt(3) * 25.0**2, rel=1e-12)
    assert (areas > 0).all()
    assert audit(made, None).valid


def test_a_capped_shell_is_laid_out_and_one_end_may_bear_tabs():
    options = LayoutOptions(caps=(1,), border_tabs="all")
    layout = lay_out(gores(), bed(400.0, 400.0), card(), options=options)
    assert layout.totals.patches == 5
    assert [border.number for border in layout.borders] == [1]
    assert layout.totals.border_tabs == 12
    cap = layout.patches[-1]
    tabs = {tab.mate_patch for tab in cap.tabs} | {
        patch.id for patch in layout.patches for tab in patch.tabs if tab.mate_patch == cap.id
    }
    assert tabs == {0, 1, 2, 3}


def test_a_cap_that_would_pass_through_the_shell_is_refused():
    """A corner of the lower rim is drawn up through the flat polygon over the upper rim."""
    pattern = prism(hexagon())
    spike = pattern.folded_coords.copy()
    spike[2] = [0.0, 0.0, 60.0]
    made = replace(pattern, folded_coords=spike)
    with pytest.raises(LayoutError, match="A cap would pass through the shell at 1 place;"):
        capped(made, LayoutOptions(caps=(2,)))


def test_caps_of_triangles_without_a_lattice():
    """The walls of a prism, each cut into two triangles, stand in no columns and rows."""
    pattern = prism(hexagon())
    quads = pattern.faces_vertices
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    diagonals = quads[:, [0, 2]]
    count = len(diagonals)
    made = replace(
        pattern,
        faces_vertices=triangles,
        edges_vertices=np.concatenate([pattern.edges_vertices, diagonals]),
        edges_assignment=np.append(pattern.edges_assignment, ["F"] * count),
        edges_fold_angle=np.append(pattern.edges_fold_angle, np.zeros(count)),
        grid=None,
        cells=None,
    )
    whole = capped(made, LayoutOptions(caps="all"))
    assert whole.cells is None
    assert open_borders(whole) == ()
    assert audit(whole, None).valid


def test_what_no_cap_closes_is_refused_by_its_number():
    with pytest.raises(LayoutError, match="shaped by the folded form, which the pattern lacks"):
        capped(replace(gores(), folded_coords=None), LayoutOptions(caps="all"))
    with pytest.raises(LayoutError, match=r"caps. names open border 3, but the shell has 2"):
        capped(gores(), LayoutOptions(caps=(3,)))
    c = 10 * np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (3, 2), (3, 3), (0, 3)])
    with pytest.raises(LayoutError, match="Open border 1 turns back as seen from its middle"):
        capped(prism(c), LayoutOptions(caps="all"))
