"""A job read back from its files alone, folded patch by patch and glued in memory.

Nothing of the package reads or folds here. Each patch is cut out of the flat pattern, as
layout.json says, and folded by the fold angles of the pattern file. It is then laid on what is
glued already, by the edges that its seams have in common, as hands would do it.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np


def read_job(folder: Path):
    """layout.json and the pattern file that it names."""
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


def untabbed(layout):
    """The edges that bear no tab for want of room, as the layout says; there is tape instead."""
    told = [f["where"] for f in layout["findings"] if f["code"] == "untabbed"]
    return {edge for where in told for edge in where}


def joints(layout, file):
    """(patch, vertex, other patch, other vertex) of both ends of each tab and each taped seam."""
    home = {}
    for patch in layout["patches"]:
        for face in patch["faces"]:
            ring = file["faces_vertices"][face]
            for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
                home[frozenset((a, b))] = patch["id"]
    pairs = [
        (patch["id"], tab["edge"], tab["mate_patch"], tab["mate_edge"])
        for patch in layout["patches"]
        for tab in patch["tabs"]
    ]
    taped = untabbed(layout)
    for edges in file.get("miurafab:seams", []):
        if taped & set(edges):
            one, other = (home[frozenset(file["edges_vertices"][edge])] for edge in edges)
            pairs.append((one, edges[0], other, edges[1]))
    found = []
    for patch, edge, mate, mate_edge in pairs:
        ends = (
            side(file, edge, face_set(layout, patch)),
            side(file, mate_edge, face_set(layout, mate)),
        )
        for one, other in zip(ends[0], ends[1][::-1], strict=True):
            found.append((patch, one, mate, other))
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


def glued_shell(layout, file) -> tuple[float, float]:
    """The widest gap at a seam of the patches glued together, and how far any corner lies from its
    place in the folded form of the pattern file, mm.
    """
    places = [folded_patch(file, patch) for patch in layout["patches"]]
    pairs = joints(layout, file)
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
    patch_vertex = [(patch, v) for patch, own in glued.items() for v in own]
    found = np.array([glued[patch][v] for patch, v in patch_vertex])
    shell = folded_points(file)[[v for _, v in patch_vertex]]
    turn, shift = rigid(found, shell)
    off = np.linalg.norm(found @ turn + shift - shell, axis=1)
    return float(max(gaps)), float(off.max())
