"""How well a sheet can be folded: its fold angles, sector angles, edges and proportions.

A sheet may be exact and still be of no use: a crease near 180 degrees lies on its neighbour, a
facet with an angle near 0 or 180 degrees is a sliver, and much paper over little target is thick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from miurafab.geometry.angles import fold_angles
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths, facet_normals
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.invariants import CornerRing


@dataclass(frozen=True)
class Quality:
    """Angles in radians, lengths in mm; ``fold_angles`` are the median, the 95th percentile and the
    largest of all creases, ``facet_aspect`` the largest ratio of two sides of a facet.
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


def quality(pattern: CreasePattern, ring: CornerRing) -> Quality:
    """The quality of the folded ``pattern``; ``ring`` are its corners in the folded form."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    folds = np.abs(crease_angles(pattern))[pattern.edges_creased[inner]]
    sectors = ring.angle[ring.vertex >= 0]
    lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    real = pattern.faces_edges >= 0
    sides = lengths[pattern.faces_edges]
    longest = np.where(real, sides, 0.0).max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        aspect = longest / np.where(real, sides, np.inf).min(axis=1)
    middle, most, largest = (
        np.quantile(folds, (0.5, 0.95, 1.0)).tolist() if len(folds) else (0.0,) * 3
    )
    return Quality(
        (middle, most, largest),
        (float(sectors.min()), float(sectors.max())),
        (float(lengths.min()), float(np.median(lengths))),
        float(aspect.max()),
    )


def crease_angles(pattern: CreasePattern) -> Floats:
    """(n,) the signed fold angles of the edges between two facets of the folded form, radians."""
    assert pattern.folded_coords is not None
    inner = (pattern.edges_faces >= 0).all(axis=1)
    normals = facet_normals(pattern.folded_coords, pattern.faces_vertices)
    left, right = (normals[pattern.edges_faces[inner, side]] for side in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        angles = fold_angles(pattern.folded_coords, pattern.edges_vertices[inner], left, right)
    return np.nan_to_num(angles)
