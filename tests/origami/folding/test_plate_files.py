"""Plates as they are written: the drawing and the moving solids, read anew and tested alone.

Nothing of the package is asked after the files are written. The solids of the GLB are convex, so
two of them meet in a ball whose radius a linear program finds.
"""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path
from typing import NamedTuple

import ezdxf
import numpy as np
import pytest
import shapely
import trimesh
from problems import fitted
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from miurafab.origami.folding.plates import thick_plates

THICKNESS, CLEARANCE = 4.0, 0.2
MEET = 0.01
"""The radius of a ball in two solids, mm, from which they collide."""


class Body(NamedTuple):
    """A plate with its brackets: the convex ``parts`` as corners of the mesh, the plate first."""

    outline: shapely.Polygon
    parts: list[np.ndarray]


def moving_corners(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The corners (T, n, 3) of a GLB in mm, z up, in its key frames, and its triangles (m, 3)."""
    content = path.read_bytes()
    split = 20 + int.from_bytes(content[12:16], "little")
    document, binary = json.loads(content[20:split]), content[split + 8 :]

    def array(number: int) -> np.ndarray:
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        found = np.frombuffer(binary, kind, accessor["count"] * width, view.get("byteOffset", 0))
        return found.reshape(-1, width)

    mesh = document["meshes"][0]["primitives"][0]
    base = array(mesh["attributes"]["POSITION"]).astype(float)
    moved = [array(target["POSITION"]).astype(float) for target in mesh["targets"]]
    frames = 1000 * np.stack([base, *(base + move for move in moved)])
    return frames[..., [0, 2, 1]] * [1, -1, 1], array(mesh["indices"]).reshape(-1, 3).astype(int)


def rigid(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The turn (3, 3) and shift (3,) that take ``before`` to ``after``, and what they leave."""
    centres = before.mean(axis=0), after.mean(axis=0)
    u, _, vt = np.linalg.svd((before - centres[0]).T @ (after - centres[1]))
    turn = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt).T
    shift = centres[1] - turn @ centres[0]
    return turn, shift, float(np.abs(before @ turn.T + shift - after).max())


def common_ball(one: np.ndarray, other: np.ndarray) -> float:
    """The radius of the largest ball in both of two convex solids, negative where there is none."""
    planes = np.concatenate([ConvexHull(points).equations for points in (one, other)])
    ball = np.column_stack([planes[:, :3], np.ones(len(planes))])
    found = linprog([0, 0, 0, -1], ball, -planes[:, 3], bounds=[(None, None)] * 4)
    return float(found.x[3])


def meetings(bodies: list[Body], frame: np.ndarray) -> list[float]:
    """The common balls of the parts of different bodies whose boxes meet in ``frame`` (n, 3)."""
    found = []
    for a, b in itertools.combinations(bodies, 2):
        for one, other in itertools.product(a.parts, b.parts):
            low, high = (
                np.array([f(frame[p], axis=0) for p in (one, other)]) for f in (np.min, np.max)
            )
            if (high.min(axis=0) - low.max(axis=0) > MEET).all():
                found.append(common_ball(frame[one], frame[other]))
    return found


