"""The order of the layers of a sheet that is folded flat, in closed form.

A rigid motion ends at s = infinity, where all facets lie in one plane. Just before, the crease e is
short of a half turn by delta_e = 2 / (s |tau_e|), where tau_e = tan(rho_e* / 2), which follows
from rho_e(s) = 2 atan(s tau_e). To first order in 1 / s a facet f therefore stands over the plane
by z_f(p) / s, with a linear function z_f. Across the crease e from f to g it changes by

    z_g(p) = z_f(p) + sigma_e u_f (2 / |tau_e|) d_e(p)

sigma_e = 1 for a valley and -1 for a mountain, u_f = 1 where f lies face up and -1 where face down,
d_e(p) the distance from the line of e, positive on the side of the two facets. A crease with
tau_e = 0 does not fold, and z_g = z_f.

Two facets overlap in an area A. z_f - z_g is linear, so its signs at the corners of A hold for all
of A: f lies above g if none is negative, below if none is positive. If both signs occur, the two
facets pass through each other as the sheet closes. If none of the pairs does, the sheet does not
cross itself in a last interval of s before infinity, as far as first order tells: a pair whose
z_f - z_g is zero all over A is undecided.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints, run_starts
from miurafab.geometry.overlaps import SharedAreas, shared_areas
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import (
    RIGID,
    FacetPlacement,
    facet_tree,
    first_facets,
    fold_angles_at,
    half_tangents,
    loop_mismatch,
    place,
)
from miurafab.origami.folding.laying import laid_on_each_other

EXACT_WIDTH = 1e-7
"""The least width, in mean edges, of an overlap in an exactly flat-foldable sheet."""

_ON_THE_WAY = (0.5, 2.0)
"""States at which the loops of a rigid motion are looked at, beside its end."""

_LEVEL = 1e-9
"""A height below this part of the largest is none."""


@dataclass(frozen=True, eq=False)
class FlatFolded:
    """A pattern folded flat: F facets in one plane, mm.

    Attributes
    ----------
    pattern : CreasePattern
        The pattern, with V vertices and E edges.
    fold_angles : (E,) float64
        The fold angles in radians.
    placement : FacetPlacement
        Where each facet lies, in one frame.
    corners : (F, k, 2) float64
        The corners of each facet in the plane.
    up : (F,) bool
        Whether each facet lies face up.
    mismatch : float
        The loop mismatch in mean edges.
    shared : SharedAreas
        The pairs of facets of one piece that overlap.
    width : float
        The least width of an overlap, mm.
    """

    pattern: CreasePattern
    fold_angles: Floats
    placement: FacetPlacement
    corners: Floats
    up: Bools
    mismatch: float
    shared: SharedAreas
    width: float

    @cached_property
    def vertices(self) -> Floats:
        """(V, 2) the vertices in the plane, mm, near their places in the flat pattern; pieces lie
        beside each other.
        """
        flat = self.pattern.vertices_coords
        frame = self.placement.points(flat, first_facets(self.pattern, self.placement.depth))
        bare = replace(self.pattern, folded_coords=None)
        return laid_on_each_other(bare, np.array([np.inf]), frame)[0, :, :2]


@dataclass(frozen=True, eq=False)
class LayerOrder:
    """The order of the layers of a sheet folded flat, with n pairs of facets that overlap.

    Attributes
    ----------
    folded : FlatFolded
        The sheet folded flat.
    above : (n,) int64
        For each of ``folded.shared.pairs``: 1 where the first facet lies above the second, seen
        from the side to which a facet that lies face up shows its front; -1 where below; 0 where
        it is not known.
    crossing : (m, 2) int64
        The pairs of facets that pass through each other as the sheet closes.
    loop_gap : float
        How far the heights of two facets differ on their crease, as part of the greatest height,
        at the creases that were not used to find the heights. 0 for an order found by search.
    """

    folded: FlatFolded
    above: Ints
    crossing: Ints
    loop_gap: float = 0.0

    @property
    def known(self) -> bool:
        """Whether each pair has an order."""
        return not len(self.crossing) and bool((self.above != 0).all())

    def face_orders(self) -> Ints:
        """(n, 3) the triples [f, g, s] of FOLD's ``faceOrders`` of the pairs that have an order.

        s is 1 where facet f lies on the side of g to which the normal of g points in the folded
        state, and -1 where on the other side (FOLD 1.2, "Layer information").
        """
        known = self.above != 0
        pairs = self.folded.shared.pairs[known]
        front = np.where(self.folded.up[pairs[:, 1]], 1, -1)
        return np.column_stack([pairs, self.above[known] * front])

    @cached_property
    def levels(self) -> Ints | None:
        """(F,) the level of each facet, counted from the lowest, 0: one more than the highest
        facet below it. None where facets lie above each other in a circle, so that no levels exist,
        or where the order is not known.
        """
        if not self.known:
            return None
        pairs = self.folded.shared.pairs
        upper = np.where(self.above > 0, pairs[:, 0], pairs[:, 1])
        lower = np.where(self.above > 0, pairs[:, 1], pairs[:, 0])
        below = np.bincount(upper, minlength=len(self.folded.up)).tolist()
        counts = np.bincount(lower, minlength=len(below))
        order = upper[np.argsort(lower, kind="stable")].tolist()
        starts = run_starts(counts).tolist()
        level = [0] * len(below)
        ready = [facet for facet, count in enumerate(below) if count == 0]
        for facet in ready:  # which grows: each facet once all below it have their levels
            for higher in order[starts[facet] : starts[facet] + int(counts[facet])]:
                level[higher] = max(level[higher], level[facet] + 1)
                below[higher] -= 1
                if below[higher] == 0:
                    ready.append(higher)
        return np.array(level) if len(ready) == len(level) else None


def folded_flat(
    pattern: CreasePattern,
    angles: Floats,
    width: float = EXACT_WIDTH,
    most_mismatch: float = RIGID,
) -> FlatFolded:
    """``pattern`` folded flat.

    Parameters
    ----------
    pattern : CreasePattern
        The pattern, with E edges.
    angles : (E,) float64
        The fold angles in radians: pi, -pi or 0.
    width : float
        The least width of an overlap, in mean edges.
    most_mismatch : float
        The largest loop mismatch, in mean edges, at which the facets count as folded flat.

    Raises
    ------
    PatternError
        For a pattern that does not reach the flat-folded state, since its loops do not close there,
        and for facets that are not all joined by creases.
    """
    placement = place(pattern, angles[None])
    mismatch = float(loop_mismatch(pattern, placement, angles[None])[0])
    if not mismatch <= most_mismatch:
        raise PatternError(
            f"The sheet does not fold flat: with its creases folded by 180 degrees its facets miss "
            f"each other by up to {mismatch:.2g} mean edges."
        )
    faces = pattern.faces_vertices
    facet, slot = np.nonzero(faces >= 0)
    corners = np.zeros((*faces.shape, 2))
    flat = pattern.vertices_coords[faces[facet, slot]]
    corners[facet, slot] = placement.points(flat, facet)[0, :, :2]
    up = placement.turn[0, :, 2, 2] > 0
    least = width * float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    shared = shared_areas(corners, faces, least, among=pattern.pieces)
    return FlatFolded(pattern, angles, placement, corners, up, mismatch, shared, least)


def layer_order(pattern: CreasePattern) -> LayerOrder:
    """The order of the layers of ``pattern`` at the end of its rigid motion, in closed form.

    Parameters
    ----------
    pattern : CreasePattern
        A pattern that folds rigidly and whose facets lie in one plane at the end.

    Raises
    ------
    PatternError
        For a pattern that the closed form does not bring to that end. It may still fold otherwise.

    Examples
    --------
    >>> import miurafab as mf
    >>> order = layer_order(mf.fit("plane", facets=(4, 4), flat_foldable="exact").pattern)
    >>> order.known, len(order.crossing), order.face_orders()[0].tolist()
    (True, 0, [0, 1, 1])
    """
    half = half_tangents(pattern)
    states = np.array([*_ON_THE_WAY, np.inf])
    angles = fold_angles_at(pattern, states)
    missed = loop_mismatch(pattern, place(pattern, angles[:-1]), angles[:-1])
    if not missed.max() <= RIGID:
        raise PatternError(
            "The closed form of folding does not hold for the sheet: by it, its facets miss each "
            f"other by up to {missed.max():.2g} mean edges on the way to the flat-folded state."
        )
    folded = folded_flat(pattern, angles[-1])
    heights, gap = _heights(folded, half)
    shared = folded.shared
    if not len(shared.pairs):
        none = np.empty(0, dtype=np.int64)
        return LayerOrder(folded, none, np.empty((0, 2), dtype=np.int64), gap)
    apart = heights[shared.pairs[:, 0]] - heights[shared.pairs[:, 1]]
    corner = shared.area_of_corner
    points = np.column_stack([shared.corners, np.ones(len(corner))])
    height = np.einsum("mi,mi->m", apart[corner], points)
    starts = run_starts(np.bincount(corner))
    low, high = np.minimum.reduceat(height, starts), np.maximum.reduceat(height, starts)
    least = _LEVEL * float(np.abs(height).max())
    rises, falls = high > least, low < -least
    above = np.where(rises & ~falls, 1, 0) - (falls & ~rises)
    return LayerOrder(folded, above, shared.pairs[rises & falls], gap)


def known_layer_order(pattern: CreasePattern) -> LayerOrder | None:
    """The order of the layers in closed form, where ``pattern`` has one; else None."""
    try:
        with np.errstate(all="ignore"):  # edges without length miss each other by NaN
            order = layer_order(pattern)
    except PatternError:
        return None
    return order if order.known and len(order.above) else None


def _heights(folded: FlatFolded, half: Floats) -> tuple[Floats, float]:
    """(F, 3) the coefficients of z_f(x, y) = a x + b y + c, and the loop gap.

    ``half`` (E,) are the tangents of the half fold angles at s = 1.
    """
    pattern = folded.pattern
    before, crease, depth = facet_tree(pattern)
    heights = np.zeros((len(before), 3))
    for level in range(1, int(depth.max()) + 1):
        here = np.flatnonzero(depth == level)
        parent, edge = before[here], crease[here]
        heights[here] = heights[parent] + _steps(folded, half, edge, parent)
    joined = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    joined = joined[~np.isin(pattern.edges_assignment[joined], ("B", "C"))]
    left, right = pattern.edges_faces[joined].T
    missed = heights[left] + _steps(folded, half, joined, left) - heights[right]
    ends = pattern.vertices_coords[pattern.edges_vertices[joined]]
    places = np.stack([_placed(folded, ends[:, end], left) for end in (0, 1)], axis=1)
    gaps = np.einsum("nei,ni->ne", places, missed[:, :2]) + missed[:, 2:]
    tops = np.einsum("fki,fi->fk", folded.corners, heights[:, :2]) + heights[:, 2:]
    most = float(np.where(pattern.faces_vertices >= 0, np.abs(tops), 0.0).max())
    return heights, float(np.abs(gaps).max(initial=0.0)) / (most or 1.0)


def _placed(folded: FlatFolded, flat: Floats, facets: Ints) -> Floats:
    """(n, 2) where the points ``flat`` (n, 2) of ``facets`` (n,) lie in the plane."""
    return np.asarray(folded.placement.points(flat, facets)[0, :, :2])


def _steps(folded: FlatFolded, half: Floats, edges: Ints, facets: Ints) -> Floats:
    """(n, 3) the change of z from ``facets`` (n,) across their creases ``edges`` (n,)."""
    pattern = folded.pattern
    tail, head = (
        _placed(folded, pattern.vertices_coords[pattern.edges_vertices[edges, end]], facets)
        for end in (0, 1)
    )
    along = head - tail
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # a facet is left of its edge in the flat pattern; in the plane it is, if it lies face up
    left = np.where(pattern.edges_faces[edges, 0] == facets, 1.0, -1.0)
    face = np.where(folded.up[facets], 1.0, -1.0)
    inward = np.column_stack([-along[:, 1], along[:, 0]]) * (left * face)[:, None]
    with np.errstate(divide="ignore"):
        slope = np.where(half[edges] == 0, 0.0, 2.0 / half[edges]) * face
    offset = -np.einsum("ni,ni->n", inward, tail)
    return np.asarray(np.column_stack([inward, offset]) * slope[:, None])
