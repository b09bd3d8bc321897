"""Thick panels with shifted hinges: plates of one thickness that fold as the thin sheet does.

Each plate keeps the outline of its facet, and each crease e gets an axis at the height h_e over
the flat sheet (Y. Chen, R. Peng and Z. You, "Origami of thick panels", Science 349, 2015). Going
round a vertex, the axes shift the plates against each other by

    sum over the facets f of a_f n_f(s),     a_f = h(next crease) - h(crease before)

with n_f the normal of f at the state s. The thick sheet moves with the angles of the thin one if
and only if this is zero at each s. The four normals of a vertex of degree four have one null vector
nu; where the vertex is flat-foldable, nu does not depend on s: its parts are the sines of the
sectors with the signs + - - +, and the four axes are a Bennett linkage. So at each vertex v

    h(next crease) - h(crease before) = c_v nu_f         with one unknown c_v,

which leaves 2 (n - 1) heights free on n x n facets. Of these, a linear program chooses plates
[b_f, b_f + t] of the greatest thickness t within heights -1 to 1:

- the axis of a valley is not below the top of its two plates, that of a mountain not above their
  bottom;
- folded flat, across e from f to g the plane of the sheet rises by 2 u_f h_e, with u_f = 1 where f
  lies face up and -1 where face down; plates keep the order of the layers there.

All heights grow in proportion to the thickness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, hstack, vstack

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import (
    FacetPlacement,
    facet_tree,
    fold_angles_at,
    place,
)
from miurafab.origami.folding.layers import LayerOrder, layer_order
from miurafab.origami.invariants import corner_ring, interior_vertices

MOST_RANGE = 16.0
"""The highest axis may be so many thicknesses above the lowest; brackets must stay short."""

_STATES = (0.3, 1.0, 3.0)
"""States whose normals give the null vectors; it must be the same in all of them."""


@dataclass(frozen=True, eq=False)
class BennettHeights:
    """Axes and plates of a sheet, in units in which the axes lie within -1 to 1.

    Attributes
    ----------
    pattern : CreasePattern
        The pattern, with E edges and F facets.
    axis : (E,) float64
        The height of the axis of each crease; 0 on borders.
    bottom : (F,) float64
        The height of the bottom of each plate.
    thickness : float
        The thickness of all plates; 0 where no plates fit.
    free : int
        The number of heights that can be chosen freely.
    """

    pattern: CreasePattern
    axis: Floats
    bottom: Floats
    thickness: float
    free: int

    @property
    def exists(self) -> bool:
        """Whether plates fit, with brackets that can be made."""
        return self.thickness * MOST_RANGE >= 2.0


def bennett_heights(pattern: CreasePattern) -> BennettHeights:
    """The heights of axes and plates with which ``pattern`` folds in the thickest plates.

    Raises
    ------
    PatternError
        For a pattern that does not fold rigidly to a flat-folded state without crossing itself, and
        for interior vertices that do not have four creases.

    Examples
    --------
    >>> import miurafab as mf
    >>> sheet = mf.fit("plane", facets=(4, 4), flat_foldable="exact")
    >>> heights = bennett_heights(sheet.pattern)
    >>> heights.free, round(heights.thickness / 2, 4)  # 2 (n - 1), and 1 / (2 (n - 1))
    (6, 0.1667)
    """
    from scipy.optimize import linprog

    order = layer_order(pattern)
    if not order.known:
        raise PatternError(
            "The sheet cannot be made of plates: its layers have no order in which it closes."
        )
    edges, columns, closing = _closing(pattern)
    rows, vertices = closing.shape[0], closing.shape[1] - len(edges)
    facets = len(pattern.faces_vertices)
    tied = _row_space(closing.toarray())
    free = len(edges) + vertices - len(tied)
    # unknowns: heights of axes, c of vertices, bottoms of plates, thickness
    size = len(edges) + vertices + facets + 1
    apart = vstack([_axes_clear(pattern, edges, size), _plates_apart(order, columns, size)])
    equal = hstack([closing, csr_array((rows, facets + 1))]).tocsr()
    bounds = np.tile([-np.inf, np.inf], (size, 1))
    bounds[: len(edges)] = [-1.0, 1.0]
    # as thick as the range of the axes; more only where all creases are valleys, or mountains
    bounds[-1] = [0.0, 2.0]
    cost = np.zeros(size)
    cost[-1] = -1.0
    inequal, limits = np.zeros(apart.shape[0]), np.zeros(rows)
    # the stubs of linprog know dense matrices alone
    found = linprog(cost, apart, inequal, equal, limits, bounds)  # type: ignore[call-overload]
    axis = np.zeros(len(pattern.edges_vertices))
    if found.status != 0:  # all heights 0 are a solution, so the solver failed: no plates are known
        return BennettHeights(pattern, axis, np.zeros(facets), 0.0, free)
    # the program closes the loops to a tolerance, the projection to rounding
    solved = found.x[: len(edges) + vertices]
    axis[edges] = (solved - tied.T @ (tied @ solved))[: len(edges)]
    bottom = found.x[len(edges) + vertices : -1]
    return BennettHeights(pattern, axis, bottom, float(found.x[-1]), free)


def nearest_heights(pattern: CreasePattern, wished: Floats) -> Floats:
    """(E,) the heights of axes nearest to those ``wished`` (E,) with which the thick sheet of
    ``pattern`` folds as the thin one; 0 on borders. Plates are not looked at.

    Raises :class:`~miurafab.errors.PatternError` as :func:`bennett_heights` does.
    """
    edges, _, closing = _closing(pattern)
    tied = len(_row_space(closing.toarray()))
    basis = np.linalg.svd(closing.toarray(), full_matrices=True)[2][tied:, : len(edges)]
    found = np.linalg.lstsq(basis.T, wished[edges], rcond=None)[0]
    heights = np.zeros(len(pattern.edges_vertices))
    heights[edges] = found @ basis
    return heights


def _closing(pattern: CreasePattern) -> tuple[Ints, Ints, csr_array]:
    """The creases (n,), the column of each edge (E,), and the rows that are zero where loops close,
    over the heights of the creases and the c of the vertices.
    """
    turns = _turns(pattern)
    edges = np.flatnonzero(_folding(pattern))
    columns = np.full(len(pattern.edges_vertices), -1, dtype=np.int64)
    columns[edges] = np.arange(len(edges))
    vertices = len(turns.vertices)
    row = np.arange(4 * vertices)
    values = np.concatenate([np.ones(len(row)), -np.ones(len(row)), -turns.shares.reshape(-1)])
    around = [columns[turns.after].reshape(-1), columns[turns.before].reshape(-1)]
    places = np.concatenate([*around, len(edges) + row // 4])
    shape = (len(row), len(edges) + vertices)
    return edges, columns, coo_array((values, (np.tile(row, 3), places)), shape=shape).tocsr()


def _row_space(matrix: Floats) -> Floats:
    """(r, n) an orthonormal basis of the rows of ``matrix`` (m, n)."""
    if not len(matrix):
        return matrix
    _, size, rows = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(rows[size > 1e-9 * size[0]])


def thick_loop_gap(pattern: CreasePattern, axis: Floats, states: Floats) -> Floats:
    """(T,) the largest distance of two plates on the axis of their crease, at each of ``states``
    (T,), in mean edges; the axes are at the heights ``axis`` (E,), mm.
    """
    placement = thick_placement(pattern, axis, states)
    joined = np.flatnonzero(_folding(pattern))
    ends = pattern.vertices_coords[pattern.edges_vertices[joined]]
    places = []
    for side in (0, 1):
        facet = pattern.edges_faces[joined, side]
        for end in (0, 1):
            points = np.column_stack([ends[:, end], axis[joined]])
            moved = np.einsum("tnij,nj->tni", placement.turn[:, facet], points)
            places.append(moved + placement.shift[:, facet])
    gap = np.stack([places[0] - places[2], places[1] - places[3]])
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    return np.asarray(np.linalg.norm(gap, axis=3).max(axis=(0, 2), initial=0.0) / mean)


def thick_placement(pattern: CreasePattern, axis: Floats, states: Floats) -> FacetPlacement:
    """Where the plates lie at ``states`` (T,) with the axes at the heights ``axis`` (E,), mm."""
    return place(pattern, fold_angles_at(pattern, states), axis)


@dataclass(frozen=True, eq=False)
class _Turns:
    """Around each of I interior ``vertices``: the four facets counter-clockwise by the creases
    ``before`` and ``after`` (I, 4) each, and the null vectors ``shares`` (I, 4).
    """

    vertices: Ints
    before: Ints
    after: Ints
    shares: Floats


def _turns(pattern: CreasePattern) -> _Turns:
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    ring, vertices = corner_ring(pattern, flat), interior_vertices(pattern)
    first = np.full(len(flat), -1, dtype=np.int64)
    corners = np.flatnonzero(ring.vertex >= 0)
    first[ring.vertex[corners]] = corners
    around = [first[vertices]]
    for _ in range(4):
        around.append(ring.following[around[-1]])
    other = np.flatnonzero(around[4] != around[0])
    if len(other):
        raise PatternError(
            f"Vertex {vertices[other[0]]} does not have four creases, so shifted hinges do not fit."
        )
    corner = np.stack(around[:4], axis=1)
    width = pattern.faces_vertices.shape[1]
    facet = corner // width
    before = pattern.faces_edges.reshape(-1)[corner]  # from the vertex along its facet
    after = np.roll(before, -1, axis=1)
    placement = place(pattern, fold_angles_at(pattern, np.array(_STATES)))
    normals = placement.turn[..., 2][:, facet]  # (T, I, 4, 3)
    stacked = normals.transpose(1, 0, 3, 2).reshape(len(vertices), 3 * len(_STATES), 4)
    shares = np.linalg.svd(stacked)[2][:, 3]
    return _Turns(vertices, before, after, shares)


def _folding(pattern: CreasePattern) -> Bools:
    """(E,) the edges between two facets that are not cut."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    return np.asarray(inner & ~np.isin(pattern.edges_assignment, ("B", "C")))


