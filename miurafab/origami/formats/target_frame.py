"""The target in a FOLD file: ``miurafab:target``, ``miurafab:scale``, their seal, and its frame.

Nothing else in the file tells how large the target is, and a coarse sheet lies as near to a target
that is larger by a hundredth. So the file holds the SHA-256 of both, ``miurafab:target_sha256``.

In the file the folded form lies in the frame of the target. Where the target has an ``origin``
(:mod:`miurafab.surfaces.frame`), the folded form of a pattern is relative to it. A 64-bit number
has too few digits for the sum of both. So their decimals are added, and taken apart again when the
file is read: the same numbers come back, bit for bit.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from decimal import Decimal, localcontext
from typing import Any

import numpy as np

from miurafab.errors import PatternError, is_plain
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.surfaces.frame import origin_in

_DIGITS = 700
"""As many as the sum of any two 64-bit numbers has."""

LARGEST_SCALE = 1e12
"""No scale, in mm a unit of the target, is larger, and none is smaller than its inverse."""


def scale_in(document: Mapping[str, Any]) -> float:
    """``miurafab:scale``, 1 if it is missing. Raises ``PatternError``."""
    scale = document.get("miurafab:scale", 1.0)
    known = isinstance(scale, int | float) and not isinstance(scale, bool)
    if not known or not 1 / LARGEST_SCALE <= scale <= LARGEST_SCALE:
        raise PatternError(f"'miurafab:scale' is {scale!r}, not a number from 1e-12 to 1e12.")
    return float(scale)


def target_in(document: Mapping[str, Any]) -> dict[str, Any]:
    """``miurafab:target``, empty if it is missing. Raises ``PatternError``."""
    target = document.get("miurafab:target", {})
    if not isinstance(target, dict):
        raise PatternError("'miurafab:target' is not an object.")
    try:
        origin_in(target)
        _check_values(target)
    except (TypeError, ValueError, OverflowError) as fault:
        raise PatternError(f"'miurafab:target' is damaged: {fault}.") from None
    return target


def target_seal(target: Mapping[str, Any], scale: float) -> str:
    """The SHA-256 of ``target`` and ``scale``, whatever folder its mesh lies in."""
    told = {key: value for key, value in target.items() if key != "mesh"}
    return hashlib.sha256(json.dumps([told, scale], sort_keys=True).encode("ascii")).hexdigest()


def target_kept(document: Mapping[str, Any]) -> bool | None:
    """Whether target and scale are those that the file was written with, None if it has no seal."""
    if "miurafab:target" not in document:
        return True
    seal = document.get("miurafab:target_sha256")
    return (
        None if seal is None else bool(seal == target_seal(target_in(document), scale_in(document)))
    )


def _check_values(value: object) -> None:
    """Raise ``ValueError`` for a text in ``value`` that must reach no terminal and no XML file, and
    for a number that is none.
    """
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"it holds {value}")
    if isinstance(value, str) and not is_plain(value):
        raise ValueError(f"{value[:40]!r} holds control characters")
    if isinstance(value, dict):
        for key, item in value.items():
            _check_values(key)
            _check_values(item)
    elif isinstance(value, list):
        for item in value:
            _check_values(item)


def in_own_frame(text: str, pattern: CreasePattern) -> str:
    """The ``text`` of a FOLD file of ``pattern`` with the folded form in the target's frame."""
    folded, origin = pattern.folded_coords, [Decimal(repr(o)) for o in pattern.origin.tolist()]
    if folded is None or not any(origin):
        return text
    with localcontext(prec=_DIGITS):
        shifted = [
            [f"{Decimal(repr(x)) + o:f}" for x, o in zip(point, origin, strict=True)]
            for point in folded.tolist()
        ]
    near, far = (json.dumps(form, separators=(",", ":")) for form in (folded.tolist(), shifted))
    return text.replace(near, far.replace('"', ""), 1)


def exact_frames(document: dict[str, Any], text: str) -> dict[str, Any]:
    """The ``document`` of ``text``, with decimals in its frames if its target has an origin."""
    if "origin" not in target_in(document) or "file_frames" not in document:
        return document
    return {**document, "file_frames": json.loads(text, parse_float=Decimal)["file_frames"]}


def relative(points: list[Any], factor: float, origin: Floats) -> Floats:
    """(V, 3) the points of the file times ``factor``, relative to ``origin`` (3,), mm."""
    unit, start = Decimal(repr(factor)), [Decimal(repr(o)) for o in origin.tolist()]
    with localcontext(prec=_DIGITS):
        return np.array(
            [
                [float(Decimal(x) * unit - o) for x, o in zip(point, start, strict=True)]
                for point in points
            ]
        )
