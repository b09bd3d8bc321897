"""Covers: rectangles of the bed's size, each turned at will, that together hold every facet.

If K such rectangles hold every facet whole, K patches are enough: each facet goes to a rectangle
that holds it, and the patch of a rectangle fits the bed by construction. So few patches are looked
for among covers, which may overlap and move freely, instead of among cuts. A cover is K *frames*
(x, y, θ), the centre in mm and the angle of the long side in radians. With the coordinates p' of a
corner p in its frame, a facet's *excess* over a frame of sides w, h is

    max over its corners of max(|p'_x| - w/2, |p'_y| - h/2),

so it lies inside where that is not positive. With e_f the least excess of facet f over all frames,
a cover is found by lowering

    L = Σ_f max(e_f, 0)²

over all frames at once by L-BFGS (Nocedal 1980); its gradient is that of the one corner that is
farthest out, seen from the nearest frame. Neighbours push each other through the facets between
them, so that the room that one frame leaves over spreads to where it is missing.
"""

from __future__ import annotations

import numpy as np
import scipy.optimize
import scipy.spatial

from miurafab.fabrication.partition.fit_box import boxes_at
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import principal_axes

_NEAR = 4
"""Frames that are tried for each facet."""

_REACH_MM = 25.0
"""Facets deeper than this inside a frame are left out until the next look."""

_ARM_MM = 250.0
"""What a radian is worth in mm, about the half of a frame's diagonal, for steps of equal size."""

UNITS = np.array([1.0, 1.0, 1.0 / _ARM_MM])
"""What a frame is measured in, so that steps of equal size move it equally far."""

ENOUGH, _LEFT_MM = 1.0, 0.8
"""A cover is found when L is no more, in mm², and no facet stands out by more."""

_SAMPLE = 12_000
"""Facets that stand for all during the search."""


def frame_of(points: Floats, width: float, height: float) -> Floats:
    """(3,) the frame whose rectangle ``width`` x ``height`` mm holds ``points`` (n, 2) with the
    least excess, and of all that hold them the one turned to their smallest box.
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
    """Frames (K, 3) of sides ``size`` in mm laid in rows over facets ``shapes`` (N, c, 2), along
    and across the longer axis of the whole; those that hold nothing are left out.
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
            # Each row begins where its facets begin, and is filled evenly.
            start, end = placed[here][..., 0].min(), placed[here][..., 0].max()
            count = max(1, int(np.ceil((end - start) / pitch[0])))
            x = start + (np.arange(count) + 0.5) * (end - start) / count
            spots.append(np.column_stack([x, np.full(count, base + apart / 2)]))
        spot = np.concatenate(spots)
        near, _ = scipy.spatial.KDTree(placed.mean(axis=1)).query(spot)
        spot = spot[near < pitch.max() / 2]
        turned = np.full(len(spot), angle + along * np.pi / 2)
        found.append(np.column_stack([spot @ turn + middle, turned]))
    return found


def excess(corners: Floats, frames: Floats, width: float, height: float) -> Floats:
    """(N,) how far in mm the point sets ``corners`` (N, c, 2) stand out of ``frames`` (N, 3), or
    of one frame (3,); negative inside.
    """
    x, y = _seen(corners[..., 0].T, corners[..., 1].T, frames.T)
    long, short = width / 2, height / 2
    return np.asarray(
        np.maximum(
            np.abs(x).max(axis=0, initial=-np.inf) - long,
            np.abs(y).max(axis=0, initial=-np.inf) - short,
        )
    )


def nearest(
    centres: Floats, frames: Floats, width: float, height: float, most: int
) -> tuple[Ints, Floats]:
    """(N, m) the ``most`` frames that points ``centres`` (N, 2) lie deepest in, and the excess of
    the points over them in mm, unsorted.
    """
    _, near = scipy.spatial.KDTree(frames[:, :2]).query(centres, k=min(2 * most, len(frames)))
    near = near.reshape(len(centres), -1)
    apart = np.stack(
        [excess(centres[:, None], frames[column], width, height) for column in near.T], axis=1
    )
    if near.shape[1] > most:
        pick = np.argpartition(apart, most - 1, axis=1)[:, :most]
        near = np.take_along_axis(near, pick, axis=1)
        apart = np.take_along_axis(apart, pick, axis=1)
    return near.astype(np.int64), apart


def _seen(x: Floats, y: Floats, frames: Floats) -> tuple[Floats, Floats]:
    """The points (c, N) in their ``frames``, given as (3, N) or (3,)."""
    c, s = np.cos(frames[2]), np.sin(frames[2])
    x, y = x - frames[0], y - frames[1]
    return x * c + y * s, y * c - x * s


