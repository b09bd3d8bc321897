"""How well a sheet can be folded: its fold angles, sector angles, edges and proportions.

A sheet may be exact and still be of no use: a crease near 180 degrees lies on its neighbour, a
facet with an angle near 0 or 180 degrees is a sliver, and much paper over little target is thick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from miurafab.geometry.angles import fold_angles
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths, facet_normals, next_corners
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.flat_edges import without_flat_edges
from miurafab.origami.invariants import corner_angles

_STRAIGHT = 1e-6
"""A corner that differs from half a turn by less, radians, at which no crease ends is none."""


@dataclass(frozen=True)
class Quality:
    """Angles in radians, lengths in mm; ``fold_angles`` are the median, the 95th percentile and the
    largest of all creases, ``facet_aspect`` the largest ratio of two sides of a facet. Facets lie
    between creases: edges that do not fold (letters F and J) are none of their sides.
    """

    fold_angles: tuple[float, float, float]
    sector_angles: tuple[float, float]
    edge_mm: tuple[float, float]
    facet_aspect: float

    def as_json(self, area_ratio: float | None) -> dict[str, Any]:
        """The ``quality`` of a report, with angles in degrees."""
        return {
            "fold_angle_deg": np.degrees(self.fold_angles).tolist(),
            "sector_angle_deg": np.degrees(self.sector_angles).tolist(),
            "edge_mm": list(self.edge_mm),
            "facet_aspect": self.facet_aspect,
            "area_ratio": area_ratio,
        }


def quality(pattern: CreasePattern) -> Quality:
    """The quality of the folded ``pattern``."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    folds = np.abs(crease_angles(pattern))[pattern.edges_creased[inner]]
    lean = without_flat_edges(pattern).pattern
    faces = lean.faces_vertices if lean is pattern else _without_straight_corners(lean)
    real = faces >= 0
    assert lean.folded_coords is not None
    sectors = corner_angles(lean.folded_coords, faces)[real]
    sides = np.stack([faces, np.take_along_axis(faces, next_corners(faces), axis=1)], axis=2)
    lengths = np.full(faces.shape, np.nan)
    lengths[real] = edge_lengths(lean.vertices_coords, sides[real])
    once = np.unique(np.sort(sides[real], axis=1), axis=0, return_index=True)[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        aspect = np.nanmax(lengths, axis=1) / np.nanmin(lengths, axis=1)
    middle, most, largest = (
        np.quantile(folds, (0.5, 0.95, 1.0)).tolist() if len(folds) else (0.0,) * 3
    )
    return Quality(
        (middle, most, largest),
        (float(sectors.min()), float(sectors.max())),
        (float(lengths[real].min()), float(np.median(lengths[real][once]))),
        float(aspect.max()),
    )


def _without_straight_corners(pattern: CreasePattern) -> Ints:
    """The facets (F, k) without the vertices in the middle of a straight side, where no other edge
    ends: a line that nobody folds ended there.
    """
    faces = pattern.faces_vertices
    angle = corner_angles(pattern.vertices_coords, faces)
    real = faces >= 0
    straight = np.ones(len(pattern.vertices_coords), dtype=bool)
    straight[faces[real][np.abs(angle[real] - np.pi) > _STRAIGHT]] = False
    straight &= np.bincount(pattern.edges_vertices.ravel(), minlength=len(straight)) == 2
    kept = real & ~straight[faces]
    width = int(kept.sum(axis=1).max())
    order = np.argsort(~kept, axis=1, kind="stable")[:, :width]
    left = np.take_along_axis(np.where(kept, faces, -1), order, axis=1)
    return np.asarray(left, dtype=np.int64)


def crease_angles(pattern: CreasePattern) -> Floats:
    """(n,) the signed fold angles of the edges between two facets of the folded form, radians."""
    assert pattern.folded_coords is not None
    inner = (pattern.edges_faces >= 0).all(axis=1)
    normals = facet_normals(pattern.folded_coords, pattern.faces_vertices)
    left, right = (normals[pattern.edges_faces[inner, side]] for side in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        angles = fold_angles(pattern.folded_coords, pattern.edges_vertices[inner], left, right)
    return np.nan_to_num(angles)
