"""Covers: rectangles of the bed's size, at any angle, that together hold every facet.

If K such rectangles hold every facet whole, then K patches are enough: assign each facet to a
rectangle that holds it, and the patch of a rectangle fits the bed. Rectangles may overlap and move
freely, so it is easier to minimise their number than the number of patches of a cut. A rectangle is
(x, y, θ), the centre in mm and the angle of the long side in radians. The *excess* of a facet over
a rectangle of sides w, h, with p' the corner p in the coordinates of the rectangle, is

    max over its corners of max(|p'_x| - w/2, |p'_y| - h/2).

The facet lies inside if its excess is not positive. With e_f the least excess of facet f over all
rectangles, a cover is found by minimising

    L = Σ_f max(e_f, 0)²

over all rectangles at once by L-BFGS (Nocedal 1980). The gradient of a term is the gradient of the
corner farthest outside of the nearest rectangle. Neighbouring rectangles push each other through
the facets between them, so unused room moves to where room is missing.
"""

from __future__ import annotations

import numpy as np

from miurafab.fabrication.partition.fit_box import boxes_at
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.nearest import tree_of
from miurafab.geometry.polygons import principal_axes

_AT_A_TIME = 512
"""Shapes that are compared with rectangles at a time, so that the numbers stay in the cache."""

_NEAR = 4
"""The number of rectangles tried for each facet."""

_REACH_MM = 25.0
"""Facets deeper than this inside a rectangle are skipped until the next :meth:`Relaxation.look`."""

_ARM_MM = 250.0
"""The length in mm that scales radians, about half the diagonal of a rectangle."""

UNITS = np.array([1.0, 1.0, 1.0 / _ARM_MM])
"""The units of (x, y, θ), so that equal steps move a rectangle equally far."""

ENOUGH, _LEFT_MM = 1.0, 0.8
"""A cover is accepted if L in mm² and the largest excess in mm are at most this."""

_SAMPLE = 12_000
"""The size of the sample of facets that the search uses."""


def rectangle_around(points: Floats, width: float, height: float) -> Floats:
    """(3,) the rectangle ``width`` x ``height`` mm with the least excess of ``points`` (n, 2); if
    several hold them, the rectangle at the angle of their smallest box.
    """
    angles, sizes = boxes_at(points, width, height)
    over = np.maximum(sizes[:, 0] - width, sizes[:, 1] - height)
    crossed = np.maximum(sizes[:, 0] - height, sizes[:, 1] - width)
    turned = crossed < over
    order = np.lexsort((sizes.prod(axis=1), np.maximum(np.minimum(over, crossed), 0.0)))
    best = int(order[0])
    angle = float(angles[best]) + (np.pi / 2 if turned[best] else 0.0)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    placed = points @ turn.T
    middle = (placed.min(axis=0) + placed.max(axis=0)) / 2
    return np.append(middle @ turn, angle)


def brickwork(shapes: Floats, size: tuple[float, float]) -> list[Floats]:
    """Two layouts of rectangles (K, 3) of sides ``size`` in mm, in rows over the facets ``shapes``
    (N, c, 2) along and across their longer axis, without rectangles that hold nothing.
    """
    centres = shapes.mean(axis=1)
    middle = centres.mean(axis=0)
    long = principal_axes(centres)[:, 1]
    turn = np.stack([long, [-long[1], long[0]]])
    angle = float(np.arctan2(long[1], long[0]))
    placed = (shapes - middle) @ turn.T
    low, high = placed.min(axis=(0, 1)), placed.max(axis=(0, 1))
    found = []
    for along in (0, 1):
        pitch = np.array(size if along == 0 else size[::-1])
        rows = max(1, int(np.ceil((high[1] - low[1]) / pitch[1])))
        apart = (high[1] - low[1]) / rows
        spots = []
        for row in range(rows):
            base = low[1] + row * apart
            here = (placed[..., 1].max(axis=1) >= base) & (
                placed[..., 1].min(axis=1) <= base + apart
            )
            if not here.any():
                continue
            # Each row starts where its facets start and is divided evenly.
            start, end = placed[here][..., 0].min(), placed[here][..., 0].max()
            count = max(1, int(np.ceil((end - start) / pitch[0])))
            x = start + (np.arange(count) + 0.5) * (end - start) / count
            spots.append(np.column_stack([x, np.full(count, base + apart / 2)]))
        spot = np.concatenate(spots)
        near, _ = tree_of(placed.mean(axis=1)).query(spot)
        spot = spot[near < pitch.max() / 2]
        turned = np.full(len(spot), angle + along * np.pi / 2)
        found.append(np.column_stack([spot @ turn + middle, turned]))
    return found


