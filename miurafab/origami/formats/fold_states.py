"""The frames of a FOLD document: which is the flat pattern, which its folded form, and the others.

A frame of class foldedForm that orders its facets, with folds of 0 and 180 degrees alone, is folded
flat. It is another state of the sheet, as the frames of a motion are, which have other fold angles
than the flat pattern gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.formats.any_plane import laid_in_plane
from miurafab.origami.formats.fold_keys import (
    classes_of,
    frames_in,
    list_at,
    numbers_at,
    points_at,
    unit_mm,
)
from miurafab.origami.formats.folded_only import is_folded
from miurafab.origami.formats.target_frame import relative, scale_in, target_in
from miurafab.surfaces.frame import origin_in

_SAME_ANGLE = 1e-4
"""Degrees by which fold angles may differ as they are written."""


@dataclass(frozen=True, eq=False)
class FurtherFrame:
    """A state of a sheet beside its folded form.

    Attributes
    ----------
    number : int
        The frame, counted from the key frame, 0.
    points : (V, 3) float64
        The vertices, mm.
    orders : (n, 3) int64 or None
        The triples of ``faceOrders``: facet f lies on the side s of g, 1 being that of g's front.
    """

    number: int
    points: Floats
    orders: Ints | None


def flat_frame(frames: list[Mapping[str, Any]]) -> tuple[int, Mapping[str, Any]]:
    """The place of the frame of class creasePattern, or else of the first frame that is flat, and
    the frame with its plane turned into that of x and y.
    """
    places = range(len(frames))
    declared = [n for n in places if "creasePattern" in classes_of(frames[n])]
    for n in declared or [n for n in places if "foldedForm" not in classes_of(frames[n])] or places:
        frame = frames[n]
        points = points_at(frame, "vertices_coords")
        if points.shape[1] == 2 or np.ptp(points[:, 2]) <= 1e-9 * np.ptp(points[:, :2]):
            return n, frame
        laid = laid_in_plane(points, frame.get("faces_vertices"))
        if laid is not None:
            return n, {**frame, "vertices_coords": laid.tolist()}
    raise PatternError("No frame of the file holds a flat crease pattern in 'vertices_coords'.")


def folded_alone(frames: list[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """The frame with the folded form of a file that holds no flat pattern; None if it holds one."""
    try:
        place, key = flat_frame(frames)
    except PatternError:
        for frame in frames:
            if isinstance(frame.get("vertices_coords"), list) and frame["vertices_coords"]:
                return frame
        raise
    return frames[place] if is_folded(key) else None


def folded_form(
    frames: list[Mapping[str, Any]],
    key: Mapping[str, Any],
    vertices: int,
    factor: float,
    origin: Floats,
) -> Floats | None:
    """The folded form (V, 3), mm, in ``frames`` beside the ``key`` frame, relative to ``origin``;
    None without one.
    """
    frame = folded_frame(frames, key)
    return None if frame is None else _points_of(frame, vertices, factor, origin)


def further_frames(document: Mapping[str, Any]) -> tuple[FurtherFrame, ...]:
    """The frames of class foldedForm in a FOLD document that holds a pattern, without its folded
    form.
    """
    frames = frames_in(document)
    if folded_alone(frames) is not None:
        return ()
    place, key = flat_frame(frames)
    flat = points_at(key, "vertices_coords")
    factor, origin = unit_mm(key, 1.0), origin_of(document)
    chosen = folded_frame(frames[:place] + frames[place + 1 :], key)
    return tuple(
        FurtherFrame(n, _points_of(frame, len(flat), factor, origin), _orders(frame, flat))
        for n, frame in enumerate(frames)
        if n != place
        and frame is not chosen
        and "foldedForm" in classes_of(frame)
        and len(list_at(frame, "vertices_coords")) == len(flat)  # else it is of another sheet
    )


def _orders(frame: Mapping[str, Any], flat: Floats) -> Ints | None:
    """The ``faceOrders`` (n, 3) of a frame, as facets that run counterclockwise in the ``flat``
    pattern have them; None without any.
    """
    orders = numbers_at(frame, "faceOrders", 3)
    faces = frame.get("faces_vertices")
    if orders is None or not isinstance(faces, list):
        return None
    if len(orders) and not (orders[:, :2].min() >= 0 and orders[:, :2].max() < len(faces)):
        raise PatternError("'faceOrders' refers to a facet that does not exist.")
    front = np.array([_turn(flat[face]) for face in faces])
    return np.asarray(
        orders * np.column_stack([np.ones((len(orders), 2), int), front[orders[:, 1]]])
    )


def _turn(corners: Floats) -> int:
    """1 for a facet that runs counterclockwise, else -1."""
    x, y = corners[:, 0], corners[:, 1]
    return 1 if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0 else -1


def folded_frame(
    frames: list[Mapping[str, Any]], key: Mapping[str, Any]
) -> Mapping[str, Any] | None:
    """The first of ``frames`` of class foldedForm. A frame that says of itself that it is folded
    flat, and one of several that folds by other angles than the ``key`` frame gives, is another
    state of the sheet.
    """
    folded = [frame for frame in frames if "foldedForm" in classes_of(frame)]
    for frame in folded:
        if not _is_folded_flat(frame) and not (len(folded) > 1 and _folds_otherwise(frame, key)):
            return frame
    return None


def _folds_otherwise(frame: Mapping[str, Any], key: Mapping[str, Any]) -> bool:
    """Whether ``frame`` gives an edge another fold angle than the ``key`` frame does."""
    try:
        own, given = (
            np.array([np.nan if a is None else a for a in list_at(each, "edges_foldAngle")], float)
            for each in (frame, key)
        )
    except (PatternError, ValueError, TypeError):  # none, or no angles
        return False
    if own.shape != given.shape or not np.nan_to_num(given).any():
        return False  # that the sheet lies flat in its flat pattern tells nothing of its folds
    return bool((np.abs(own - given) > _SAME_ANGLE).any())


def _points_of(frame: Mapping[str, Any], vertices: int, factor: float, origin: Floats) -> Floats:
    """The vertices (V, 3) of ``frame``, mm, relative to ``origin``."""
    points = points_at(frame, "vertices_coords")
    factor = unit_mm(frame, factor)
    if origin.any() and points.shape[1] == 3 and np.isfinite(points).all():
        points = relative(frame["vertices_coords"], factor, origin)
    else:
        points = points * factor
    if points.shape[1] == 2:
        points = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    if len(points) != vertices:
        raise PatternError(
            f"The folded form has {len(points)} vertices and the pattern {vertices}."
        )
    return points


def _is_folded_flat(frame: Mapping[str, Any]) -> bool:
    """Whether it orders its facets and all its folds are 0 or 180 degrees."""
    angles = frame.get("edges_foldAngle") if "faceOrders" in frame else None
    return isinstance(angles, list) and {abs(a) for a in angles if a is not None} <= {0, 180}


def origin_of(document: Mapping[str, Any]) -> Floats:
    """(3,) where the folded form of the pattern starts in the frame of the file, mm."""
    return np.asarray(scale_in(document) * origin_in(target_in(document)))
