"""Pictures of a pattern as SVG text: flat with its creases, and folded, seen from one side.

A folded form is drawn by the painter's algorithm: its facets in parallel projection, those whose
middle lies farthest first, shaded by two lights. :func:`project` computes that view for every
drawing of a folded form in the house.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.polygons import facet_normals, filled
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.seam_lines import SEAM_WORDS, SeamLine, seam_lines

AZIMUTH, ELEVATION = math.radians(-55), math.radians(30)
"""From where a folded form is seen: over its front right corner."""
FRONT, BACK = np.array([242.0, 230.0, 207.0]), np.array([157.0, 181.0, 161.0])
"""Colours of the two sides of the paper, 0 to 255."""
INK = "#1d2329"
CREASES = {"M": "#c8372d", "V": "#2a5fb0", "F": "#9aa4af", "U": "#9aa4af", "B": INK, "C": INK}
CREASES["J"] = CREASES["F"]
DASHES = {"M": (5.0, 1.5, 0.8, 1.5), "V": (2.5, 1.5), "F": (0.8, 1.5), "U": (0.8, 1.5)}
DASHES["J"] = DASHES["F"]
"""Mountains dash-dot and valleys dashed, as is usual in origami, in parts of the unit of the
picture. Colour is never the only difference."""

_KEY, _FILL = np.array([-0.45, 0.6, 0.66]), np.array([0.7, -0.15, 0.5])
_MARGIN, _ASIDE = 8.0, math.radians(25)
_DISK = 7.0
"""The radius of the disk around the number of a seam line."""
MOST_FACETS = 6000
"""A pattern of more facets has no picture in a notebook: it would be megabytes of grey."""


@dataclass(frozen=True, eq=False)
class View:
    """Facets as a viewer far away sees them.

    Parameters
    ----------
    places : (V, 2) float64
        The vertices on the screen: to the right and up, in the unit of the points.
    order : (F,) int64
        The facets from the farthest to the nearest.
    front : (F,) bool
        Whether the front of the facet is seen.
    shade : (F,) float64
        How light the facet is, from about 0.5 to 1.1.
    key : (F,) float64
        The part of the main light alone, 0 to 1.
    """

    places: Floats
    order: Ints
    front: Bools
    shade: Floats
    key: Floats


def axes(azimuth: float = AZIMUTH, elevation: float = ELEVATION) -> Floats:
    """(3, 3) rows: the screen's right, its up, and the direction to the viewer. z is up."""
    ca, sa = math.cos(azimuth), math.sin(azimuth)
    ce, se = math.cos(elevation), math.sin(elevation)
    return np.array([[-sa, ca, 0.0], [-ca * se, -sa * se, ce], [ca * ce, sa * ce, se]])


def project(
    points: Floats,
    faces: Ints,
    azimuth: float = AZIMUTH,
    elevation: float = ELEVATION,
) -> View:
    """``points`` (V, 3) and ``faces`` (F, k), filled with -1, seen from a direction in radians."""
    screen = axes(azimuth, elevation)
    seen = points @ screen.T
    corners = seen[filled(faces)]
    normal = np.nan_to_num(facet_normals(seen, faces))
    front = normal[:, 2] > 0
    facing = np.where(front[:, None], normal, -normal)
    key = np.maximum(facing @ (_KEY / np.linalg.norm(_KEY)), 0.0)
    fill = np.maximum(facing @ (_FILL / np.linalg.norm(_FILL)), 0.0)
    order = np.argsort(corners[:, :, 2].mean(axis=1), kind="stable")
    return View(seen[:, :2], order, front, 0.5 + 0.42 * key + 0.14 * fill, key)


def fills(view: View) -> NDArray[np.uint8]:
    """(F, 3) colours of the facets, by side and shade."""
    base = np.where(view.front[:, None], FRONT, BACK)
    return np.clip(base * view.shade[:, None], 0, 255).astype(np.uint8)


def flat_svg(pattern: CreasePattern, width: float) -> str:
    """The flat pattern, mountains red and dash-dotted, valleys blue and dashed, and seams with
    numbers.
    """
    height, lines = _flat(pattern, width)
    return _svg(width, height, lines)


def pattern_svg(pattern: CreasePattern, width: float = 640.0) -> str:
    """The flat pattern, and beside it the folded form where the pattern has one."""
    if pattern.folded_coords is None:
        return flat_svg(pattern, width / 2)
    flat_height, lines = _flat(pattern, width / 2)
    folded_height, polygons = _folded(pattern, width / 2)
    height = max(flat_height, folded_height)
    return _svg(
        width,
        height,
        [
            f'<g transform="translate(0 {(height - flat_height) / 2:.1f})">',
            *lines,
            f'</g><g transform="translate({width / 2:g} {(height - folded_height) / 2:.1f})">',
            *polygons,
            "</g>",
        ],
    )


