"""Seams without glue: a tab with a head goes through a slot in the facet of its mate.

The joint is the arrow lock of cartons: a tongue whose head is wider than the slit that it is put
through (US patents 2,760,710 of 1956, which calls it common, and 6,502,743). As in the mock-up of
issue 95 of Export-Paper-Model-from-Blender the tab is a hexagon. In the frame of the side that it
is joined to, x along the seam edge and y into the facet, it is

    b wide at y = 0 (its base, and fold),   B at y = m (its shoulders),   0.6 B at y = h (its tip),

and its flanks are straight. The slot is parallel to the edge. It begins at y = s, and the strip of
facet in front of it holds the tab. The tab comes over the front of this strip, goes through the
slot, and its head lies behind the facet. With the width w of the slot, the play p at each end and
the overhang o of each shoulder,

    m = s + w + 0.55 (h - s - w),    length of the slot = W(s + w) + 2 p,    B = length + 2 o,

where W is the width of the tab. Since W grows with y, a pull on the seam stops after p (m / k),
k = (B - b) / 2. So b = B - 2 (o + p) m / (m - s - w). Tab and slot must fit the widths that the
region of a tab (:mod:`~miurafab.fabrication.tabs`) has at y = 0, s, s + w, m and h. These bounds
are linear in B and the place of the tab along its edge, and the largest B is taken. The region
keeps :data:`CLEAR_MM` to the other sides of the facet, and tabs that share a facet keep twice as
much. So no slot meets a crease, its dashes, a relief hole or another slot.

How it gets in: a sheet of thickness t that passes a slot in a sheet of thickness t at the angle a
to it needs the width t (1 + cos a) / sin a = t cot(a / 2). The two facets of a seam of fold angle r
leave a wedge of 180 degrees - r, so a is this wedge, and at most a right angle, and w is
t cot(a / 2) + :data:`LOOSE_MM`. The head is wider than the slot and is curled to go through: an arc
of length B and radius R has a chord of B - B^3 / (24 R^2), which must be the length of the slot; R
is at least ten thicknesses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.kerf import SHORTEST_MM
from miurafab.fabrication.seams import Seams, seam_angles
from miurafab.fabrication.tabs import (
    MIN_BASE_MM,
    SLENDER,
    TabRegions,
    in_mate,
    in_plane,
    inset_of,
    tab_regions,
)
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

CLEAR_MM = 1.0
"""The least distance of a slot from the other sides of its facet (judged: a bridge of 1 mm stays
whole beside a kerf of 0.2 mm)."""

STRIP_MM = 1.5
STRIP = 5.0
"""The width of the strip between seam and slot: at least the first, and the second times the
thickness (judged)."""

LOOSE_MM = 0.1
"""A slot is so much wider than it must be, and :data:`PLAY_MM` longer at each end: of 0.1 to 0.2 mm
that are usual for cut slots in all (ftcwiki.org, Slots and Tabs)."""
PLAY_MM = 0.1

OVERHANGS_MM = (0.5, 0.35, 0.25)
"""How far each shoulder may stand over the end of its slot; the first that can be put through is
taken (judged)."""

CURL = 10.0
"""The least radius to which a head is curled, over its thickness; a closer curl creases the card
(judged)."""

SHOULDER, TIP = 0.55, 0.6
"""Where the shoulders are between slot and tip, and the width of the tip over that of the
shoulders (judged)."""

HEAD_MM = 2.5
"""The least length of a head behind its slot (judged)."""

BROAD_MM = 15.0
"""No head is broader, for the strip in front of a longer slot bulges (judged)."""

WEDGE = math.radians(30)
"""Facets that leave less room between them do not let a tab in (judged)."""

THIN_MM = 0.2
"""A thinner sheet is too limp: its heads buckle and its slots tear (judged; 0.2 mm is a card of
about 160 g/m2)."""


@dataclass(frozen=True, eq=False)
class Slots:
    """S slots. ``tab`` (S,) is the number of the tab that goes through each, ``corners`` (S, 4, 2)
    its opening in the plane of the pattern, in the facet that the tab is joined to, and ``depth``
    (S,) the part of the tab in front of the head, over the height of its shoulders.
    """

    tab: Ints
    corners: Floats
    depth: Floats


@dataclass(frozen=True)
class TabSlot:
    """The slot of a patch for the tab of number ``tab`` and this ``label``, of ``mate_patch``. It
    lies at the pattern edge ``edge``; ``polygon_mm`` (4, 2) is its opening in the patch frame.
    """

    tab: int
    label: str
    edge: int
    mate_patch: int
    polygon_mm: Floats


def require_slots(material: Material) -> None:
    """Raise :class:`~miurafab.errors.LayoutError` for a material that tabs in slots do not hold."""
    if material.thickness_mm < THIN_MM:
        raise LayoutError(
            f"{material.name} is {material.thickness_mm:g} mm thick, too limp for tabs in slots: "
            f"their heads buckle and the slots tear. Take a sheet of {THIN_MM:g} mm or more, such "
            "as card or polypropylene, or `join` glue."
        )


def slot_strip(material: Material) -> float:
    """The width in mm of the strip between a seam and its slots."""
    return max(STRIP_MM, STRIP * material.thickness_mm)


def slot_widths(angles: Floats, material: Material) -> Floats:
    """(N,) the widths in mm of slots at seams of fold ``angles`` (N,) in radians; infinite where
    the facets leave no room to put a tab in.
    """
    wedge = np.minimum(math.pi - np.abs(angles), math.pi / 2)
    half = np.maximum(wedge, WEDGE) / 2
    width = material.thickness_mm / np.tan(half) + LOOSE_MM
    return np.where(wedge >= WEDGE - 1e-9, width, np.inf)


def slotted_tabs(
    pattern: CreasePattern,
    seams: Seams,
    material: Material,
    bearing: Bools,
    tight: Bools,
    ticks_mm: float,
) -> TabRegions:
    """The tabs with heads on N ``seams``, without corners where there is no room for one.

    ``bearing`` (F, k) is that of :func:`~miurafab.fabrication.tabs.tab_regions`. ``tight`` (N,)
    tabs stay inside of tabs for glue. Slots keep clear of ticks of this length.
    """
    rule = material.tabs
    clear = max(CLEAR_MM, inset_of(material), ticks_mm / 2 + CLEAR_MM / 2)

    def regions(largest: float) -> tuple[Floats, Ints]:
        own = replace(material, tabs=replace(rule, inset_mm=clear, max_angle=largest))
        found = tab_regions(pattern, seams, own, bearing)
        return in_mate(pattern, found), found.count

    wide, narrow = (regions(angle) for angle in (max(rule.max_angle, math.pi / 2), rule.max_angle))
    width = slot_widths(seam_angles(pattern, seams), material)
    near = slot_strip(material)
    far = near + np.where(np.isfinite(width), width, 0.0)
    shapes = np.zeros((len(seams), 6, 2))
    found = np.zeros(len(seams), dtype=bool)
    least = far + HEAD_MM
    heights = [np.full(len(seams), rule.height_mm), (rule.height_mm + least) / 2, least]
    for overhang in OVERHANGS_MM:
        for height in heights:
            tried = [
                _fitted(points, count, near, far, height, overhang, material)
                for points, count in (wide, narrow)
            ]
            shape = np.where(tight[:, None, None], tried[1][0], tried[0][0])
            fits = np.where(tight, tried[1][1], tried[0][1]) & ~found & np.isfinite(width)
            fits &= height <= rule.height_mm + 1e-9
            shapes[fits] = shape[fits]
            found |= fits
    return in_plane(pattern, seams, shapes, np.where(found, 6, 0))


def _fitted(
    points: Floats,
    count: Ints,
    near: float,
    far: Floats,
    height: Floats,
    overhang: float,
    material: Material,
) -> tuple[Floats, Bools]:
    """The largest hexagons (N, 6, 2) of this ``height`` (N,) in the regions ``points`` (N, m, 2),
    for slots from y = ``near`` to y = ``far`` (N,), and whether each is a tab.
    """
    shoulder = far + SHOULDER * (height - far)
    narrower = 2 * (overhang + PLAY_MM) * shoulder / np.maximum(shoulder - far, 1e-9)
    low_edge = np.full(len(far), near)
    # The half widths at these heights are (part B - less) / 2.
    rows = (
        (np.zeros_like(far), 1.0, narrower),
        (shoulder, 1.0, 0.0),
        (height, TIP, 0.0),
        (low_edge, 1.0, 2 * overhang),
        (far, 1.0, 2 * overhang),
    )
    chords = [_chord(points, count, y) for y, _, _ in rows]
    broad = np.full(len(far), BROAD_MM)
    for (low, _), (_, part, less) in zip(chords, rows, strict=True):
        for (_, high), (_, other, fewer) in zip(chords, rows, strict=True):
            room = np.where(np.isfinite(high - low), high - low, -np.inf)
            broad = np.minimum(broad, (2 * room + less + fewer) / (part + other))
    broad = np.where(np.isfinite(broad), broad, 0.0)
    halves = [(part * broad - less) / 2 for _, part, less in rows]
    ends = [(low + half, high - half) for (low, high), half in zip(chords, halves, strict=True)]
    first, last = np.max([e[0] for e in ends], axis=0), np.min([e[1] for e in ends], axis=0)
    base = 2 * halves[0]
    radius = CURL * material.thickness_mm
    fits = (base >= MIN_BASE_MM) & (height <= SLENDER * base) & (last >= first - 1e-9)
    fits &= broad**3 >= 48 * overhang * radius**2
    low, high = (np.where(fits, end, 0.0) for end in chords[0])
    centre = np.where(fits, np.clip((low + high) / 2, first, last), 0.0)
    x = np.stack([-halves[0], halves[0], halves[1], halves[2], -halves[2], -halves[1]], axis=1)
    y = np.stack([rows[0][0], rows[0][0], shoulder, height, height, shoulder], axis=1)
    return np.stack([centre[:, None] + x, y], axis=2), fits


def _chord(points: Floats, count: Ints, y: Floats) -> tuple[Floats, Floats]:
    """(N,) the ends of the convex polygons ``points`` (N, m, 2) at the heights ``y`` (N,);
    infinite, and in reverse, where there is nothing.
    """
    slot = np.arange(points.shape[1])
    following = np.where(slot + 1 < count[:, None], slot + 1, 0)
    ahead = np.take_along_axis(points, following[..., None], axis=1)
    low, high = points[..., 1] - y[:, None], ahead[..., 1] - y[:, None]
    crossed = (slot < count[:, None]) & (low * high <= 0) & (low != high)
    part = np.divide(low, low - high, out=np.zeros_like(low), where=crossed)
    x = points[..., 0] + part * (ahead[..., 0] - points[..., 0])
    return (
        np.where(crossed, x, np.inf).min(axis=1, initial=np.inf),
        np.where(crossed, x, -np.inf).max(axis=1, initial=-np.inf),
    )


def slots_of(pattern: CreasePattern, tabs: TabRegions, material: Material) -> Slots:
    """The slots that ``tabs`` with heads go through; tabs on open borders have none.

    Everything follows from the six corners of a tab, the fold angle of its seam and the material.
    """
    tab = np.flatnonzero(tabs.mate_face >= 0)
    own = tabs.take(tab)
    points = in_mate(pattern, own)[:, :6]
    near = slot_strip(material)
    far = near + slot_widths(seam_angles(pattern, own.seams), material)
    base, shoulder = points[:, 1] - points[:, 0], points[:, 2] - points[:, 5]
    middle = (points[:, 0, 0] + points[:, 1, 0]) / 2
    height = points[:, 2, 1]
    depth = far / np.where(height > 0, height, np.nan)
    half = (base[:, 0] + (shoulder[:, 0] - base[:, 0]) * depth) / 2 + PLAY_MM
    x = np.stack([middle - half, middle + half, middle + half, middle - half], axis=1)
    y = np.stack([np.full(len(tab), near), np.full(len(tab), near), far, far], axis=1)
    seams = own.seams
    mates = Seams(seams.edges[:, [1, 1]], seams.faces[:, [1, 1]], seams.fold)
    corners = in_plane(pattern, mates, np.stack([x, y], axis=2), np.full(len(tab), 4)).glued
    return Slots(tab, corners, depth)


def heads(tabs: TabRegions, slots: Slots) -> TabRegions:
    """``tabs``, those of ``slots`` without their part in front of the slot."""
    found = []
    for points in (tabs.points, tabs.glued):
        headed = points.copy()
        own = points[slots.tab]
        for corner, outer in ((0, 5), (1, 2)):
            step = own[:, outer] - own[:, corner]
            headed[slots.tab, corner] = own[:, corner] + slots.depth[:, None] * step
        found.append(headed)
    return TabRegions(tabs.seams, found[0], found[1], tabs.count)


def slot_strokes(slots: Slots, kerf: float) -> tuple[Floats, int]:
    """The points (S * n, 2) of the strokes of the slots, and n: closed rectangles, half a kerf
    inside; lines where a tool removes nothing, or nothing more than the slot.
    """
    corners = slots.corners
    along = corners[:, 1] - corners[:, 0]
    across = corners[:, 3] - corners[:, 0]
    length, width = (np.linalg.norm(each, axis=1)[:, None] for each in (along, across))
    along, across = along / length, across / width
    centre = corners.mean(axis=1)
    reach = along * (length - kerf) / 2
    if not len(corners) or kerf == 0.0 or float(width.min()) - kerf < SHORTEST_MM:
        return np.stack([centre - reach, centre + reach], axis=1).reshape(-1, 2), 2
    side = across * (width - kerf) / 2
    ring = [-reach - side, reach - side, reach + side, side - reach, -reach - side]
    return (centre[:, None] + np.stack(ring, axis=1)).reshape(-1, 2), 5
