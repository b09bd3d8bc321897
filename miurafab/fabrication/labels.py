"""The places of engraved patch names and tab numbers: inside a facet, clear of creases and cuts.

A text of height s and width s·w, centred at c along direction u, lies inside a convex polygon with
the clearance to its sides if for each side, with inward normal n at distance d from c,

    s (w |n·u| + |n·v|) / 2 <= d - clearance,

where v is u turned by a right angle. So the largest s is the least of the quotients. A text that
would be too small to read is left out. For a polygon that is not convex the rule is stricter than
necessary.

The label of a tab is engraved on the tab, followed by M or V if its fold is a mountain or a valley,
and on the facet to which it is glued, at the place that the tab covers. A patch name is engraved
where no tab will be. If there is no room for label and M or V, this letter is left out first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.lettering import text_strokes, text_width
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


@dataclass(frozen=True, eq=False)
class PlacedText:
    """A text on a patch, its ``strokes`` (n, 2) in mm in the pattern's plane."""

    patch: int
    text: str
    strokes: tuple[Floats, ...]


@dataclass(frozen=True, eq=False)
class Lettering:
    """The ``texts`` of all patches, the number ``left_out`` for lack of room, and the number of
    tabs ``unmarked``, without the letter of their fold.
    """

    texts: list[PlacedText]
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
) -> Lettering:
    """The texts of all patches.

    ``face_patch`` (F,) is the patch of each facet, ``names`` are the names of the P patches,
    ``labels`` (N) the labels of the ``tabs``, and ``turns`` (P,) the angles by which patches are
    turned later: texts are upright after that.
    """
    texts, left_out, unmarked = _tab_labels(face_patch, tabs, labels, turns)
    spots = _facet_spots(pattern, tabs, turns[face_patch])
    width = np.array([text_width(name) for name in names])
    height = np.minimum(spots.height(width[face_patch]), NAME_MM[1])
    for patch, name in enumerate(names):
        faces = np.flatnonzero(face_patch == patch)
        far = np.linalg.norm(spots.centre[faces] - spots.centre[faces].mean(axis=0), axis=1)
        # Of places equal up to rounding the first is taken, so that rounding decides nothing.
        face = int(faces[np.lexsort((np.round(far, 3), -np.round(height[faces], 3)))[0]])
        if height[face] < NAME_MM[0]:
            left_out += 1
            continue
        centre, along = spots.centre[face], spots.along[face]
        texts.append(_written(patch, name, centre, along, float(height[face])))
    return Lettering(texts, left_out, unmarked)


def _tab_labels(
    face_patch: Ints, tabs: TabRegions, labels: Sequence[str], turns: Floats
) -> tuple[list[PlacedText], int, int]:
    """The label of each tab on the tab and on the facet under it, the count of labels without
    room, and the count of tabs without room for the letter.
    """
    texts: list[PlacedText] = []
    left_out = unmarked = 0
    if not len(tabs):
        return texts, left_out, unmarked
    words = list(labels)
    folds = tabs.seams.fold.tolist()
    marked = [w + f if f in MARKED else w for w, f in zip(words, folds, strict=True)]
    glued = np.flatnonzero(tabs.mate_face >= 0)
    mates = tabs.take(glued)
    for faces, points, present, wanted in (
        (tabs.own_face, tabs.points, tabs.present, marked),
        (mates.mate_face, mates.glued, mates.present, [words[tab] for tab in glued.tolist()]),
    ):
        patch, base = face_patch[faces], points[:, 1] - points[:, 0]
        spots = _spots(points, present, _upright(base, turns[patch]))
        shown, height = list(wanted), spots.height(np.array([text_width(word) for word in wanted]))
        alone = [word.rstrip("MV") for word in wanted]
        bare = spots.height(np.array([text_width(word) for word in alone]))
        for tab in np.flatnonzero((height < LABEL_MM[0]) & (bare >= LABEL_MM[0])).tolist():
            shown[tab], height[tab] = alone[tab], bare[tab]
            unmarked += 1
        height = np.minimum(height, LABEL_MM[1])
        room = height >= LABEL_MM[0]
        left_out += int((~room).sum())
        for tab in np.flatnonzero(room).tolist():
            centre, along = spots.centre[tab], spots.along[tab]
            texts.append(_written(int(patch[tab]), shown[tab], centre, along, float(height[tab])))
    return texts, left_out, unmarked


def _facet_spots(pattern: CreasePattern, tabs: TabRegions, turns: Floats) -> _Spots:
    """A place in each facet, along its longest side, outside of the tabs that cover it."""
    corners = pattern.faces_vertices
    points, count = pattern.vertices_coords[corners], (corners >= 0).sum(axis=1)
    ends = pattern.vertices_coords[pattern.edges_vertices[pattern.faces_edges]]
    side = ends[:, :, 1] - ends[:, :, 0]
    # Of sides equal up to rounding the first is taken, so that rounding decides nothing.
    length = np.where(corners >= 0, np.round(np.linalg.norm(side, axis=2), 6), -1.0)
    longest = side[np.arange(len(corners)), length.argmax(axis=1)]

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
    return _spots(points, present, _upright(longest, turns))


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


def _upright(along: Floats, turns: Floats) -> Floats:
    """The unit directions of ``along`` (N, 2), reversed if the text, turned by ``turns`` (N,),
    would run to the left. Within 10 degrees of vertical it runs upwards.
    """
    along = along / np.linalg.norm(along, axis=1)[:, None]
    tilted = turns - np.radians(10.0)
    forward = np.cos(tilted) * along[:, 0] - np.sin(tilted) * along[:, 1]
    return np.where(forward[:, None] < -1e-9, -along, along)


def _written(patch: int, text: str, centre: Floats, along: Floats, height: float) -> PlacedText:
    frame = height * np.stack([along, np.array([-along[1], along[0]])])
    return PlacedText(patch, text, tuple(centre + stroke @ frame for stroke in text_strokes(text)))