def _flat(pattern: CreasePattern, width: float) -> tuple[float, list[str]]:
    """The height of the picture of the flat pattern, and its parts."""
    lines = seam_lines(pattern)
    marks = [line.places for line in lines]
    points, height = _placed(np.concatenate([pattern.vertices_coords, *marks]), width)
    parts = _creases(pattern, points, lines)
    marks = np.split(points[len(pattern.vertices_coords) :], len(lines)) if lines else []
    for line, places in zip(lines, marks, strict=True):
        parts += [_numbered(line, x, y) for x, y in places.tolist()]
    if lines:
        parts.append(
            f'<text x="{_MARGIN:g}" y="{height + _DISK:.1f}" font-family="sans-serif" '
            f'font-size="11" fill="{INK}">{SEAM_WORDS}</text>'
        )
        height += 2 * _DISK + _MARGIN / 2
    return height, parts


def _svg(width: float, height: float, parts: Iterable[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:.0f}" '
        f'viewBox="0 0 {width:g} {height:.1f}"><rect width="100%" height="100%" fill="#fff"/>'
        f"{''.join(parts)}</svg>"
    )


def _placed(points: Floats, width: float) -> tuple[Floats, float]:
    """``points`` (n, 2) in a picture of ``width``, y downwards, and the height of the picture. A
    shape taller than wide fills a square.
    """
    low, size = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1e-12)
    room = width - 2 * _MARGIN
    scale = room / max(size)
    left = _MARGIN + (room - scale * size[0]) / 2
    x = left + (points[:, 0] - low[0]) * scale
    y = _MARGIN + (low[1] + size[1] - points[:, 1]) * scale
    return np.stack([x, y], axis=1), float(scale * size[1] + 2 * _MARGIN)


def _creases(pattern: CreasePattern, points: Floats, lines: tuple[SeamLine, ...]) -> list[str]:
    """One path for each kind of edge and for each seam line."""
    lengths = np.linalg.norm(np.diff(points[pattern.edges_vertices], axis=1)[:, 0], axis=1)
    unit = float(np.clip(np.median(lengths) / 10, 0.4, 1.2))
    parts = []
    seam = np.zeros(len(pattern.edges_vertices), dtype=bool)
    for line in lines:
        seam[line.edges] = True
    for letter, colour in CREASES.items():
        chosen = pattern.edges_vertices[(pattern.edges_assignment == letter) & ~seam]
        if not len(chosen):
            continue
        data = _path(points, chosen)
        dashes = " ".join(f"{unit * part:.2f}" for part in DASHES.get(letter, ()))
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        parts.append(
            f'<path d="{data}" fill="none" stroke="{colour}" stroke-width="{0.7 * unit:.2f}"'
            f"{dashed}/>"
        )
    for line in lines:
        data = _path(points, pattern.edges_vertices[line.edges.ravel()])
        parts.append(
            f'<path d="{data}" fill="none" stroke="{line.colour}" stroke-width="{1.6 * unit:.2f}"/>'
        )
    return parts


def _path(points: Floats, ends: Ints) -> str:
    """The data of a path along each of ``ends`` (n, 2)."""
    corners = points[ends].reshape(-1, 4).tolist()
    return "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for a, b, c, d in corners)


def _numbered(line: SeamLine, x: float, y: float) -> str:
    """The number of a seam line in a disk of its colour."""
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{_DISK:g}" fill="{line.colour}" stroke="#fff"/>'
        f'<text x="{x:.1f}" y="{y + 0.38 * _DISK:.1f}" font-family="sans-serif" font-weight="bold" '
        f'font-size="{1.15 * _DISK:.1f}" text-anchor="middle" fill="#fff">{line.number}</text>'
    )


def azimuth_of(points: Floats, faces: Ints) -> float:
    """The azimuth from which an upright sheet shows its front, a little from the side."""
    corners = points[np.where(faces >= 0, faces, faces[:, :1])]
    spokes = corners - corners[:, :1]
    x, y, z = vector_product(spokes, np.roll(spokes, -1, axis=1)).sum(axis=(0, 1)).tolist()
    return math.atan2(y, x) - _ASIDE if math.hypot(x, y) > abs(z) else AZIMUTH


def _folded(pattern: CreasePattern, width: float) -> tuple[float, list[str]]:
    """The height of the picture and its polygons, from the farthest to the nearest."""
    assert pattern.folded_coords is not None
    azimuth = azimuth_of(pattern.folded_coords, pattern.faces_vertices)
    view = project(pattern.folded_coords, pattern.faces_vertices, azimuth)
    points, height = _placed(view.places, width)
    texts = np.array([f"{x:.1f},{y:.1f}" for x, y in points.tolist()])
    colours = fills(view)
    polygons = ['<g stroke-width="0.4" stroke-linejoin="round">']
    for face in view.order.tolist():
        corners = pattern.faces_vertices[face]
        fill = bytes(colours[face]).hex()
        line = bytes((colours[face] * 0.72).astype(np.uint8)).hex()
        polygons.append(
            f'<polygon points="{" ".join(texts[corners[corners >= 0]])}" fill="#{fill}" '
            f'stroke="#{line}"/>'
        )
    return height, [*polygons, "</g>"]
