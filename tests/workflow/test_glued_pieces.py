"""A job of several pieces, read back from its files alone and glued in memory, is the shell."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from gluing import (
    edge_numbers,
    flat_points,
    glued_shell,
    in_patch,
    joints,
    read_job,
    side,
    untabbed,
)
from piece_problems import gores, trimmed, two_pieces, two_trimmed_pieces

import miurafab as mf


def fitted_globe():
    globe = {"latitude": 60, "angle": 360, "close": "seam"}
    sheet = mf.fit(
        "ellipsoid", facets=(8, 16), pieces=4, size=200, amplitude=0.83, zigzag=1.3, **globe
    )
    assert sheet.status == "converged"
    return sheet.pattern


CASES = {
    "gores": (gores, {}),
    "gores in patches": (gores, {"max_patch": (110, 75), "tab_side": "upper"}),
    "capped": (gores, {"caps": "all"}),
    "two pieces": (two_pieces, {"tab_side": "alternate"}),
    "trimmed": (trimmed, {"max_patch": (90, 60)}),
    "trimmed pieces": (two_trimmed_pieces, {"full_facet": True}),
    "a fitted globe": (fitted_globe, {}),
}


@pytest.fixture(scope="module", params=CASES)
def job(request, tmp_path_factory):
    make, options = CASES[request.param]
    folder = tmp_path_factory.mktemp("job")
    made = mf.sheets(make(), machine="grbl-laser-400", material="card-250", **options)
    made.write(folder)
    return read_job(folder)


def test_the_glued_patches_are_the_shell(job):
    layout, file = job
    tabs, seams = layout["totals"]["tabs"], len(file.get("miurafab:seams", []))
    assert len(joints(layout, file)) >= 2 * max(tabs, seams)
    gap, off = glued_shell(layout, file)
    assert gap < 0.05, "each seam closes, also those that were not used to lay a patch"
    assert off < 0.05
    facets = sorted(face for patch in layout["patches"] for face in patch["faces"])
    assert facets == list(range(len(file["faces_vertices"])))


def test_each_seam_of_the_pattern_has_one_tab_of_one_number(job):
    layout, file = job
    told = sorted(
        tuple(sorted((tab["edge"], tab["mate_edge"])))
        for patch in layout["patches"]
        for tab in patch["tabs"]
    )
    seams = sorted(
        tuple(sorted(pair))
        for pair in file.get("miurafab:seams", [])
        if not untabbed(layout) & set(pair)
    )
    assert [pair for pair in told if pair[0] != pair[1]] == seams
    assert len(set(told)) == len(told)
    numbers = [tab["number"] for patch in layout["patches"] for tab in patch["tabs"]]
    assert sorted(numbers) == list(range(1, len(numbers) + 1))
    home = {face: patch["id"] for patch in layout["patches"] for face in patch["faces"]}
    edges = edge_numbers(file)
    sides = {}
    for face, ring in enumerate(file["faces_vertices"]):
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            sides.setdefault(edges[frozenset((a, b))], set()).add(home[face])
    inner = {edge for edge, patches in sides.items() if len(patches) == 2}
    assert {pair[0] for pair in told if pair[0] == pair[1]} == inner


def test_each_tab_stands_on_its_edge_and_fits_its_mate(job):
    layout, file = job
    flat = flat_points(file)
    for patch in layout["patches"]:
        for tab in patch["tabs"]:
            mate = layout["patches"][tab["mate_patch"]]
            a, b = side(file, tab["edge"], set(patch["faces"]))
            c, d = side(file, tab["mate_edge"], set(mate["faces"]))
            start, end = in_patch(patch, flat[[a, b]])
            to_end, to_start = in_patch(mate, flat[[c, d]])
            along = complex(*(to_end - to_start)) / complex(*(end - start))
            assert abs(along) == pytest.approx(1.0, abs=1e-6), "both edges are of one length"
            polygon = (np.array(tab["polygon_mm"]) - start) @ [1, 1j]
            assert np.abs((polygon[:2] / complex(*(end - start))).imag).max() < 1e-5
            moved = polygon * along / abs(along)
            moved = np.column_stack([moved.real, moved.imag]) + to_start
            (face,) = [
                face for face in mate["faces"] if {c, d} <= set(file["faces_vertices"][face])
            ]
            facet = shapely.Polygon(in_patch(mate, flat[file["faces_vertices"][face]]))
            assert facet.buffer(1e-4).contains(shapely.Polygon(moved))


def test_the_cut_line_surrounds_the_facets_and_tabs_of_its_patch(job):
    layout, file = job
    flat = flat_points(file)
    for patch in layout["patches"]:
        line = shapely.Polygon(patch["outline_mm"], patch["waste_mm"])
        facets = [
            shapely.Polygon(in_patch(patch, flat[file["faces_vertices"][face]]))
            for face in patch["faces"]
        ]
        tabs = [shapely.Polygon(tab["polygon_mm"]) for tab in patch["tabs"]]
        paper = shapely.union_all(shapely.buffer([*facets, *tabs], 1e-6))
        assert line.contains(paper)
        # Not more than half a kerf of 0.15 mm, mitred, all round.
        assert line.area - paper.area < 0.1 * line.length
