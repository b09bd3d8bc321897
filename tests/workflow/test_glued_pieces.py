"""A job of several pieces, read back from its files alone and glued in memory, is the shell.

Nothing of the package reads or folds here. Each patch is cut out of the flat pattern, as
layout.json says, and folded by the fold angles of the pattern file. It is then laid on what is
glued already, by the edges that its seams have in common, as hands would do it.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapely
from piece_problems import gores, trimmed, two_pieces, two_trimmed_pieces

import miurafab as mf

CASES = {
    "gores": (gores(), {}),
    "gores in patches": (gores(), {"max_patch": (110, 75), "tab_side": "upper"}),
    "two pieces": (two_pieces(), {"tab_side": "alternate"}),
    "trimmed": (trimmed(), {"max_patch": (90, 60)}),
    "trimmed pieces": (two_trimmed_pieces(), {"full_facet": True}),
}


@pytest.fixture(scope="module", params=CASES)
def job(request, tmp_path_factory):
    pattern, options = CASES[request.param]
    folder = tmp_path_factory.mktemp("job")
    made = mf.sheets(pattern, machine="grbl-laser-400", material="card-250", **options)
    made.write(folder)
    layout = json.loads((folder / "layout.json").read_text())
    file = json.loads((folder / layout["pattern"]["file"]).read_text())
    return layout, file


def flat_points(file):
    return np.array(file["vertices_coords"], dtype=float)[:, :2]


def folded_points(file):
    return np.array(file["file_frames"][0]["vertices_coords"], dtype=float)


def in_patch(patch, points):
    """Points of the pattern in the frame of the patch."""
    angle = np.radians(patch["rotation_deg"])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return (points - patch["origin_mm"]) @ turn.T


def edge_numbers(file):
    return {frozenset(ends): number for number, ends in enumerate(file["edges_vertices"])}


def turned_about(points, start, end, angle):
    """``points`` turned by ``angle`` about the line from ``start`` to ``end`` (Rodrigues)."""
    axis = (end - start) / np.linalg.norm(end - start)
    arm = points - start
    along = np.outer(arm @ axis, axis)
    return start + along + np.cos(angle) * (arm - along) + np.sin(angle) * np.cross(axis, arm)


def rigid(source, target):
    """(turn, shift) that lay ``source`` (n, 3) on ``target`` (n, 3) (Kabsch 1976)."""
    middle, to = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((source - middle).T @ (target - to))
    turn = (u * [1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return turn, to - middle @ turn


def folded_patch(file, patch):
    """{vertex: place} the patch folded from its flat facets by the fold angles of its creases."""
    faces, edges = file["faces_vertices"], edge_numbers(file)
    flat = in_patch(patch, flat_points(file))
    flat = np.pad(flat, ((0, 0), (0, 1)))
    beside = {}
    for face in patch["faces"]:
        ring = faces[face]
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            beside.setdefault(frozenset((a, b)), []).append(face)
    first = patch["faces"][0]
    motion = {first: lambda points: points}
    waiting = [first]
    while waiting:
        face = waiting.pop(0)
        ring = faces[face]
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            for other in beside[frozenset((a, b))]:
                if other in motion:
                    continue
                # A facet beyond its left side folds up, towards the viewer, in a valley.
                angle = np.radians(file["edges_foldAngle"][edges[frozenset((a, b))]])

                def moved(points, base=motion[face], ends=(flat[a], flat[b]), angle=angle):
                    return base(turned_about(points, *ends, -angle))

                motion[other] = moved
                waiting.append(other)
    assert set(motion) == set(patch["faces"]), "a patch hangs together by its creases"
    places = {}
    for face, move in motion.items():
        for vertex, point in zip(faces[face], move(flat[faces[face]]), strict=True):
            # Facets that share a vertex agree on its place.
            np.testing.assert_allclose(places.setdefault(vertex, point), point, atol=2e-4)
    return places


def joints(layout, file):
    """(patch, vertex, other patch, other vertex) of both ends of each tab."""
    found = []
    for patch in layout["patches"]:
        for tab in patch["tabs"]:
            ends = [
                side(file, tab[name], face_set(layout, number))
                for name, number in (("edge", patch["id"]), ("mate_edge", tab["mate_patch"]))
            ]
            for one, other in zip(ends[0], ends[1][::-1], strict=True):
                found.append((patch["id"], one, tab["mate_patch"], other))
    return found


def face_set(layout, number):
    return set(layout["patches"][number]["faces"])


def side(file, edge, own):
    """The ends of an edge in the direction of its facet among ``own``."""
    ends = set(file["edges_vertices"][edge])
    for face in own:
        ring = file["faces_vertices"][face]
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            if {a, b} == ends:
                return a, b
    raise AssertionError("the edge is no side of the patch")


def test_the_glued_patches_are_the_shell(job):
    layout, file = job
    places = [folded_patch(file, patch) for patch in layout["patches"]]
    pairs = joints(layout, file)
    assert len(pairs) == 2 * layout["totals"]["tabs"]
    glued = {0: places[0]}
    while len(glued) < len(places):
        meeting = {}
        for a, v, b, w in [*pairs, *((b, w, a, v) for a, v, b, w in pairs)]:
            if a in glued and b not in glued:
                meeting.setdefault(b, []).append((places[b][w], glued[a][v]))
        most = max(meeting, key=lambda patch: (len(meeting[patch]), -patch))
        source, target = (np.array(points) for points in zip(*meeting[most], strict=True))
        turn, shift = rigid(source, target)
        glued[most] = {v: point @ turn + shift for v, point in places[most].items()}
    gaps = [np.linalg.norm(glued[a][v] - glued[b][w]) for a, v, b, w in pairs]
    assert max(gaps) < 0.05, "each seam closes, also those that were not used to lay a patch"
    patch_vertex = [(patch, v) for patch, own in glued.items() for v in own]
    found = np.array([glued[patch][v] for patch, v in patch_vertex])
    shell = folded_points(file)[[v for _, v in patch_vertex]]
    turn, shift = rigid(found, shell)
    assert np.linalg.norm(found @ turn + shift - shell, axis=1).max() < 0.05
    facets = sorted(face for patch in layout["patches"] for face in patch["faces"])
    assert facets == list(range(len(file["faces_vertices"])))


def test_each_seam_of_the_pattern_has_one_tab_of_one_number(job):
    layout, file = job
    told = sorted(
        tuple(sorted((tab["edge"], tab["mate_edge"])))
        for patch in layout["patches"]
        for tab in patch["tabs"]
    )
    seams = sorted(tuple(sorted(pair)) for pair in file.get("miurafab:seams", []))
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
