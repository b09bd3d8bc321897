"""What a tube's map tells before any fit: whether it can carry a sheet, and in how many gores.

A sheet follows a map whose parameter lines are near to a rectangular net. The figures say by how
much they are not: how far the girth varies at one level (``across``) and the speed of the meridians
anywhere (``along``), how oblique the lines are (``shear``), and how much the levels bend in and out
(``turn``: the integral of the absolute normal curvature along a level, 2 pi where it is convex).

A column of a seam resets the slide of the corrugation (:mod:`~miurafab.origami.fitting.seed`), so a
gore must bear only its own share of the turn. With T(u) the integral of the normal curvature, the
slide psi asked at u is

    tan psi = lambda^2 / (lambda^2 - 1) (T(u) - T(middle of the gore)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.surfaces.surface import TargetSurface, curvature_along_u, tangents

STRETCH = 1.3
"""lambda, the stretch of the paper over the surface, of the corrugation on narrow gores."""

GENTLE = math.radians(62)
"""The number of gores is the least whose slide is at most this."""

STEEP = math.radians(68)
"""Above this slide most sheets cross themselves (outline-and-gores.md, section 0)."""

MOST_GORES = 12

_AROUND, _ALONG = 72, 36


LIMITS = {
    "across": 5.0,
    "along": 7.0,
    "shear": math.radians(15),
    "turn": 7.0,
    "rough": 0.01,
    "turned_over": 0.5,
    "slide": STEEP,
}
"""The largest figures that serve, from pins, bent bodies, heads, and bodies with limbs
(outline-and-gores.md, section B)."""


@dataclass(frozen=True)
class TubeFigures:
    """The figures of a tube's map. ``shear`` and ``slide`` in radians; ``rough`` is the distance of
    the mesh from the surface over the size, ``turned_over`` a number of triangles. ``slide`` is
    that of ``gores`` gores with the first seam at ``start``, a part of a gore.
    """

    rough: float
    across: float
    along: float
    shear: float
    turn: float
    turned_over: int
    gores: int
    start: float
    slide: float

    @property
    def rank(self) -> tuple[int, float]:
        """The order of maps that serve: fewer gores, then the gentler slide."""
        return self.gores, self.slide

    @property
    def worst(self) -> str:
        """The figure that is farthest over its limit, or nearest to it."""
        return max(LIMITS, key=lambda name: float(getattr(self, name)) / LIMITS[name])

    @property
    def trouble(self) -> float:
        """The worst figure over its limit: at most 1 where the map serves."""
        return float(getattr(self, self.worst)) / LIMITS[self.worst]


def figures(
    surface: TargetSurface, rough: float, turned_over: int, pieces: int | None = None
) -> TubeFigures:
    """The figures of a surface that closes on itself in u, with ``pieces`` gores or the fewest."""
    d = surface.domain
    u = d.u0 + d.width * np.arange(_AROUND) / _AROUND
    v = d.v0 + d.height * (np.arange(_ALONG) + 0.5) / _ALONG
    uv = np.stack(np.meshgrid(u, v), axis=-1)
    around, along = tangents(surface, uv)
    girth, speed = np.linalg.norm(around, axis=-1), np.linalg.norm(along, axis=-1)
    oblique = np.abs(np.einsum("...k,...k->...", around, along)) / (girth * speed)
    bent = curvature_along_u(surface, uv) * girth
    turned = np.cumsum(bent * d.width / _AROUND, axis=1)
    turned = np.concatenate([np.zeros((len(turned), 1)), turned], axis=1)
    gores, start, slide = _fewest(turned) if pieces is None else _gores(turned, pieces)
    return TubeFigures(
        rough,
        float((girth.max(axis=1) / girth.min(axis=1)).max()),
        float(speed.max() / speed.min()),
        float(np.arcsin(np.quantile(oblique, 0.98))),
        float((np.abs(bent).mean(axis=1) * d.width).max()),
        turned_over,
        gores,
        start,
        slide,
    )


def _fewest(turned: Floats) -> tuple[int, float, float]:
    """The fewest gores with a gentle slide, or else those of the least: number, start and slide."""
    tried = []
    for pieces in range(2, MOST_GORES + 1):
        tried.append(_gores(turned, pieces))
        if tried[-1][2] <= GENTLE:
            return tried[-1]
    return min(tried, key=lambda one: one[2])


def _gores(turned: Floats, pieces: int) -> tuple[int, float, float]:
    """``pieces``, the place of the first seam for the least slide, a part of a gore, and the slide.

    ``turned`` (levels, n + 1) is T(u) at even steps round each level. The places tried are eighths.
    """
    cells = turned.shape[1] - 1
    # T at sixteenths of a gore, over two turns
    parts = 16
    at = np.arange(2 * pieces * parts) * (cells / (pieces * parts))
    low = np.floor(at).astype(np.int64)
    t = at - low
    place, rounds = low % cells, low // cells
    total = turned[:, place] * (1 - t) + turned[:, place + 1] * t
    total += np.outer(turned[:, -1], rounds)
    start = np.arange(0, parts, 2)[:, None] + parts * np.arange(pieces)
    gores = total[:, start[..., None] + np.arange(parts + 1)]
    ramp = STRETCH**2 / (STRETCH**2 - 1) * (gores - gores[..., [parts // 2]])
    slide = np.arctan(np.abs(ramp).max(axis=(0, 2, 3)))
    best = int(np.argmin(slide))
    return pieces, best / len(slide), float(slide[best])