def excess(corners: Floats, rectangles: Floats, width: float, height: float) -> Floats:
    """(N,) the excess in mm of the point sets ``corners`` (N, c, 2) over ``rectangles`` (N, 3) or
    over one rectangle (3,); negative inside.
    """
    x, y = _seen(corners[..., 0].T, corners[..., 1].T, rectangles.T)
    long, short = width / 2, height / 2
    return np.asarray(
        np.maximum(
            np.abs(x).max(axis=0, initial=-np.inf) - long,
            np.abs(y).max(axis=0, initial=-np.inf) - short,
        )
    )


def nearest(
    centres: Floats, rectangles: Floats, width: float, height: float, most: int
) -> tuple[Ints, Floats]:
    """(N, m) the ``most`` rectangles in which the points ``centres`` (N, 2) lie deepest, unsorted,
    and the excess of the points over them in mm.
    """
    _, near = tree_of(rectangles[:, :2]).query(centres, k=min(2 * most, len(rectangles)))
    near = near.reshape(len(centres), -1)
    apart = np.stack(
        [excess(centres[:, None], rectangles[column], width, height) for column in near.T], axis=1
    )
    if near.shape[1] > most:
        pick = np.argpartition(apart, most - 1, axis=1)[:, :most]
        near = np.take_along_axis(near, pick, axis=1)
        apart = np.take_along_axis(apart, pick, axis=1)
    return near.astype(np.int64), apart


def _seen(x: Floats, y: Floats, rectangles: Floats) -> tuple[Floats, Floats]:
    """The points (c, N) in the coordinates of ``rectangles`` (3, N) or (3,)."""
    c, s = np.cos(rectangles[2]), np.sin(rectangles[2])
    x, y = x - rectangles[0], y - rectangles[1]
    return x * c + y * s, y * c - x * s


