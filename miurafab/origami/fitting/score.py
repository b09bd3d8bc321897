"""The score of an exact sheet: how well it can be folded, and how much of the target it follows.

The score is the largest of these parts, and less is better. At 1 each is as good as asked:

deviation   the largest distance of a follower from the target, over 0.5 % of the size
rim         how far a border facet lies inside or beyond its place, over 1 % of the size
sectors     the larger of 45 deg - least and greatest - 135 deg, over 7 degrees
bad         the share of corners outside 45..135 deg, over 10 %
folds       the largest fold angle over 178 deg
area        the 95th over the 5th percentile of the areas of facets, over 20
edges       0.05 of the mean edge over the shortest edge
paper       the area of the sheet over that of its cells on the target, over 4

The size is the root of 12 times the mean of the squares of the distances of the vertices from their
middle. It is the diagonal of a rectangle, and of the box around a sphere; unlike the box's, it does
not hang on how the sheet is turned.

Several pieces and a ring all round an axis may crowd at poles, where the paper is wide; their paper
does not count. Facets that cross, overlap or are not convex are faults and no matter of degree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from miurafab.geometry.angles import angle_between
from miurafab.geometry.arrays import Floats, vector_product
from miurafab.geometry.polygons import edge_lengths, facet_normals
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.fitting.nominal import Rim
from miurafab.origami.judge_pattern import MUCH_PAPER

GOOD = 1.0
"""A sheet with this score or less is as good as asked, and ends the search."""
ENOUGH = 2.0
"""With a clean sheet of this score or less, more pieces and coarser sheets are not tried."""


@dataclass(frozen=True)
class Score:
    """The parts of the score, each 1 where the sheet is as good as asked; ``bow_ties`` is the
    number of facets that are not convex.
    """

    deviation: float
    rim: float
    sectors: float
    bad: float
    folds: float
    area: float
    edges: float
    paper: float
    bow_ties: int

    @property
    def total(self) -> float:
        """The largest part."""
        return max(float(getattr(self, f.name)) for f in fields(self) if f.name != "bow_ties")

    @property
    def form(self) -> float:
        """The largest part that is no matter of where the sheet lies."""
        return max(self.sectors, self.bad, self.folds, self.area, self.edges, self.paper)

    def report(self) -> dict[str, float]:
        """The parts and the total, for the fit report."""
        return {"total": self.total, **{f.name: getattr(self, f.name) for f in fields(self)}}


def score(
    charts: QuadCharts, points: Floats, cells: Floats, rim: Rim, deviation: float, crowds: bool
) -> Score:
    """The score of the sheet ``points`` (V, 3) over ``charts``. ``cells`` (F, 4, 3) are the corners
    of its facets' cells on the target, ``rim`` is the border that it is to reach, ``deviation`` the
    largest distance of its followers. ``crowds`` says that its paper does not count.
    """
    faces = charts.faces_vertices
    size = math.sqrt(12 * float(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
    corners = points[faces]
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    sectors = np.degrees(angle_between(ahead, behind))
    outside = np.maximum(45 - sectors, sectors - 135)
    area = _areas(corners)
    layers = float(area.sum() / _areas(cells).sum())
    normals = facet_normals(points, faces)
    f, g = charts.neighbouring_facets.T
    folds = np.degrees(angle_between(normals[f], normals[g]))
    edges = edge_lengths(points, charts.edges_vertices)
    off = np.zeros(1)
    if len(rim.facets):
        gap = rim.places - corners[rim.facets].mean(axis=1)
        across = np.einsum("nk,nk->n", rim.outward, gap)
        off = np.where(across > 0, across, -across * rim.overhang)
    spread = np.percentile(area, 95) / max(float(np.percentile(area, 5)), 1e-300)
    return Score(
        deviation=100 * deviation / size / 0.5,
        rim=100 * float(off.max()) / size,
        sectors=float(outside.max()) / 7,
        bad=100 * float((outside > 0.1).mean()) / 10,
        folds=float(folds.max(initial=0.0)) / 178,
        area=float(spread) / 20,
        edges=0.05 * float(edges.mean()) / max(float(edges.min()), 1e-300),
        paper=layers / MUCH_PAPER if not crowds else 0.0,
        bow_ties=int(bow_ties(corners).sum()),
    )


def _areas(corners: Floats) -> Floats:
    """(F,) the areas of the quads ``corners`` (F, 4, 3)."""
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.asarray(np.linalg.norm(vector_product(*diagonals), axis=1) / 2)


def bow_ties(corners: Floats) -> Floats:
    """(F,) which quads ``corners`` (F, 4, 3) are not convex: (u x v) . (v x w) < 0 for a diagonal
    v and the sides u, w beside it.
    """
    crossed = np.zeros(len(corners), dtype=bool)
    for turn in (0, 1):
        p = np.roll(corners, -turn, axis=1)
        u, v, w = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]
        crossed |= np.einsum("fk,fk->f", vector_product(u, v), vector_product(v, w)) <= 0
    return crossed
