"""Plates: closed solids that are a sheet with a thickness, and the sheet in them.

From the middle of each triangle a ray goes inwards along the normal. Its length t to the first
triangle is the thickness there, if that triangle faces back (the normals are within 60 degrees of
opposite). With T the median of t, weighted by area, the skin is where t < 2.2 T. Its connected
parts over edges bent by less than 40 degrees are the skins; a plate has two large ones that face
each other.

The limits below were set on saddles, waves and domes of 2 to 20 % thickness, wedges of 0.3 to 1.7
times the mean thickness, rounded rims and noise (accepted), and on a block half as thick as wide,
animals, heads and machine parts (refused).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.connected import components
from miurafab.geometry.nearest import tree_of
from miurafab.geometry.rays import first_hits
from miurafab.surfaces.topology import classify, neighbours, one_sheet, used_alone

Side = Literal["outer", "inner", "middle"]

THICK = 2.2
"""The skin is where the thickness is less than this many times the median."""
FACING_BACK = 0.5
BEND = math.cos(math.radians(40))

LEAST_SKIN = 0.35
"""Each skin holds this part of the area at least."""
LEAST_FACING = 0.95
"""This part of each skin looks at the other."""
LEAST_RATIO = 0.8
"""The smaller skin has this part of the area of the larger at least."""

RAYS = 20_000
"""Of more triangles, evenly chosen ones send a ray, and the others take the nearest answer."""


@dataclass(frozen=True, eq=False)
class Plate:
    """A closed mesh judged as a plate; ``why_not`` is empty if it is one.

    ``outer`` and ``inner`` are the indices of the triangles of the two skins, ``through`` (F,) the
    thickness at each triangle, ``thickness`` its median.
    """

    outer: Ints
    inner: Ints
    through: Floats
    thickness: float
    why_not: str

    def sheet(self, vertices: Floats, faces: Ints, side: Side, name: str) -> tuple[Floats, Ints]:
        """The chosen ``side`` as a mesh; the middle is the outer skin moved in by half of t."""
        triangles = self.inner if side == "inner" else self.outer
        if side == "middle":
            half = _at_vertices(len(vertices), faces[triangles], self.through[triangles]) / 2
            vertices = vertices - half[:, None] * _vertex_normals(vertices, faces[triangles])
        points, skin = used_alone(vertices, faces[triangles])
        return one_sheet(points, skin, name)


def judge_plate(vertices: Floats, faces: Ints) -> Plate:
    """Whether the closed mesh ``vertices`` (V, 3), ``faces`` (F, 3) is a plate.

    The triangles face outwards.
    """
    cross = _cross(vertices, faces)
    area = np.linalg.norm(cross, axis=1) / 2
    normal = cross / (2 * area[:, None])
    through, hit = _thickness(vertices, faces, normal)
    back = np.where(hit >= 0, -np.einsum("fk,fk->f", normal, normal[hit]), -1.0)
    ok = back > FACING_BACK
    if not ok.any():
        return Plate(hit[:0], hit[:0], through, math.inf, "no side of it faces another")
    thickness = _weighted_median(through[ok], area[ok])
    skin = ok & (through < THICK * thickness)
    first, second = neighbours(faces)
    smooth = np.einsum("fk,fk->f", normal[first], normal[second]) > BEND
    first, second = first[smooth], second[smooth]
    outer, inner = _two_largest(skin, first, second, area)
    why_not = _why_not(outer, inner, hit, area)
    if not why_not and any(_handles(vertices, faces[side]) for side in (outer, inner)):
        why_not = "its skin has a handle"
    return Plate(outer, inner, through, thickness, why_not)


def _why_not(outer: Ints, inner: Ints, hit: Ints, area: Floats) -> str:
    """Which limit the skins miss, as the rest of a sentence with the figures; empty for none."""
    large, small, whole = (float(area[part].sum()) for part in (outer, inner, slice(None)))
    if min(large, small) < LEAST_SKIN * whole:
        return (
            f"its two skins hold {100 * large / whole:.0f} and {100 * small / whole:.0f} % of the "
            f"area, and {100 * LEAST_SKIN:.0f} % each are needed"
        )
    facing = min(
        float(area[a][np.isin(hit[a], b)].sum() / area[a].sum())
        for a, b in ((outer, inner), (inner, outer))
    )
    if facing < LEAST_FACING:
        return (
            f"{100 * facing:.0f} % of its skins face each other, and {100 * LEAST_FACING:.0f} % "
            "are needed"
        )
    if small < LEAST_RATIO * large:
        return (
            f"one skin has {small / large:.2g} times the area of the other, and {LEAST_RATIO:g} is "
            "needed"
        )
    return ""


def _thickness(vertices: Floats, faces: Ints, normal: Floats) -> tuple[Floats, Ints]:
    """(F,) the way inwards from each triangle to the next, and that triangle, -1 for none."""
    corners = vertices[faces]
    middle = corners.mean(axis=1)
    size = float(np.ptp(vertices, axis=0).max())
    chosen = np.unique(np.linspace(0, len(faces) - 1, min(len(faces), RAYS)).round().astype(int))
    lift = 1e-6 * size
    t, hit = first_hits(middle[chosen] - lift * normal[chosen], -normal[chosen], corners)
    t = t + lift
    if len(chosen) == len(faces):
        return t, hit
    # near in place and in direction: the other side of a thin plate is far in direction
    key = np.concatenate([middle, size * normal], axis=1)
    nearest = tree_of(key[chosen]).query(key)[1]
    return t[nearest], hit[nearest]


def _two_largest(skin: Bools, first: Ints, second: Ints, area: Floats) -> tuple[Ints, Ints]:
    """The triangles of the two largest connected parts of ``skin``, the larger first."""
    joined = skin[first] & skin[second]
    label = components(len(skin), first[joined], second[joined])
    sums = np.bincount(label[skin], area[skin], minlength=int(label.max()) + 1)
    # areas that are equal to a thousandth are in the order of their first triangle
    best = np.argsort(-sums, kind="stable")[:2].tolist()
    if len(best) < 2:
        return np.flatnonzero(skin), np.zeros(0, dtype=np.int64)
    if sums[best[1]] > 0.999 * sums[best[0]]:
        best.sort()
    return np.flatnonzero(skin & (label == best[0])), np.flatnonzero(skin & (label == best[1]))


def _handles(vertices: Floats, faces: Ints) -> int:
    points, skin = one_sheet(*used_alone(vertices, faces), "the skin")
    return classify(points, skin).handles


def _weighted_median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def _cross(vertices: Floats, faces: Ints) -> Floats:
    """(F, 3) the normals of the triangles, as long as twice their areas."""
    p = vertices[faces]
    return np.asarray(vector_product(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))


def _at_vertices(count: int, faces: Ints, values: Floats) -> Floats:
    """(V,) the mean of ``values`` (F,) over the triangles around each vertex."""
    uses = np.bincount(faces.ravel(), minlength=count)
    sums = np.bincount(faces.ravel(), np.repeat(values, 3), minlength=count)
    return np.asarray(sums / np.maximum(uses, 1))


def _vertex_normals(vertices: Floats, faces: Ints) -> Floats:
    cross = np.repeat(_cross(vertices, faces), 3, axis=0)
    sums = np.stack(
        [np.bincount(faces.ravel(), cross[:, k], minlength=len(vertices)) for k in range(3)], axis=1
    )
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.asarray(sums / np.where(length > 0, length, 1.0))