def _axes_clear(pattern: CreasePattern, edges: Ints, size: int) -> csr_array:
    """Rows with at most 0: valley axes over the tops of their plates, mountain axes under the
    bottoms.
    """
    facets = len(pattern.faces_vertices)
    first = size - 1 - facets
    valley = np.repeat(pattern.edges_fold_angle[edges] > 0, 2)
    plate = first + pattern.edges_faces[edges].reshape(-1)
    column = np.repeat(np.arange(len(edges)), 2)
    row = np.arange(len(plate))
    sign = np.where(valley, 1.0, -1.0)
    values = np.concatenate([sign, -sign, np.where(valley, 1.0, 0.0)])
    places = np.concatenate([plate, column, np.full(len(row), size - 1)])
    return coo_array((values, (np.tile(row, 3), places)), shape=(len(row), size)).tocsr()


def _plates_apart(order: LayerOrder, columns: Ints, size: int) -> csr_array:
    """Rows with at most 0: of two plates that overlap when folded flat, the lower ends below the
    higher.
    """
    folded, pattern = order.folded, order.folded.pattern
    facets = len(pattern.faces_vertices)
    first = size - 1 - facets
    before, crease, depth = facet_tree(pattern)
    front = np.where(folded.up, 1.0, -1.0)
    planes = np.zeros((facets, size))  # the plane of each facet, linear in the unknowns
    for facet in np.argsort(depth, kind="stable").tolist():
        if depth[facet] > 0:
            parent = before[facet]
            planes[facet] = planes[parent]
            planes[facet, columns[crease[facet]]] += 2 * front[parent]
    low, high = planes.copy(), planes.copy()
    here = np.arange(facets)
    low[here, first + here] += front
    high[here, first + here] += front
    low[:, -1] += np.where(folded.up, 0.0, -1.0)
    high[:, -1] += np.where(folded.up, 1.0, 0.0)
    pairs = folded.shared.pairs
    upper = np.where(order.above > 0, pairs[:, 0], pairs[:, 1])
    lower = np.where(order.above > 0, pairs[:, 1], pairs[:, 0])
    return csr_array(csr_array(high)[lower] - csr_array(low)[upper])