def test_the_files_of_one_patch_in_plywood_close_their_loops_and_collide_nowhere(
    tmp_path: Path,
) -> None:
    """Four by four facets of a hypar, 200 mm long, from flat to flat-folded."""
    pattern = fitted("hypar", 4, 4, 0.0).pattern
    assert pattern is not None
    plates = thick_plates(pattern, THICKNESS)
    assert plates.patches[0].clear_deg == 180.0
    for ending in ("dxf", "glb"):
        plates.save(tmp_path / f"plates.{ending}")
    frames, triangles = moving_corners(tmp_path / "plates.glb")
    space = ezdxf.readfile(tmp_path / "plates.dxf").modelspace()
    lines = {"Plate": [], "Hinge": [], "Bracket": [], "HingeTape": []}
    for line in space.query("POLYLINE"):
        points = [tuple(vertex.dxf.location)[:2] for vertex in line.vertices]
        lines[line.dxf.layer].append(np.array(points))
    labels = [text.dxf.text for text in space.query("TEXT")]
    heights = dict(
        found.groups() for found in map(re.compile(r"f(\d+) (\S+)$").match, labels) if found
    )

    # every part is a closed convex solid, and there are as many as are drawn
    graph = trimesh.Trimesh(frames[0], triangles, process=False)
    parts = trimesh.graph.connected_components(graph.edges, nodes=np.arange(frames.shape[1]))
    assert len(parts) == len(lines["Plate"]) + len(lines["Bracket"]) == 16 + 27
    assert graph.is_watertight
    hulls = sum(ConvexHull(frames[0][part]).volume for part in parts)
    assert graph.volume == pytest.approx(hulls, rel=1e-6)

    # the plates of the drawing are those of the solids, at the heights that are written on them
    footprints = [shapely.MultiPoint(frames[0][part][:, :2]).convex_hull for part in parts]
    bodies = []
    for number, outline in enumerate(map(shapely.Polygon, lines["Plate"])):
        drawn = outline.convex_hull
        gaps = [shapely.symmetric_difference(drawn, other).area for other in footprints]
        assert min(gaps) < 1e-3 * drawn.area
        own = parts[int(np.argmin(gaps))]
        z = frames[0][own][:, 2]
        assert (z.min(), np.ptp(z)) == pytest.approx(
            (float(heights[str(number)]), THICKNESS), abs=6e-3
        )
        bodies.append(Body(drawn, [own]))

    # each plate moves as one solid, and a bracket with the plate that it stands on
    motion = np.empty((len(frames), len(bodies), 3, 4))
    for (t, frame), (k, body) in itertools.product(enumerate(frames), enumerate(bodies)):
        turn, shift, left = rigid(frames[0][body.parts[0]], frame[body.parts[0]])
        motion[t, k] = np.column_stack([turn, shift])
        assert left < 1e-3
    taken = {int(body.parts[0][0]) for body in bodies}
    for part in parts:
        if int(part[0]) not in taken:
            at = np.pad(frames[0][part], ((0, 0), (0, 1)), constant_values=1.0)
            left = np.abs(np.einsum("tkij,nj->tkni", motion, at) - frames[:, None, part])
            bodies[int(np.argmin(left.max(axis=(0, 2, 3))))].parts.append(part)
            assert left.max(axis=(0, 2, 3)).min() < 1e-3

    # about each hinge of the drawing both plates turn, at one height outside of both
    for ends in lines["Hinge"]:
        middle = shapely.Point(ends.mean(axis=0))
        one, other = (
            k for k, b in enumerate(bodies) if b.outline.distance(middle) < 1.01 * CLEARANCE
        )
        between = motion[:, one] - motion[:, other]
        flat = np.column_stack([ends, np.zeros(2), np.ones(2)])
        away = np.einsum("tij,nj->tni", between, flat)
        lift = np.broadcast_to(between[:, None, :, 2], away.shape)
        height = -float((lift * away).sum() / (lift**2).sum())
        assert np.abs(away + height * lift).max() < 2e-3
        bottoms = [float(heights[str(k)]) for k in (one, other)]
        assert height >= max(bottoms) + THICKNESS - 0.02 or height <= min(bottoms) + 0.02

    # nothing meets from flat to flat-folded, where all plates are level again
    assert np.abs(motion[-1, :, 2, 2]) == pytest.approx(np.ones(16), abs=1e-4)
    assert np.abs(motion[12, :, 2, 2]).min() < 0.5
    balls = [radius for frame in frames for radius in meetings(bodies, frame)]
    assert len(balls) > 200
    assert max(balls) < MEET
    # which the test would tell: one plate lifted by half its thickness meets the next
    lifted = frames[18].copy()
    lifted[np.concatenate(bodies[5].parts)] += motion[18, 5, :, 2] * THICKNESS / 2
    assert max(meetings(bodies, lifted)) > 10 * MEET
