"""The placement of a sheet's rectangle in the flat layout of a mesh.

The layout is turned by an angle, and the rectangle is upright in the turned layout. Of the largest
rectangles at many angles, the best covers much of the mesh and has evenly spaced lattice points:
paper is flat, so uneven spacing needs deeper corrugation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.errors import UnitError
from miurafab.geometry.arrays import Bools, Floats, Ints, places_in_runs
from miurafab.options.kinds import comma_parts
from miurafab.surfaces.surface import Domain
from miurafab.units import parse_length

ANGLES = np.radians(np.arange(-45, 45, 7.5))
_LATTICE = 81
_SAMPLES = 13


@dataclass(frozen=True)
class GridPlacement:
    """The rectangle ``domain`` in the layout turned back by ``angle`` (radians)."""

    angle: float
    domain: Domain

    def shrunk(self, factor: float) -> GridPlacement:
        """The rectangle with the same centre, ``factor`` times as wide and high."""
        d = self.domain
        u, v = (d.u0 + d.u1) / 2, (d.v0 + d.v1) / 2
        half_u, half_v = factor * d.width / 2, factor * d.height / 2
        return GridPlacement(self.angle, Domain(u - half_u, u + half_u, v - half_v, v + half_v))


@dataclass(frozen=True)
class Region:
    """A rectangle u0, u1, v0, v1 from the lower left corner of the layout's bounding box,
    as fractions of it or as lengths.
    """

    values: tuple[float, float, float, float]
    fractions: bool

    @classmethod
    def read(cls, value: object) -> Region:
        """``0.1,0.9,0.2,0.8`` (fractions) or ``10mm,90mm,2cm,8cm``, as text or as four values.

        Raises ``ValueError`` with the rest of a sentence.
        """
        example = "write u0,u1,v0,v1 such as 0.1,0.9,0.2,0.8 or 10mm,90mm,2cm,8cm"
        try:
            words = [str(part).strip() for part in comma_parts(value)]
            u0, u1, v0, v1 = values = [parse_length(word) for word in words]
        except (TypeError, ValueError, UnitError):
            raise ValueError(f"is '{value}'; {example}") from None
        if not (0 <= u0 < u1 and 0 <= v0 < v1):
            raise ValueError(f"is '{value}'; each start must be under its end: {example}")
        bare = [word.replace(".", "").replace("e-", "").isdigit() for word in words]
        return cls((u0, u1, v0, v1), all(bare) and max(values) <= 1)

    def __str__(self) -> str:
        unit = "" if self.fractions else "mm"
        return ",".join(f"{value:g}{unit}" for value in self.values)

    def domain(self, frame: Floats) -> Domain:
        """The rectangle in the turned layout ``frame`` (V, 2)."""
        low, size = frame.min(axis=0), np.ptp(frame, axis=0)
        step = size if self.fractions else np.ones(2)
        u0, u1, v0, v1 = self.values
        return Domain(
            float(low[0] + u0 * step[0]),
            float(low[0] + u1 * step[0]),
            float(low[1] + v0 * step[1]),
            float(low[1] + v1 * step[1]),
        )


def turned(flat: Floats, angle: float) -> Floats:
    """``flat`` (V, 2) in the frame turned by ``angle``."""
    c, s = math.cos(angle), math.sin(angle)
    return np.asarray(flat @ np.array([[c, -s], [s, c]]))


def placements(vertices: Floats, flat: Floats, faces: Ints) -> list[tuple[float, GridPlacement]]:
    """The best placement at each angle with its score, the best first.

    The score is the area times the root of the :func:`evenness`.
    """
    scored = []
    for angle in ANGLES.tolist():
        frame = turned(flat, angle)
        domain = largest_rectangle(frame, faces)
        if domain is not None:
            score = domain.width * domain.height * evenness(vertices, frame, faces, domain) ** 0.5
            scored.append((score, GridPlacement(angle, domain)))
    # of scores equal to 2 %, the angle nearest to the axes of the layout comes first; the best and
    # its equals by symmetry are of one class whatever the rounding
    best = max((score for score, _ in scored), default=0.0)
    return sorted(
        scored, key=lambda pair: (-math.floor(50 * pair[0] / best + 1e-6), abs(pair[1].angle))
    )


def covered(frame: Floats, faces: Ints, domain: Domain, count: int = 41) -> bool:
    """Whether all points of a lattice over ``domain`` lie in the layout ``frame``."""
    return bool((_lattice_triangles(frame, faces, domain, count)[0] >= 0).all())


def evenness(vertices: Floats, frame: Floats, faces: Ints, domain: Domain) -> float:
    """The least over the greatest spacing along u, times the same along v, in (0, 1]."""
    triangle = _lattice_triangles(frame, faces, domain, _SAMPLES)[0]
    triangle = np.unique(triangle[triangle >= 0])
    p, q = vertices[faces[triangle]], frame[faces[triangle]]
    e, f = p[:, 1:] - p[:, :1], q[:, 1:] - q[:, :1]
    speeds = np.linalg.norm(np.linalg.solve(f, e), axis=2)
    low, high = np.quantile(speeds, 0.03, axis=0), np.quantile(speeds, 0.97, axis=0)
    return float(np.prod(low / high))


def _lattice_triangles(
    frame: Floats, faces: Ints, domain: Domain, count: int
) -> tuple[Ints, Floats]:
    """The triangle of each point of a lattice just inside ``domain``, and its coordinates."""
    lattice = domain.lattice(count, count).reshape(-1, 2)
    centre = np.array([(domain.u0 + domain.u1) / 2, (domain.v0 + domain.v1) / 2])
    return locate(frame, faces, centre + (lattice - centre) * (1 - 2e-6))


def largest_rectangle(frame: Floats, faces: Ints) -> Domain | None:
    """The largest upright rectangle of covered points of a lattice over the layout, if any."""
    low, high = frame.min(axis=0), frame.max(axis=0)
    whole = Domain(low[0], high[0], low[1], high[1])
    inside = _lattice_triangles(frame, faces, whole, _LATTICE)[0] >= 0
    i0, i1, j0, j1 = _largest_block(inside.reshape(_LATTICE, _LATTICE))
    if i1 <= i0 or j1 <= j0:
        return None
    x, y = (np.linspace(low[k], high[k], _LATTICE).tolist() for k in (0, 1))
    return Domain(x[i0], x[i1], y[j0], y[j1])


def _largest_block(covered: Bools) -> tuple[int, int, int, int]:
    """Column and row range of the largest rectangle of lattice points that are all covered.

    Row by row: the largest rectangle under the histogram of covered runs, with a stack.
    """
    rows, columns = covered.shape
    run = np.zeros(columns, dtype=np.int64)
    best, block = -1, (0, 0, 0, 0)
    for j in range(rows):
        run = np.where(covered[j], run + 1, 0)
        stack: list[tuple[int, int]] = []
        for i, height in enumerate([*run.tolist(), 0]):
            start = i
            while stack and stack[-1][1] >= height:
                start, tall = stack.pop()
                area = (i - 1 - start) * (tall - 1)
                if area > best:
                    best, block = area, (start, i - 1, j - tall + 1, j)
            stack.append((start, height))
    return block


def locate(flat: Floats, faces: Ints, points: Floats) -> tuple[Ints, Floats]:
    """The triangle (n,) of the layout around each of ``points`` (n, 2), or -1, and the barycentric
    coordinates (n, 3) in the triangle.

    Each triangle is compared with the points in its bounding box, which are sorted by x.
    """
    corners = flat[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(points[:, 0])
    sorted_x = points[order, 0]
    margin = 1e-12 * (high - low).max()
    first = np.searchsorted(sorted_x, low[:, 0] - margin)
    last = np.searchsorted(sorted_x, high[:, 0] + margin, side="right")
    holder = np.full(len(points), -1, dtype=np.int64)
    coordinates = np.zeros((len(points), 3))
    for start in range(0, len(faces), 4096):
        block = np.arange(start, min(start + 4096, len(faces)))
        counts = last[block] - first[block]
        triangle = np.repeat(block, counts)
        if not len(triangle):
            continue
        point = order[first[triangle] + places_in_runs(counts)]
        y = points[point, 1]
        close = (y >= low[triangle, 1] - margin) & (y <= high[triangle, 1] + margin)
        triangle, point = triangle[close], point[close]
        weights = _barycentric(corners[triangle], points[point])
        inside = weights.min(axis=1) >= -1e-9
        holder[point[inside]] = triangle[inside]
        coordinates[point[inside]] = weights[inside]
    return holder, coordinates


def _barycentric(corners: Floats, points: Floats) -> Floats:
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        s = (ap[:, 0] * ac[:, 1] - ap[:, 1] * ac[:, 0]) / det
        t = (ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]) / det
    return np.stack([1 - s - t, s, t], axis=1)
