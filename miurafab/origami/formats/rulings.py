"""Rulings beside curved creases: the lines along which the paper there bends.

At a vertex where two folds meet, not quite in line, rigid facets cannot fold. The paper beside a
curved crease bends, and is straight along rulings. Of a plane curve that folds by one angle all
along, the rulings are perpendicular to the crease (D. Fuchs and S. Tabachnikov, More on
paperfolding, American Mathematical Monthly 106, 1999). So from each corner of the crease a ruling
runs to either side, in the middle of the angle there, up to the next line. Such a corner, with two
folds and two rulings, folds exactly (it meets Kawasaki's condition).

A ruling that comes to a curve ends at the nearer corner of that curve, so that the paper between
two curves is ruled from corner to corner.

Between two curves of one shape the rulings join what corresponds: they are parallel if one curve is
the other moved, and meet in one point if it is the other enlarged from there. So the paper is part
of a cylinder or a cone, a plane cuts it in each curve, and it goes on mirrored in that plane. (By
the formulas of Fuchs and Tabachnikov the rulings on both sides of a plane curve are one line when
flat.) So beyond the last of such curves rulings go straight on.

Where the crease is hollow, rulings across it may meet. Beside a single curve the paper is then
ruled across the chord, as a cylinder that is mirrored; otherwise, and if the curve turns back, the
shorter of two rulings that meet stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

BEND = math.radians(60.0)
"""The largest turn of a curved crease at one of its corners; at a larger one the crease is kinked.
"""

ALIKE = 0.02
"""Two curves whose sides differ by at most this part of their length are of one shape."""

AHEAD = 0.3
"""The least cosine of the angle of a side of a curve with its chord, for rulings across the chord.
"""

GRAZING = math.cos(math.radians(12.0))
"""The largest cosine of the angle of a ruling with a side where it begins or ends."""

ASIDE = math.cos(math.radians(70.0))
"""The least cosine of the angle between a ruling and the way across its crease."""

_CLOSE = 0.25
"""An end of a ruling this near to a corner, as a part of the line that it starts from, is there."""


def rulings(pattern: CreasePattern, curved: Bools) -> Floats:
    """(n, 2, 2) the rulings of ``pattern`` beside its ``curved`` edges (E,), mm."""
    folds = np.isin(pattern.edges_assignment, ("M", "V"))
    found: list[Floats] = []
    seen: set[tuple[int, int]] = set()
    facets = []
    for face, edges in zip(pattern.faces_vertices, pattern.faces_edges, strict=True):
        corners = face[face >= 0]
        sides = edges[: len(corners)]
        if len(corners) > 3 and (curved & folds)[sides].any():
            facets.append(_Facet(pattern.vertices_coords, corners, sides, curved, folds))
    axes: dict[int, Floats] = {}
    alone = []
    for facet in facets:
        pairs = facet.counterparts()
        for one, other in pairs:
            seen.add((min(one, other), max(one, other)))
            ray = pattern.vertices_coords[[one, other]]
            found.append(ray)
            axes[one] = axes[other] = ray[1] - ray[0]
        if not pairs:
            alone.append(facet)
    many = {vertex for facet in facets for vertex in facet.of_many_curves()}
    for facet in alone:
        for vertex, axis in facet.blocked():
            if vertex not in many:
                axes.setdefault(vertex, axis)
    ends: dict[int, list[Floats]] = {}
    for facet in alone:
        found += facet.rays(axes, seen, ends)
    return np.array(found).reshape(-1, 2, 2)


class _Facet:
    """A facet of the ``corners`` (k,) whose sides from corner to corner are the edges ``numbers``
    (k,), of which some are ``curved`` and ``folds`` (E,). Curved folds meet at the ``bent`` (k,)
    corners.
    """

    def __init__(
        self, points: Floats, corners: Ints, numbers: Ints, curved: Bools, folds: Bools
    ) -> None:
        self.corners, self.numbers = corners, numbers
        self.curved, folds = curved[numbers], folds[numbers]
        self.places = p = points[corners]
        self.sides = np.stack([p, np.roll(p, -1, axis=0)], axis=1)
        self.along = self.sides[:, 1] - p
        self.length = np.linalg.norm(self.along, axis=1)
        self.unit = unit = self.along / self.length[:, None]
        self.before = np.roll(unit, 1, axis=0)
        turn = np.abs(np.arctan2(_cross(self.before, unit), (self.before * unit).sum(axis=1)))
        both = folds & np.roll(folds, 1)
        self.bent = both & (self.curved | np.roll(self.curved, 1)) & (turn < BEND)
        across = np.stack([-self.before[:, 1] - unit[:, 1], self.before[:, 0] + unit[:, 0]], axis=1)
        self.inward = across / np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]

    def counterparts(self) -> list[tuple[int, int]]:
        """The pairs of vertices that correspond to each other on the two curves of one shape at the
        facet's sides; none if there are other curves.
        """
        runs = self._runs()
        if len(runs) != 2 or len(runs[0]) != len(runs[1]) or len(runs[0]) < 2:
            return []
        one, other = runs[0], runs[1][::-1]
        p = self.places
        steps, likewise = np.diff(p[one], axis=0), np.diff(p[other], axis=0)
        size = float((steps * likewise).sum() / (steps**2).sum())
        off = np.linalg.norm(likewise - size * steps, axis=1)
        if size <= 0 or (off > ALIKE * np.linalg.norm(likewise, axis=1)).any():
            return []
        rays = np.stack([p[one], p[other]], axis=1)
        if any(_crossed(ray, np.concatenate([self.sides, rays])).any() for ray in rays):
            return []
        ends = zip(self.corners[one].tolist(), self.corners[other].tolist(), strict=True)
        return list(ends)

    def _runs(self) -> list[Ints]:
        """The bent corners that follow each other, along the border of the facet."""
        count = len(self.bent)
        starts = np.flatnonzero(self.bent & ~np.roll(self.bent, 1))
        stops = np.flatnonzero(self.bent & ~np.roll(self.bent, -1))
        if not len(starts):  # a closed curve has no first corner
            return []
        ends = stops[np.searchsorted(stops, starts) % len(stops)]
        ends = np.where(ends < starts, ends + count, ends)
        pairs = zip(starts.tolist(), ends.tolist(), strict=True)
        return [np.arange(start, end + 1) % count for start, end in pairs]

    def of_many_curves(self) -> list[int]:
        """The vertices of its curves, where it has several."""
        runs = self._runs()
        return self.corners[np.concatenate(runs)].tolist() if len(runs) > 1 else []

    def blocked(self) -> list[tuple[int, Floats]]:
        """The vertices of curves across which rulings would meet each other in this facet, with the
        normal of the chord of their curve. Curves that turn back from it are left as they are.
        """
        found: list[tuple[int, Floats]] = []
        for run in self._runs():
            hits = [(corner, self._hit(corner, self.inward[corner])) for corner in run.tolist()]
            rays = np.array([[self.places[at], hit.end] for at, hit in hits if hit is not None])
            if not any(_crossed(ray, rays).any() for ray in rays):
                continue
            sides = np.append(run[0] - 1, run)
            chord = self.along[sides].sum(axis=0)
            chord /= np.linalg.norm(chord)
            if (self.unit[sides] @ chord > AHEAD).all():
                normal = np.array([-chord[1], chord[0]])
                found += [(vertex, normal) for vertex in self.corners[run].tolist()]
        return found

    def _near(self, corner: int) -> float:
        return _CLOSE * float(min(self.length[corner], self.length[corner - 1]))

    def _hit(self, corner: int, direction: Floats) -> _Hit | None:
        near = self._near(corner)
        return _first_hit(self.places, self.along, self.curved, corner, direction, near)

    def _grazes(self, corner: int, hit: _Hit) -> bool:
        """Whether a ruling from ``corner`` runs almost along a side where it begins or ends."""
        ray = hit.end - self.places[corner]
        ray /= np.linalg.norm(ray)
        starts = [self.unit[corner], -self.unit[corner - 1]]
        if hit.corner >= 0:
            ends = [self.unit[hit.corner], -self.unit[hit.corner - 1]]
        else:
            ends = [self.unit[hit.side], -self.unit[hit.side]]
        beside = [*(ray @ side for side in starts), *(-ray @ side for side in ends)]
        return bool(max(beside) > GRAZING)

    def rays(
        self,
        axes: Mapping[int, Floats],
        seen: set[tuple[int, int]],
        ends: dict[int, list[Floats]],
    ) -> list[Floats]:
        """The rulings that begin at bent corners: along the one of ``axes`` of their vertex, or
        across the crease. ``seen`` holds the pairs of vertices that are joined already, and
        ``ends`` the ends of rulings in each edge; both take in what is found.
        """
        p = self.places
        rays = []
        for corner in np.flatnonzero(self.bent).tolist():
            direction = self.inward[corner]
            axis = axes.get(int(self.corners[corner]))
            if axis is not None:
                direction = math.copysign(1.0, float(axis @ direction)) * axis
            hit = self._hit(corner, direction)
            if hit is not None and not self._grazes(corner, hit):
                rays.append((float(np.linalg.norm(hit.end - p[corner])), corner, hit))
        kept: list[Floats] = []
        reached: set[int] = set()
        free: list[_Hit] = []
        for _, corner, hit in sorted(rays, key=lambda ray: ray[:2]):
            if hit.corner < 0:
                hit = self._joined(corner, hit, ends)
            if self._is_open(corner, hit, kept, seen):
                kept.append(np.stack([p[corner], hit.end]))
                reached |= {corner, hit.corner}
                free += [hit] if hit.corner < 0 else []
        for corner in np.flatnonzero(self.bent).tolist():
            goals = [] if corner in reached else self._instead(corner, free)
            found = next((goal for goal in goals if self._is_open(corner, goal, kept, seen)), None)
            if found is not None:
                kept.append(np.stack([p[corner], found.end]))
                reached.add(found.corner)
        return kept

    def _joined(self, corner: int, hit: _Hit, ends: dict[int, list[Floats]]) -> _Hit:
        """``hit`` moved to an end of another ruling in its side that is near, or told in ``ends``
        as a new one.
        """
        there = ends.setdefault(int(self.numbers[hit.side]), [])
        away = [float(np.linalg.norm(hit.end - other)) for other in there]
        if away and min(away) <= self._near(corner):
            return hit._replace(end=there[int(np.argmin(away))])
        there.append(hit.end)
        return hit

    def _is_open(
        self, corner: int, hit: _Hit, kept: list[Floats], seen: set[tuple[int, int]]
    ) -> bool:
        """Whether nothing stands between ``corner`` and ``hit``, and they are not joined yet; then
        they are among those ``seen``.
        """
        ray = np.stack([self.places[corner], hit.end])
        others = np.concatenate([self.sides, np.array(kept).reshape(-1, 2, 2)])
        pair = (corner, -1)
        if hit.corner >= 0:
            one, other = int(self.corners[corner]), int(self.corners[hit.corner])
            pair = (min(one, other), max(one, other))
            apart = abs(hit.corner - corner) not in (0, 1, len(self.corners) - 1)
            if not apart or pair in seen:
                return False
        if _crossed(ray, others).any():
            return False
        if hit.corner >= 0:
            seen.add(pair)
        return True

    def _instead(self, corner: int, free: list[_Hit]) -> list[_Hit]:
        """Where a ruling from ``corner`` may end if its own way is blocked: corners of the facet,
        and ``free`` ends of other rulings, those first that are nearest to its direction.
        """
        goals = [*(_Hit(place, at, -1) for at, place in enumerate(self.places)), *free]
        start, ahead = self.places[corner], self.inward[corner]
        ranked = []
        for number, goal in enumerate(goals):
            ray = goal.end - start
            length = float(np.linalg.norm(ray))
            if length > 0 and ray @ ahead >= ASIDE * length and not self._grazes(corner, goal):
                ranked.append((-float(ray @ ahead) / length, number))
        return [goals[number] for _, number in sorted(ranked)]


class _Hit(NamedTuple):
    """Where a ruling ends: the point, the corner of its facet there, -1 for none, and the side."""

    end: Floats
    corner: int
    side: int


def _first_hit(
    p: Floats, along: Floats, curved: Bools, corner: int, inward: Floats, close: float
) -> _Hit | None:
    """Where the ray from ``corner`` first meets another side."""
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = p - p[corner]
        turn = _cross(np.broadcast_to(inward, along.shape), along)
        far = _cross(offset, along) / turn
        place = _cross(offset, np.broadcast_to(inward, along.shape)) / turn
    own = np.zeros(len(p), dtype=bool)
    own[[corner, corner - 1]] = True
    meets = ~own & (far > 0) & (place >= 0) & (place <= 1)
    if not meets.any():
        return None
    side = int(np.argmin(np.where(meets, far, np.inf)))
    nearer = side if place[side] < 0.5 else (side + 1) % len(p)
    end = p[corner] + far[side] * inward
    if curved[side] or float(np.linalg.norm(p[nearer] - end)) <= close:
        return _Hit(p[nearer], nearer, side)
    return _Hit(end, -1, side)


def _crossed(ray: Floats, others: Floats) -> Bools:
    """(n,) whether the ``ray`` (2, 2) crosses each of ``others`` (n, 2, 2) between their ends."""
    a, b = ray
    c, d = others[:, 0], others[:, 1]
    scale = 1e-9 * float(np.linalg.norm(b - a)) * np.linalg.norm(d - c, axis=1)
    one, other = _cross(b - a, c - a), _cross(b - a, d - a)
    first, second = _cross(d - c, a - c), _cross(d - c, b - c)
    return np.asarray(
        (np.minimum(one, other) < -scale)
        & (np.maximum(one, other) > scale)
        & (np.minimum(first, second) < -scale)
        & (np.maximum(first, second) > scale)
    )


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
