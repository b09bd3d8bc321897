"""Flat crease patterns for the layout tests: small closed forms, no solver involved."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles.beam import OPERATIONS, BeamSettings, Laser, Meant, Operation
from miurafab.profiles.machine import Bed, Controller, MachineProfile, MotionLimits, Tool
from miurafab.profiles.material import Material, Perforation, TabRule


def bed(width: float, height: float, margin: float = 5.0) -> MachineProfile:
    """A laser with the given bed in mm."""
    return MachineProfile(
        name="test-laser",
        title="Test laser",
        dialect="grbl-1.1",
        bed=Bed(width, height, margin),
        motion=MotionLimits(6000.0, 6000.0, 500.0, 500.0, 0.01),
        tool=Tool("laser", 0, 1000, "M4", False, 1000, 0, 0.0, laser=Laser("diode", 10.0, 450.0)),
        controller=Controller(115_200, "character-counting", 128, 79, 15),
        settings={},
    )


def card(
    cut: float = 1.2,
    gap: float = 0.8,
    end_bridge: float = 0.6,
    min_end: float = 0.5,
    tab: float = 7.0,
    inset: float = 0.3,
    kerf: float = 0.15,
) -> Material:
    """Card with the given perforation, tabs and kerf in mm."""
    return Material(
        name="test-card",
        title="Test card",
        thickness_mm=0.3,
        kerf_mm=kerf,
        perforation=Perforation(cut, gap, end_bridge, min_end),
        tabs=TabRule(tab, inset),
        beams={
            "diode": BeamSettings(
                "diode",
                Meant((10.0, 10.0), 10.0, 450.0),
                {name: Operation(1000.0, 5.0) for name in OPERATIONS},
            )
        },
    )


def grid(points: NDArray[np.float64]) -> CreasePattern:
    """The pattern of a vertex grid ``points`` (rows, columns, 2), assigned as a Miura-ori:
    column lines alternate as a whole, row lines alternate from segment to segment.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    across = np.stack([index[:, :-1], index[:, 1:]], axis=-1).reshape(-1, 2)
    along = np.stack([index[:-1], index[1:]], axis=-1).reshape(-1, 2)
    i, j = np.indices((rows, columns - 1))
    across_kind = np.where((i + j) % 2 == 0, "M", "V")
    across_kind[[0, -1]] = "B"
    i, j = np.indices((rows - 1, columns))
    along_kind = np.where(j % 2 == 0, "M", "V")
    along_kind[:, [0, -1]] = "B"
    faces = np.stack(
        [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1
    ).reshape(-1, 4)
    kinds = np.concatenate([across_kind.ravel(), along_kind.ravel()])
    angle = np.select([kinds == "M", kinds == "V"], [-2.0, 2.0], 0.0)
    return CreasePattern(
        vertices_coords=points.reshape(-1, 2).astype(np.float64),
        edges_vertices=np.concatenate([across, along]),
        edges_assignment=kinds,
        edges_fold_angle=angle,
        faces_vertices=faces,
        grid=(columns, rows),
    )


def miura(
    columns: int, rows: int, a: float = 12.0, b: float = 12.0, sector: float = 1.2
) -> CreasePattern:
    """A regular Miura-ori of ``columns`` x ``rows`` parallelograms of sides ``a`` and ``b``."""
    i, j = np.indices((rows + 1, columns + 1))
    x = j * a + (i % 2) * b * np.cos(sector)
    return grid(np.stack([x, i * b * np.sin(sector)], axis=-1))


def zigzag(columns: int, rows: int, a: float = 12.0, sector: float = 0.6) -> CreasePattern:
    """A Miura-ori with acute facets whose size grows along the columns."""
    i, j = np.indices((rows + 1, columns + 1))
    x = a * (j + 0.15 * j**2 / max(columns, 1)) + (i % 2) * a * np.cos(sector)
    return grid(np.stack([x, i * a * np.sin(sector)], axis=-1))


def fan(
    columns: int, rows: int, cell: float = 11.0, radius: float = 2000.0, skew: float = 0.35
) -> CreasePattern:
    """A curved fan: row lines are arcs about one centre, column lines zig-zag across them.

    ``radius`` is that of the first row, ``skew`` the zig-zag over the cell width.
    """
    i, j = np.indices((rows + 1, columns + 1))
    step = cell / (radius + 0.5 * rows * cell)
    angle = np.pi / 2 - step * (j + skew * (i % 2) - columns / 2)
    r = radius + (rows - i) * cell
    points = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)
    return grid(points[::-1])


def without_grid(pattern: CreasePattern) -> CreasePattern:
    """The same pattern as if it came from a file that does not tell its grid."""
    return CreasePattern(
        vertices_coords=pattern.vertices_coords,
        edges_vertices=pattern.edges_vertices,
        edges_assignment=pattern.edges_assignment,
        edges_fold_angle=pattern.edges_fold_angle,
        faces_vertices=pattern.faces_vertices,
    )


def triangles(seed: int, count: int, size: float, hole: bool = False) -> CreasePattern:
    """A triangulation of ``count`` x ``count`` shaken points in a square of ``size``,
    optionally ring-shaped, with random mountains and valleys; no grid.
    """
    rng = np.random.default_rng(seed)
    lattice = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1).reshape(-1, 2)
    points = (lattice + 0.4 * rng.random((count**2, 2))) * size / (count - 0.6)
    index = np.arange(count**2).reshape(count, count)
    lower = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([index[:-1, :-1], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 3)
    faces = np.concatenate([lower, upper])
    if hole:
        centres = points[faces].mean(axis=1)
        faces = faces[np.linalg.norm(centres - size / 2, axis=1) > size / 4]
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, times = np.unique(sides, axis=0, return_counts=True)
    kinds = np.where(times == 1, "B", np.where(rng.random(len(edges)) < 0.5, "M", "V"))
    return CreasePattern(
        vertices_coords=points,
        edges_vertices=edges.astype(np.int64),
        edges_assignment=kinds,
        edges_fold_angle=np.select([kinds == "M", kinds == "V"], [-1.0, 1.0], 0.0),
        faces_vertices=faces,
    )


def facet_polygons(pattern: CreasePattern) -> NDArray[np.object_]:
    """(F,) shapely polygons of the facets."""
    return np.array(
        [
            shapely.Polygon(pattern.vertices_coords[face[face >= 0]])
            for face in pattern.faces_vertices
        ]
    )


def fits_turned(points: NDArray[np.float64], width: float, height: float) -> bool:
    """Whether ``points`` (n, 2) fit ``width`` x ``height`` mm at some angle, within 1e-5 mm.

    Independent of the package: the extents of the convex hull are computed at many angles, and the
    angle with the least excess is refined.
    """
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(points)))

    def excess(angle: NDArray[np.float64] | float) -> NDArray[np.float64]:
        c, s = np.cos(angle), np.sin(angle)
        x = np.multiply.outer(hull[:, 0], c) + np.multiply.outer(hull[:, 1], s)
        y = np.multiply.outer(hull[:, 1], c) - np.multiply.outer(hull[:, 0], s)
        return np.maximum(np.ptp(x, axis=0) - width, np.ptp(y, axis=0) - height)

    angles = np.linspace(0.0, np.pi, 7201)
    best = float(angles[np.argmin(excess(angles))])
    for _ in range(4):
        reach = angles[1] - angles[0]
        angles = np.linspace(best - reach, best + reach, 401)
        best = float(angles[np.argmin(excess(angles))])
    return bool(excess(best) <= 1e-5)