class Relaxation:
    """Frames of ``width`` x ``height`` mm moved until they cover the facets ``shapes`` (N, c, 2).

    It looks at a sample of the facets, to which those are added that a cover of the sample leaves
    out. ``spent`` counts the evaluations of L, in units of one with 4,000 facets in play.
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

    def look(self, frames: Floats) -> None:
        """Find the frames near each shape, and leave out what lies deep inside one."""
        near, apart = nearest(self.centres, frames, *self.size, _NEAR)
        self.active = np.flatnonzero(apart.min(axis=1) + self.radius > -_REACH_MM)
        self.near = near[self.active]
        self.x = np.ascontiguousarray(self.corners[self.active, :, 0].T)
        self.y = np.ascontiguousarray(self.corners[self.active, :, 1].T)

    def least(self, frames: Floats) -> tuple[Ints, Floats]:
        """(A,) the frame that holds each active shape best, and the excess over it."""
        long, short = self.size[0] / 2 - self.margin, self.size[1] / 2 - self.margin
        over = np.empty(self.near.shape[::-1])
        for row, column in zip(over, self.near.T, strict=True):
            x, y = _seen(self.x, self.y, frames[column].T)
            np.maximum(np.abs(x).max(axis=0) - long, np.abs(y).max(axis=0) - short, out=row)
        best = over.argmin(axis=0)
        shape = np.arange(len(best))
        return self.near[shape, best], over[best, shape]

    def _loss(self, steps: Floats) -> tuple[float, Floats]:
        """L / mm² and its gradient over the frames, given as one vector with angles in arms."""
        frames = steps.reshape(-1, 3) * UNITS
        self.spent += 0.2 + len(self.active) / 4000
        best, over = self.least(frames)
        out = np.flatnonzero(over > 0)
        over, best = over[out], best[out]
        x, y = _seen(self.x[:, out], self.y[:, out], frames[best].T)
        along = np.abs(x) - self.size[0] / 2
        across = np.abs(y) - self.size[1] / 2
        corner = np.maximum(along, across).argmax(axis=0)
        row = np.arange(len(out))
        x, y = x[corner, row], y[corner, row]
        long = along[corner, row] >= across[corner, row]
        sign = np.where(long, np.sign(x), np.sign(y)) * 2 * over
        c, s = np.cos(frames[best, 2]), np.sin(frames[best, 2])
        slope = np.empty_like(frames)
        for axis, part in enumerate(
            (np.where(long, -c, s), np.where(long, -s, -c), np.where(long, y, -x))
        ):
            slope[:, axis] = np.bincount(best, sign * part, len(frames))
        return float((over**2).sum()), (slope * UNITS).ravel()

    def relax(
        self, frames: Floats, margins: tuple[float, ...] = (), rounds: int = 4, steps: int = 60
    ) -> tuple[Floats, float]:
        """The frames moved to a least L nearby, and that L in mm².

        With ``margins`` in mm the facets are first asked to lie so deep inside, one after the
        other, so that room that is left over is shared out.
        """
        for margin in margins:
            self.margin = margin
            self.look(frames)
            frames = self.descended(frames, steps)
        last = np.inf
        self.margin = 0.0
        for _ in range(rounds):
            self.look(frames)
            frames = self.descended(frames, steps)
            self.look(frames)
            loss, _ = self._loss((frames / UNITS).ravel())
            if loss <= ENOUGH or loss > 0.97 * last:
                break
            last = loss
        return frames, loss

    def descended(self, frames: Floats, steps: int) -> Floats:
        """The frames at a least L, each facet being held by the frames that were near it."""
        found = scipy.optimize.minimize(
            self._loss,
            (frames / UNITS).ravel(),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": steps, "maxcor": 30},
        )
        return np.asarray(found.x.reshape(-1, 3) * UNITS)

    def settled(self, frames: Floats, margins: tuple[float, ...] = ()) -> tuple[Floats, float]:
        """The frames relaxed, with what they leave out of all shapes added to the sample."""
        frames, loss = self.relax(frames, margins)
        for _ in range(4):
            if loss > ENOUGH:
                break
            left = self._left_out(frames)
            if not len(left):
                break
            self.sample = np.union1d(self.sample, left)
            self._take_sample()
            frames, loss = self.relax(frames)
        else:
            loss = np.inf
        return frames, loss

    def _left_out(self, frames: Floats) -> Ints:
        """The shapes that no frame holds."""
        corners, centres = self.shapes, self.shapes.mean(axis=1)
        first, _ = nearest(centres, frames, *self.size, 1)
        left = np.flatnonzero(excess(corners, frames[first[:, 0]], *self.size) > _LEFT_MM)
        if len(left):
            near, _ = nearest(centres[left], frames, *self.size, 2 * _NEAR)
            over = [excess(corners[left], frames[column], *self.size) for column in near.T]
            left = left[np.min(over, axis=0) > _LEFT_MM]
        return left
