"""Seam lines: what meets bears one number, in every drawing of a pattern."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure
from piece_problems import gores, trimmed, two_pieces, two_trimmed_pieces

from miurafab.origami.picture import flat_svg, pattern_svg
from miurafab.origami.seam_lines import SEAM_WORDS, seam_lines

CASES = {"gores": (gores(), 4), "two": (two_pieces(), 1), "trimmed": (two_trimmed_pieces(), 1)}


@pytest.mark.parametrize(("pattern", "count"), CASES.values(), ids=CASES)
def test_each_seam_is_in_one_line_between_two_sides_of_two_pieces(pattern, count):
    # The order of a pair and of the pairs says nothing.
    mixed = pattern.seams[::-1].copy()
    mixed[::2] = mixed[::2, ::-1]
    lines = seam_lines(replace(pattern, seams=mixed))
    assert [line.number for line in lines] == list(range(1, count + 1))
    told = sorted(tuple(sorted(pair)) for line in lines for pair in line.edges.tolist())
    assert told == sorted(tuple(sorted(pair)) for pair in pattern.seams.tolist())
    for line in lines:
        faces = pattern.edges_faces[line.edges].max(axis=2)
        sides = pattern.pieces[faces]
        assert (sides == sides[0]).all()
        for side in (0, 1):
            ends = np.bincount(pattern.edges_vertices[line.edges[:, side]].ravel())
            assert np.bincount(ends)[1] == 2, "one unbroken line"
            near = shapely.MultiLineString(
                list(pattern.vertices_coords[pattern.edges_vertices[line.edges[:, side]]])
            )
            assert near.distance(shapely.Point(line.places[side])) < 0.5 * near.length / len(
                line.edges
            )
            own = pattern.faces_vertices[pattern.pieces == sides[0, side]]
            paper = shapely.union_all(
                [shapely.Polygon(pattern.vertices_coords[f[f >= 0]]) for f in own], grid_size=1e-9
            )
            assert paper.contains(shapely.Point(line.places[side]))


def test_a_pattern_without_seams_has_no_line():
    assert seam_lines(trimmed()) == ()
    assert SEAM_WORDS not in flat_svg(trimmed(), 400.0)


def test_the_plot_numbers_both_sides_of_each_seam():
    pattern = gores()
    axes = Figure().add_subplot()
    assert pattern.plot("flat", axes) is axes
    assert sorted(text.get_text() for text in axes.texts) == sorted("11223344")
    drawn = {each.get_label(): len(each.get_segments()) for each in axes.collections}
    sides = sum(line.edges.size for line in seam_lines(pattern))
    assert drawn["border"] == (pattern.edges_assignment == "B").sum() - sides
    assert drawn[SEAM_WORDS.replace(": ", ":\n")] == 2 * len(seam_lines(pattern)[0].edges)
    assert sum(drawn.values()) == len(pattern.edges_vertices)


def test_the_picture_of_a_pattern_without_a_folded_form_is_the_flat_one():
    pattern = replace(gores(), folded_coords=None)
    assert pattern_svg(pattern, 640.0) == flat_svg(pattern, 320.0)


def test_the_picture_shows_both_sides_in_one_colour_with_one_number():
    pattern = gores()
    root = ElementTree.fromstring(flat_svg(pattern, 640.0))
    texts = [node.text for node in root.iter("{http://www.w3.org/2000/svg}text")]
    assert sorted(texts) == sorted([*"11223344", SEAM_WORDS])
    strokes = {}
    for node in root.iter("{http://www.w3.org/2000/svg}path"):
        strokes[node.get("stroke")] = len(re.findall("M", node.get("d")))
    for line in seam_lines(pattern):
        assert strokes[line.colour] == 2 * len(line.edges)
    drawn = sum(strokes.values())
    assert drawn == len(pattern.edges_vertices), "each edge is drawn once"
