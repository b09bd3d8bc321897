"""Open borders of a shell, and the tabs that stand on them."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, facet_polygons
from piece_problems import gores, trimmed, two_pieces

from miurafab.errors import LayoutError, OptionError
from miurafab.fabrication.borders import chosen_edges, open_borders
from miurafab.fabrication.layout import read_layout, write_layout
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.tabs import inset_of
from miurafab.geometry.polygons import edge_lengths
from miurafab.profiles import OPERATIONS


def square(size=30.0):
    return flat_patterns.grid(np.array([[[0.0, 0.0], [size, 0.0]], [[0.0, size], [size, size]]]))


def test_the_glued_tube_has_two_open_borders_and_a_sheet_has_one():
    pattern = gores()
    first, second = open_borders(pattern)
    rim = 238.3
    assert first.length_mm == pytest.approx(second.length_mm, rel=1e-12)
    assert first.length_mm == pytest.approx(rim, abs=0.1)
    assert len(first.edges) == len(second.edges) == 12
    glued = set(pattern.seams.ravel().tolist())
    rest = set(np.flatnonzero(pattern.edges_assignment == "B").tolist()) - glued
    assert set(first.edges) | set(second.edges) == rest
    # The rim of this tube is a star of corners at 30 and 39 mm, six of them far out.
    assert first.across_mm == pytest.approx(2 * 1.3 * 30.0, rel=0.01)
    for whole in (trimmed(), two_pieces()):
        (only,) = open_borders(whole)
        length = edge_lengths(whole.vertices_coords, whole.edges_vertices[list(only.edges)])
        assert only.length_mm == pytest.approx(length.sum(), rel=1e-12)


def test_border_tabs_of_a_square_in_closed_form():
    pattern, material = square(), card(inset=0.5)
    outlined = outline_patches(pattern, 300.0, 300.0, material, LayoutOptions(border_tabs="all"))
    tabs, inset = outlined.tabs, inset_of(card(inset=0.5))
    assert len(tabs) == 4
    # A base less the inset at both ends, and sides that lean by the largest angle.
    base = 30.0 - 2 * inset
    top = base - 2 * 7.0 / math.tan(material.tabs.max_angle)
    np.testing.assert_allclose(tabs.areas, 7.0 * (base + top) / 2, rtol=1e-6)
    assert (tabs.mate_face == -1).all()
    assert outline_patches(pattern, 300.0, 300.0, material).tabs.edge.size == 0


@pytest.mark.parametrize("size", [(300.0, 300.0), (70.0, 60.0)])
@pytest.mark.parametrize("pattern", [gores(), trimmed()], ids=["gores", "trimmed"])
def test_border_tabs_lie_outside_of_the_paper_and_apart(pattern, size):
    material = replace(card(), tabs=replace(card().tabs, max_angle=math.pi))
    options = LayoutOptions(border_tabs="all")
    outlined = outline_patches(pattern, *size, material, options)
    wanted = chosen_edges(pattern, "all")
    tabs = outlined.tabs
    found = tabs.edge[tabs.mate_face < 0]
    missing = outlined.untabbed
    assert set(found) | set(missing) >= set(wanted)
    assert len(found) > 0.8 * len(wanted)
    facets = facet_polygons(pattern)
    for patch in outlined.patches:
        own = [shapely.Polygon(tabs.polygon(tab)) for tab in patch.tabs]
        paper = shapely.union_all(facets[patch.faces], grid_size=1e-9)
        for place, tab in enumerate(patch.tabs):
            base = pattern.vertices_coords[pattern.edges_vertices[tabs.edge[tab]]]
            line = shapely.LineString(base)
            assert own[place].intersection(paper).area < 1e-6
            assert line.buffer(1e-6).covers(shapely.LineString(tabs.polygon(tab)[:2]))
            for other in own[:place]:
                assert own[place].distance(other) >= inset_of(material) - 1e-6
        for tab in own:
            assert tab.area >= 2.0
        line = shapely.Polygon(patch.cut_lines[0], patch.cut_lines[1:])
        assert line.covers(shapely.union_all([paper, *own]).buffer(-1e-6))


def test_tabs_stand_on_the_border_that_is_chosen_and_say_so():
    pattern = gores()
    layout = lay_out(pattern, bed(400.0, 400.0), card(), options=LayoutOptions(border_tabs=(2,)))
    second = open_borders(pattern)[1]
    free = [tab for patch in layout.patches for tab in patch.tabs if tab.mate_patch is None]
    assert {tab.edge for tab in free} == set(second.edges)
    assert layout.totals.border_tabs == len(free) == 12
    assert layout.totals.tabs == 12 + len(pattern.seams)
    text = write_layout(layout, "gores.fold", "0" * 64)
    told = [tab for patch in json.loads(text)["patches"] for tab in patch["tabs"]]
    assert sum(tab["mate_edge"] is None and tab["mate_patch"] is None for tab in told) == 12
    again = read_layout(text)
    assert again.borders == layout.borders
    assert write_layout(again, "gores.fold", "0" * 64) == text
    (path,) = layout.toolpaths
    dashes = path.operation == OPERATIONS.index("perforate")
    folded = set(path.edge[dashes].tolist())
    assert set(second.edges) <= folded
    assert not set(open_borders(pattern)[0].edges) & folded


def test_a_border_that_is_not_there_is_refused_by_its_number():
    with pytest.raises(LayoutError, match="open border 3, but the shell has 2"):
        lay_out(gores(), bed(400.0, 400.0), card(), options=LayoutOptions(border_tabs=(1, 3)))
    with pytest.raises(OptionError, match="border_tabs"):
        LayoutOptions(border_tabs=(0,))