class Relaxation:
    """Moves rectangles of ``width`` x ``height`` mm until they cover the facets ``shapes``
    (N, c, 2).

    It works on a sample of the facets and adds to it the facets that a cover of the sample misses.
    ``spent`` counts evaluations of L, in units of an evaluation with 4,000 active facets.
    """

    def __init__(self, shapes: Floats, width: float, height: float) -> None:
        self.shapes, self.size = shapes, (width, height)
        total = len(shapes)
        # Steps of the golden ratio leave no stripes in a grid, whatever its number of columns.
        golden = (np.arange(total) * 0.6180339887498949) % 1.0
        self.sample = np.flatnonzero(golden < _SAMPLE / max(total, 1))
        self.spent = 0.0
        self.margin = 0.0
        self._take_sample()

    def _take_sample(self) -> None:
        self.corners = self.shapes[self.sample]
        self.centres = self.corners.mean(axis=1)
        self.radius = np.linalg.norm(self.corners - self.centres[:, None], axis=2).max(axis=1)

    def look(self, rectangles: Floats) -> None:
        """Find the rectangles near each shape; shapes deep inside a rectangle become inactive."""
        near, apart = nearest(self.centres, rectangles, *self.size, _NEAR)
        self.active = np.flatnonzero(apart.min(axis=1) + self.radius > -_REACH_MM)
        self.near = near[self.active]
        self.x = np.ascontiguousarray(self.corners[self.active, :, 0].T)
        self.y = np.ascontiguousarray(self.corners[self.active, :, 1].T)

    def least(self, rectangles: Floats) -> tuple[Ints, Floats]:
        """(A,) the rectangle with the least excess for each active shape, and that excess."""
        long, short = self.size[0] / 2 - self.margin, self.size[1] / 2 - self.margin
        c, s = np.cos(rectangles[:, 2]), np.sin(rectangles[:, 2])
        over = np.empty(self.near.shape[::-1])
        for start in range(0, len(self.near), _AT_A_TIME):
            some = slice(start, start + _AT_A_TIME)
            near = np.ascontiguousarray(self.near[some].T)
            x = self.x[:, None, some] - rectangles[near, 0]
            y = self.y[:, None, some] - rectangles[near, 1]
            cos, sin = c[near], s[near]
            along, across = np.abs(x * cos + y * sin), np.abs(y * cos - x * sin)
            over[:, some] = np.maximum(along.max(axis=0) - long, across.max(axis=0) - short)
        best = over.argmin(axis=0)
        shape = np.arange(len(best))
        return self.near[shape, best], over[best, shape]

    def _loss(self, steps: Floats) -> tuple[float, Floats]:
        """L in mm² and its gradient, for rectangles as one vector in :data:`UNITS`."""
        rectangles = steps.reshape(-1, 3) * UNITS
        self.spent += 0.2 + len(self.active) / 4000
        best, over = self.least(rectangles)
        out = np.flatnonzero(over > 0)
        over, best = over[out], best[out]
        x, y = _seen(self.x[:, out], self.y[:, out], rectangles[best].T)
        along = np.abs(x) - self.size[0] / 2
        across = np.abs(y) - self.size[1] / 2
        corner = np.maximum(along, across).argmax(axis=0)
        row = np.arange(len(out))
        x, y = x[corner, row], y[corner, row]
        long = along[corner, row] >= across[corner, row]
        sign = np.where(long, np.sign(x), np.sign(y)) * 2 * over
        c, s = np.cos(rectangles[best, 2]), np.sin(rectangles[best, 2])
        slope = np.empty_like(rectangles)
        for axis, part in enumerate(
            (np.where(long, -c, s), np.where(long, -s, -c), np.where(long, y, -x))
        ):
            slope[:, axis] = np.bincount(best, sign * part, len(rectangles))
        return float((over**2).sum()), (slope * UNITS).ravel()

    def relax(
        self, rectangles: Floats, margins: tuple[float, ...] = (), rounds: int = 4, steps: int = 60
    ) -> tuple[Floats, float]:
        """The rectangles at a local minimum of L, and L in mm².

        Each of ``margins`` in mm is tried first: facets must then lie that deep inside, which
        spreads unused room evenly.
        """
        for margin in margins:
            self.margin = margin
            self.look(rectangles)
            rectangles = self.descended(rectangles, steps)
        last = np.inf
        self.margin = 0.0
        for _ in range(rounds):
            self.look(rectangles)
            rectangles = self.descended(rectangles, steps)
            self.look(rectangles)
            loss, _ = self._loss((rectangles / UNITS).ravel())
            if loss <= ENOUGH or loss > 0.97 * last:
                break
            last = loss
        return rectangles, loss

    def descended(self, rectangles: Floats, steps: int) -> Floats:
        """The rectangles at a minimum of L over the rectangles that are near each facet now."""
        import scipy.optimize

        found = scipy.optimize.minimize(
            self._loss,
            (rectangles / UNITS).ravel(),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": steps, "maxcor": 30},
        )
        return np.asarray(found.x.reshape(-1, 3) * UNITS)

    def settled(self, rectangles: Floats, margins: tuple[float, ...] = ()) -> tuple[Floats, float]:
        """The rectangles relaxed until they cover all shapes, missed shapes added to the sample."""
        rectangles, loss = self.relax(rectangles, margins)
        for _ in range(4):
            if loss > ENOUGH:
                break
            left = self._left_out(rectangles)
            if not len(left):
                break
            self.sample = np.union1d(self.sample, left)
            self._take_sample()
            rectangles, loss = self.relax(rectangles)
        else:
            loss = np.inf
        return rectangles, loss

    def _left_out(self, rectangles: Floats) -> Ints:
        """The shapes that no rectangle holds."""
        corners, centres = self.shapes, self.shapes.mean(axis=1)
        first, _ = nearest(centres, rectangles, *self.size, 1)
        left = np.flatnonzero(excess(corners, rectangles[first[:, 0]], *self.size) > _LEFT_MM)
        if len(left):
            near, _ = nearest(centres[left], rectangles, *self.size, 2 * _NEAR)
            over = [excess(corners[left], rectangles[column], *self.size) for column in near.T]
            left = left[np.min(over, axis=0) > _LEFT_MM]
        return left
