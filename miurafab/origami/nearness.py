"""How far a sheet lies from its whole target, both ways.

The *sheet to target* distance is the largest distance of any point of the sheet from the target,
the *target to sheet* distance the reverse. The larger is the Hausdorff distance, the epsilon of
the paper (Dudte, Vouga, Tachi and Mahadevan, Nature Materials 15, 2016). Both are taken over whole
facets and the whole target, which is all that the user gave
(:class:`~miurafab.surfaces.surface.TargetSurface`), and not over their vertices alone. Each is true
to :data:`~miurafab.geometry.hausdorff.WITHIN`, and never too large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Bools, Floats
from miurafab.geometry.hausdorff import farthest_from_map, farthest_from_mesh
from miurafab.geometry.polygons import facet_means
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import triangulate
from miurafab.surfaces.surface import TargetSurface


@dataclass(frozen=True)
class Nearness:
    """Distances in mm: of the sheet from the target, of the target from the sheet, of the means of
    whole facets from the target; and the diagonal of the box around the folded form.
    """

    sheet_to_target: float
    target_to_sheet: float
    means_to_target: float
    diagonal: float

    @property
    def hausdorff(self) -> float:
        """The larger of the two distances."""
        return max(self.sheet_to_target, self.target_to_sheet)


def nearness(pattern: CreasePattern, surface: TargetSurface, tiles: Floats) -> Nearness:
    """The distances of the folded ``pattern`` from ``surface`` and its ``tiles``, in its frame."""
    assert pattern.folded_coords is not None
    scale, folded = pattern.scale, pattern.folded_coords / pattern.scale
    triangles, _ = triangulate(pattern.faces_vertices, pattern.vertices_coords)
    sheet = folded[triangles]
    diagonal = np.linalg.norm(np.ptp(pattern.folded_coords, axis=0))
    return Nearness(
        scale * farthest_from_map(sheet, surface.nearest),
        scale * farthest_from_mesh(tiles, sheet),
        means_to_target(pattern, surface),
        float(diagonal),
    )


def means_to_target(pattern: CreasePattern, surface: TargetSurface) -> float:
    """The largest distance in mm of the mean of a whole facet of the folded ``pattern`` from
    ``surface``.
    """
    assert pattern.folded_coords is not None
    folded = pattern.folded_coords / pattern.scale
    means = facet_means(folded, pattern.faces_vertices[uncut(pattern)])
    off = np.linalg.norm(surface.nearest(means) - means, axis=1).max()
    return pattern.scale * float(off)


def uncut(pattern: CreasePattern) -> Bools:
    """(F,) the facets that no outline has cut, all facets where there are no others.

    The mean of half a facet lies above or below the middle of the sheet. Where a sheet was trimmed,
    each facet at the border may be cut; a seam is no such border.
    """
    facets = np.ones(len(pattern.faces_vertices), dtype=bool)
    if pattern.target.get("edge") != "trim":
        return facets
    border = pattern.edges_assignment == "B"
    if pattern.seams is not None:
        border[pattern.seams] = False
    sides = pattern.faces_edges
    facets = ~((sides >= 0) & border[sides]).any(axis=1)
    return np.asarray(facets if facets.any() else ~facets)
