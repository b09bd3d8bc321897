"""The places of engraved patch names and tab numbers: inside a facet, clear of creases and cuts.

A text of height s and width s·w, centred at c along direction u, lies inside a convex polygon with
the clearance to its sides if for each side, with inward normal n at distance d from c,

    s (w |n·u| + |n·v|) / 2 <= d - clearance,

where v is u turned by a right angle. So the largest s is the least of the quotients. A text that
would be too small to read is left out. In a facet that is not convex, such as a plate with notches,
the sides of its convex hull are moved inwards by the depth of the gaps between hull and facet.

The label of a tab is engraved on the tab, followed by M or V if its fold is a mountain or a valley,
and on the facet to which it is glued, at the place that the tab covers. A patch name is engraved
where no tab will be. If there is no room for label and M or V, this letter is left out first.

The front of a sheet is the show side. A tab goes behind the facet that it is glued to, so its own
front and the back of that facet are hidden once it is glued. What is engraved on the back runs the
other way, so that it reads from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from miurafab.fabrication.lettering import text_strokes, text_width
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.tabs import NO_LIMIT, TabRegions, clip_convex
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

CLEARANCE_MM = 0.5
"""The distance between a text and any crease or cut (judged: three kerfs)."""

NAME_MM = (1.5, 5.0)
"""Least and greatest height of a patch name in mm (judged)."""

LABEL_MM = (1.2, 3.0)
"""Least and greatest height of the label of a tab in mm (judged)."""


MARKED = ("M", "V")
"""The assignments of folds that are engraved after the label of a tab."""


@dataclass(frozen=True)
class Sides:
    """Whether the names of patches, the labels of tabs, and those on the facets over them are
    engraved on the front or the back; None: not at all.
    """

    names: str | None
    tabs: str | None
    facets: str | None


def sides_of(options: LayoutOptions) -> Sides:
    """The sides that ``options`` ask for."""
    if options.marks == "tabs":
        return Sides(None, "front", "back" if options.two_sided else None)
    side = None if options.marks == "none" else options.marks
    return Sides(side, side, side)


@dataclass(frozen=True, eq=False)
class PlacedText:
    """A ``text`` on a patch, in mm in the pattern's plane: centred on ``centre`` (2,), written
    along the unit vector ``along`` (2,), its capitals ``height`` mm high, 0 where it has no room.
    ``side`` is ``front`` or ``back``, or None if it is not engraved. A rim number stands ``beside``
    its patch, on the waste.
    """

    patch: int
    text: str
    centre: Floats
    along: Floats
    height: float
    side: str | None
    beside: bool = False

    @cached_property
    def strokes(self) -> tuple[Floats, ...]:
        """The strokes (n, 2) of its letters."""
        across = np.array([-self.along[1], self.along[0]]) * (-1.0 if self.side == "back" else 1.0)
        frame = self.height * np.stack([self.along, across])
        return tuple(self.centre + stroke @ frame for stroke in text_strokes(self.text))


@dataclass(frozen=True)
class AbsentLabel:
    """A text that is not engraved, for the guide: its place in the frame of its patch in mm, the
    direction in which it would run, and the height of its capitals, 0 where it has no room.
    """

    patch: int
    text: str
    x_mm: float
    y_mm: float
    rotation_deg: float
    height_mm: float


@dataclass(frozen=True, eq=False)
class Lettering:
    """The ``texts`` that are engraved, those that are ``absent`` from the sheets, the number
    ``left_out`` for lack of room, and the number of tabs ``unmarked``, without the letter of their
    fold. An absent text with the letter of a fold may stand on the sheet without it.
    """

    texts: list[PlacedText]
    absent: list[PlacedText]
    left_out: int
    unmarked: int


@dataclass(frozen=True, eq=False)
class _Spots:
    """N convex places for texts centred at ``centre`` (N, 2) along ``along`` (N, 2); the sides have
    inward ``normal`` (N, k, 2) at distance ``depth`` (N, k), less the clearance.
    """

    centre: Floats
    along: Floats
    normal: Floats
    depth: Floats

    def height(self, width: Floats) -> Floats:
        """(N,) the greatest height in mm of texts of ``width`` (N,) over height, negative: none."""
        along = np.abs(np.einsum("nki,ni->nk", self.normal, self.along))
        across = np.abs(
            self.normal[..., 1] * self.along[:, None, 0]
            - self.normal[..., 0] * self.along[:, None, 1]
        )
        taken = (width[:, None] * along + across) / 2
        return np.asarray((self.depth / np.maximum(taken, 1e-12)).min(axis=1))


def place_texts(
    pattern: CreasePattern,
    face_patch: Ints,
    names: Sequence[str],
    tabs: TabRegions,
    labels: Sequence[str],
    turns: Floats,
    sides: Sides,
) -> Lettering:
    """The texts of all patches.

    ``face_patch`` (F,) is the patch of each facet, ``names`` are the names of the P patches,
    ``labels`` (N) the labels of the ``tabs``, and ``turns`` (P,) the angles by which patches are
    turned later: texts are upright after that.
    """
    found, bare = _tab_labels(face_patch, tabs, labels, turns, sides)
    found += _patch_names(pattern, face_patch, names, tabs, turns, sides.names)
    return Lettering(
        texts=[text for text in found if text.side and text.height],
        absent=[text for text in found if not text.side or not text.height] + bare,
        left_out=sum(text.side is not None and not text.height for text in found),
        unmarked=len(bare),
    )


def _patch_names(
    pattern: CreasePattern,
    face_patch: Ints,
    names: Sequence[str],
    tabs: TabRegions,
    turns: Floats,
    side: str | None,
) -> list[PlacedText]:
    """The name of each patch on its roomiest facet."""
    spots = _facet_spots(pattern, tabs, turns[face_patch], side)
    width = np.array([text_width(name) for name in names])
    height = np.minimum(spots.height(width[face_patch]), NAME_MM[1])
    texts = []
    for patch, name in enumerate(names):
        faces = np.flatnonzero(face_patch == patch)
        far = np.linalg.norm(spots.centre[faces] - spots.centre[faces].mean(axis=0), axis=1)
        # Of places equal up to rounding the first is taken, so that rounding decides nothing.
        face = int(faces[np.lexsort((np.round(far, 3), -np.round(height[faces], 3)))[0]])
        size = float(height[face]) if height[face] >= NAME_MM[0] else 0.0
        texts.append(PlacedText(patch, name, spots.centre[face], spots.along[face], size, side))
    return texts


def _tab_labels(
    face_patch: Ints, tabs: TabRegions, labels: Sequence[str], turns: Floats, sides: Sides
) -> tuple[list[PlacedText], list[PlacedText]]:
    """The label of each tab on the tab and on the facet over it, and the whole labels of the tabs
    on which the letter of the fold has no room.
    """
    texts: list[PlacedText] = []
    bare: list[PlacedText] = []
    if not len(tabs):
        return texts, bare
    folds = tabs.seams.fold.tolist()
    marked = [w + f if f in MARKED else w for w, f in zip(labels, folds, strict=True)]
    glued = np.flatnonzero(tabs.mate_face >= 0)
    mates, under = tabs.take(glued), [labels[k] for k in glued.tolist()]
    for side, faces, points, present, whole, short in (
        (sides.tabs, tabs.own_face, tabs.points, tabs.present, marked, list(labels)),
        (sides.facets, mates.mate_face, mates.glued, mates.present, under, under),
    ):
        patch, base = face_patch[faces], points[:, 1] - points[:, 0]
        spots = _spots(points, present, _upright(base, turns[patch], side))
        room = spots.height(np.array([text_width(word) for word in whole]))
        without = spots.height(np.array([text_width(word) for word in short]))
        shorter = (room < LABEL_MM[0]) & (without >= LABEL_MM[0])
        height = np.minimum(np.where(shorter, without, room), LABEL_MM[1])
        height[height < LABEL_MM[0]] = 0.0
        for tab, size in enumerate(height.tolist()):
            word = short[tab] if shorter[tab] else whole[tab]
            place = spots.centre[tab], spots.along[tab]
            texts.append(PlacedText(int(patch[tab]), word, *place, size, side))
            if shorter[tab]:
                bare.append(replace(texts[-1], text=whole[tab], height=0.0))
    return texts, bare


def _facet_spots(
    pattern: CreasePattern, tabs: TabRegions, turns: Floats, side: str | None
) -> _Spots:
    """A place in each facet, along its longest side, outside of the tabs that cover it."""
    corners = pattern.faces_vertices
    points, count = _convex(pattern.vertices_coords[corners], (corners >= 0).sum(axis=1))
    ends = pattern.vertices_coords[pattern.edges_vertices[pattern.faces_edges]]
    step = ends[:, :, 1] - ends[:, :, 0]
    # Of sides equal up to rounding the first is taken, so that rounding decides nothing.
    length = np.where(corners >= 0, np.round(np.linalg.norm(step, axis=2), 6), -1.0)
    longest = step[np.arange(len(corners)), length.argmax(axis=1)]

    left = np.flatnonzero(tabs.mate_face >= 0)
    while len(left):
        # One tab of each facet at a time.
        faces, first = np.unique(tabs.mate_face[left], return_index=True)
        tab = left[first]
        base = tabs.glued[tab, 1] - tabs.glued[tab, 0]
        base /= np.linalg.norm(base, axis=1)[:, None]
        normal, limit = np.zeros((len(corners), 2)), np.full(len(corners), NO_LIMIT)
        normal[faces] = np.column_stack([-base[:, 1], base[:, 0]])
        depth = np.einsum("nki,ni->nk", tabs.glued[tab], normal[faces])
        limit[faces] = np.where(tabs.present[tab], depth, -np.inf).max(axis=1)
        points, count = clip_convex(points, count, normal, limit)
        left = np.delete(left, first)
    present = np.arange(points.shape[1]) < count[:, None]
    return _spots(points, present, _upright(longest, turns, side))


def _convex(points: Floats, count: Ints) -> tuple[Floats, Ints]:
    """The polygons ``points`` (F, k, 2) of ``count`` corners, counter-clockwise, with a convex part
    in place of each that is not convex.
    """
    points, count = points.copy(), count.copy()
    for facet, corners in enumerate(count.tolist()):
        outline = points[facet, :corners]
        side, after = np.roll(outline, -1, axis=0) - outline, np.arange(1, corners + 1) % corners
        turn = side[:, 0] * side[after, 1] - side[:, 1] * side[after, 0]
        if corners == 0 or turn.min() >= -1e-9 * np.abs(turn).max():
            continue
        from scipy.spatial import ConvexHull

        around = np.flatnonzero(np.isin(np.arange(corners), ConvexHull(outline).vertices))
        part = outline[around][None], np.array([len(around)])
        for start, end in zip(around, np.roll(around, -1), strict=True):
            along = outline[end] - outline[start]
            inward = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            between = np.arange(start, end if end > start else end + corners) % corners
            part = clip_convex(*part, inward[None], (outline[between] @ inward).max()[None])
        inner = part[0][0, : part[1][0]]
        step = np.linalg.norm(np.roll(inner, -1, axis=0) - inner, axis=1)
        inner = inner[step > 1e-9 * np.linalg.norm(side, axis=1).sum()]  # a side needs a direction
        more = max(len(inner) - points.shape[1], 0)  # each bay may leave two corners for one
        points = np.pad(points, ((0, 0), (0, more), (0, 0)))
        points[facet, : len(inner)], count[facet] = inner, len(inner)
    return points, count


def _spots(points: Floats, present: Bools, along: Floats) -> _Spots:
    count = np.maximum(present.sum(axis=1), 1)[:, None]
    slot = np.arange(points.shape[1])
    following = np.where(slot + 1 < count, slot + 1, 0)
    step = np.take_along_axis(points, following[..., None], axis=1) - points
    size = np.linalg.norm(step, axis=2)
    step /= np.where(size > 0, size, 1.0)[..., None]
    normal = np.stack([-step[..., 1], step[..., 0]], axis=-1)
    centre = np.where(present[..., None], points, 0.0).sum(axis=1) / count
    depth = np.einsum("nki,nki->nk", normal, centre[:, None] - points) - CLEARANCE_MM
    depth = np.where(present, depth, np.inf)
    # Nothing fits into an empty place.
    depth[~present.any(axis=1)] = -np.inf
    return _Spots(centre, along, normal, depth)


def _upright(along: Floats, turns: Floats, side: str | None) -> Floats:
    """The unit directions of ``along`` (N, 2), reversed if the text, turned by ``turns`` (N,),
    would run to the left as seen from its ``side``. Within 10 degrees of vertical it runs upwards.
    """
    along = along / np.linalg.norm(along, axis=1)[:, None]
    seen = -1.0 if side == "back" else 1.0
    tilted = turns - seen * np.radians(10.0)
    forward = seen * (np.cos(tilted) * along[:, 0] - np.sin(tilted) * along[:, 1])
    return np.where(forward[:, None] < -1e-9, -along, along)
