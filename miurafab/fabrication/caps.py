"""Caps: an open border is closed by a fan of triangles, one piece of paper without a seam in it.

The rim of a corrugated shell zigzags, so no plane passes through it, and a flat disk would leave
gaps. A fan joins each edge of the rim to one apex. It meets the rim exactly, edge by edge, wherever
the apex is; only its flat form asks for something. The angles at the apex must add up to

    sum_i angle(w_i - a, w_(i+1) - a) = 2 pi,    a = c + h n,

with the rim w, its middle c, and n the normal of the plane that fits the rim best, outwards. Then
the fan is developable: a flat polygon that is folded along its spokes. In the plane of the rim the
sum is at least 2 pi, since the rim goes round c on both sides of the plane (a closed curve on the
sphere that no open half of it holds is 2 pi long at least), and it falls to 0 far away. So there is
a height h; of a rim in a plane it is 0, and the cap is a flat polygon.

The fan does not meet itself if the rim goes round the axis without turning back. Whether it meets
the shell is measured.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.borders import OpenBorder, chosen
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.pieces import lattice_cells
from miurafab.fabrication.seams import border_seams, shell_points
from miurafab.fabrication.wording import count
from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.unfold import with_angles_of_the_folded_form
from miurafab.origami.verify import measure

FARTHEST = 20.0
"""The highest apex that is looked at, over the radius of the rim."""


def capped(pattern: CreasePattern, options: LayoutOptions) -> CreasePattern:
    """``pattern`` with a cap on each open border that ``options`` name, each a piece of its own.

    Raises :class:`~miurafab.errors.LayoutError` for a border that is not there or that no cap
    closes.
    """
    borders = chosen(pattern, options.caps, "caps")
    if not borders:
        return pattern
    if pattern.folded_coords is None:
        raise LayoutError("`caps` are shaped by the folded form, which the pattern lacks.")
    made = pattern
    for border in borders:
        made = _with_cap(made, border)
    made = with_angles_of_the_folded_form(made)
    before, after = (measure(each).self_intersections or 0 for each in (pattern, made))
    if after > before:
        raise LayoutError(
            f"A cap would pass through the shell at {count(after - before, 'place', 'places')}; "
            "leave that border out of `caps`, or give it tabs (`border_tabs`)."
        )
    return made


def _with_cap(pattern: CreasePattern, border: OpenBorder) -> CreasePattern:
    """``pattern`` with one more piece, on ``border``."""
    assert pattern.folded_coords is not None
    edges, vertices = _round(pattern, border)
    rim = pattern.folded_coords[vertices]
    apex = _apex(pattern, rim, border)
    arms = rim - apex
    angles = _angles(arms)
    turn = np.cumsum(np.concatenate([[0.0], angles[:-1]]))
    reach = np.linalg.norm(arms, axis=1)
    flat = reach[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    high = pattern.vertices_coords.max(axis=0)
    place = np.array([high[0] + 1.1 * reach.max(), pattern.vertices_coords[:, 1].mean()])
    count, first = len(rim), len(pattern.vertices_coords)
    own = first + np.arange(count)
    following, top = np.roll(own, -1), np.full(count, first + count)
    number = len(pattern.edges_vertices)
    faces = np.column_stack([own, following, top])
    wide = pattern.faces_vertices.shape[1]
    cells, pieces = lattice_cells(pattern), pattern.pieces
    if cells is not None:
        beyond = cells.max(axis=0) + 2
        cells = np.concatenate([cells, beyond + np.column_stack([np.arange(count), 0 * own])])
    seams = border_seams(pattern).edges
    pieces = np.zeros(len(pattern.faces_vertices), dtype=np.int64) if pieces is None else pieces
    return replace(
        pattern,
        vertices_coords=np.concatenate([pattern.vertices_coords, flat + place, place[None]]),
        edges_vertices=np.concatenate(
            [
                pattern.edges_vertices,
                np.column_stack([own, following]),
                np.column_stack([own, top]),
            ]
        ),
        edges_assignment=np.append(pattern.edges_assignment, ["B"] * count + ["U"] * count),
        edges_fold_angle=np.append(pattern.edges_fold_angle, np.zeros(2 * count)),
        faces_vertices=np.concatenate(
            [pattern.faces_vertices, np.pad(faces, ((0, 0), (0, wide - 3)), constant_values=-1)]
        ),
        folded_coords=np.concatenate([pattern.folded_coords, rim, apex[None]]),
        grid=None,
        pieces=np.append(pieces, np.full(count, pieces.max() + 1)),
        seams=np.concatenate([seams, np.column_stack([edges, number + np.arange(count)])]),
        cells=cells,
    )


def _round(pattern: CreasePattern, border: OpenBorder) -> tuple[Ints, Ints]:
    """The edges of ``border`` in their order round the cap, and the vertex at which each starts.

    A cap has the rim on its left where the shell has it on its right, so it goes the other way.
    """
    points = shell_points(pattern, border_seams(pattern))
    edges = np.array(border.edges)
    turned = (pattern.edges_faces[edges, 0] >= 0)[:, None]
    ends = pattern.edges_vertices[edges]
    ends = np.where(turned, ends[:, ::-1], ends)
    start = {int(points[a]): row for row, a in enumerate(ends[:, 0].tolist())}
    rows = [0]
    while (following := start.get(int(points[ends[rows[-1], 1]]))) not in (None, 0):
        assert following is not None
        rows.append(following)
    if len(rows) != len(edges) or len(start) != len(edges):
        raise LayoutError(
            f"Open border {border.number} does not go round once, so that it takes no cap; leave "
            "it out of `caps`."
        )
    return edges[rows], ends[rows, 0]


def _apex(pattern: CreasePattern, rim: Floats, border: OpenBorder) -> Floats:
    """(3,) the apex of the fan over ``rim`` (n, 3)."""
    assert pattern.folded_coords is not None
    middle = rim.mean(axis=0)
    normal = np.linalg.svd(rim - middle)[2][2]
    if normal @ (pattern.folded_coords.mean(axis=0) - middle) > 0:
        normal = -normal
    arms = rim - middle
    steps = np.roll(arms, -1, axis=0)
    ahead = np.arctan2(vector_product(arms, steps) @ normal, _flat_dot(arms, steps, normal))
    round_ = abs(ahead.sum())
    if not (np.abs(np.sign(ahead).sum()) == len(rim) and abs(round_ - 2 * math.pi) < 1e-6):
        raise LayoutError(
            f"Open border {border.number} turns back as seen from its middle, so that a cap would "
            "pass through itself; leave it out of `caps`."
        )

    def excess(height: float) -> float:
        return float(_angles(arms - height * normal).sum()) - 2 * math.pi

    if excess(0.0) <= 1e-12:
        return np.asarray(middle)
    far = FARTHEST * float(np.linalg.norm(arms, axis=1).max())
    import scipy.optimize

    height = scipy.optimize.brentq(excess, 0.0, far, xtol=1e-13, rtol=1e-15)
    return np.asarray(middle + height * normal)


def _flat_dot(a: Floats, b: Floats, normal: Floats) -> Floats:
    """(n,) the products of ``a`` and ``b`` (n, 3) in the plane across ``normal``."""
    return np.asarray((a * b).sum(axis=1) - (a @ normal) * (b @ normal))


def _angles(arms: Floats) -> Floats:
    """(n,) the angles between each of ``arms`` (n, 3) and the next, the last and the first."""
    ahead = np.roll(arms, -1, axis=0)
    across = np.linalg.norm(vector_product(arms, ahead), axis=1)
    return np.asarray(np.arctan2(across, (arms * ahead).sum(axis=1)))
