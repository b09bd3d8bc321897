"""What the reading of a drawing changed and left out, in findings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from miurafab.findings import Finding
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.formats.crease_lines import CreaseLines
from miurafab.origami.formats.loose_parts import InnerParts

_OVERSHOOT = 0.05
"""Of a line, so much may reach over the last line that it crosses, and is not told."""


def told_of_lines(
    lines: CreaseLines, source: Ints, stands_for: Ints, lengths: Floats, holes: Floats
) -> tuple[Finding, ...]:
    """What became of ``lines``, of which m sides were made: ``source`` (m,) is the line of each
    side, ``stands_for`` (m,) the side of the pattern in its place, -1 for none, ``lengths`` (m,)
    how long it is on the paper, and ``holes`` (h,) the area of each hole over that of all facets
    and holes.
    """
    return tuple(_told(lines, source, stands_for, lengths, holes))


def _told(
    lines: CreaseLines, source: Ints, stands_for: Ints, lengths: Floats, holes: Floats
) -> Iterator[Finding]:
    if lines.curve is not None:
        count = int((lines.curve >= 0).sum())
        yield Finding(
            "curved-lines",
            f"{_many(lines.curves, 'curved line')} of the drawing became "
            f"{_many(count, 'straight line')} within {lines.curve_tolerance:.3g} mm; "
            "'miurafab convert' takes another `curve_tolerance`.",
        )
    kept = stands_for >= 0
    pairs = np.stack([source[stands_for[kept]], source[kept]], axis=1)
    letters = lines.assignment[pairs]
    clash = (letters[:, 0] != letters[:, 1]) & np.isin(letters, ("M", "V")).all(axis=1)
    if clash.any():
        (one, lost), (letter, other) = pairs[clash][0].tolist(), letters[clash][0].tolist()
        yield Finding(
            "lost-lines",
            f"A mountain and a valley lie on each other in {_many(int(clash.sum()), 'place')}, and "
            f"one is kept, the first being {letter} and not {other} at {_at(lines, lost)}.",
            (one, lost),
        )
    away = lost_lines(lines, source, stands_for)
    if away.any():
        first, count = int(np.argmax(away)), int(away.sum())
        yield Finding(
            "lost-lines",
            f"{_many(count, 'line')} of the drawing {_are(count)} left out, being no side of a "
            f"facet, the first {lines.assignment[first]} at {_at(lines, first)}.",
            tuple(np.flatnonzero(away).tolist()),
        )
    left = np.bincount(source, lengths * (stands_for < 0), minlength=len(lines.ends))
    torn = torn_lines(lines, source, stands_for, lengths)
    if torn.any():
        first, count = int(np.argmax(torn)), int(torn.sum())
        yield Finding(
            "lost-lines",
            f"{_many(count, 'line')} of the drawing {_are(count)} left out in part, where no facet "
            f"is beside, by up to {left[torn].max():.3g} mm, the first {lines.assignment[first]} "
            f"at {_at(lines, first)}.",
            tuple(np.flatnonzero(torn).tolist()),
        )
    if lines.left_out:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(lines.left_out.items()))
        yield Finding("lost-lines", f"Parts of the drawing are not read: {kinds}.")
    if len(holes):
        says = (
            f"{_many(len(holes), 'part')} of the drawing, with borders alone around, "
            f"{'holds' if len(holes) == 1 else 'hold'} no paper, {100 * holes.sum():.3g} % of its "
            "area"
        )
        way = "; draw a flat line (F) in each that is paper" if holes.sum() > 0.5 else ""
        yield Finding("holes", f"{says}{way}.")


def lost_lines(lines: CreaseLines, source: Ints, stands_for: Ints) -> Bools:
    """(n,) the ``lines`` of the drawing of which nothing is in the pattern; those without length do
    not count.
    """
    away = np.asarray((lines.ends[:, 0] != lines.ends[:, 1]).any(axis=1))
    away[source[stands_for >= 0]] = False
    return away & _of_drawing(lines)


def torn_lines(lines: CreaseLines, source: Ints, stands_for: Ints, lengths: Floats) -> Bools:
    """(n,) the ``lines`` of the drawing of which a part is in the pattern, and more than an
    overshoot is not.
    """
    whole, left = (
        np.bincount(source, lengths * part, minlength=len(lines.ends))
        for part in (1.0, stands_for < 0)
    )
    torn = (left > _OVERSHOOT * whole) & ~lost_lines(lines, source, stands_for)
    return np.asarray(torn & _of_drawing(lines))


def _of_drawing(lines: CreaseLines) -> Bools:
    return np.arange(len(lines.ends)) < len(lines.ends) - lines.added


def told_of_joining(near: float) -> Finding:
    """What is told of a drawing whose ends are joined farther than usual."""
    return Finding(
        "joined-ends",
        f"Lines of the drawing do not quite meet: ends within {near:.2g} mm of each other are "
        "joined; 'miurafab convert' takes another `tolerance`.",
    )


def told_of_inner_parts(rounds: Sequence[InnerParts]) -> tuple[Finding, ...]:
    """What is told of the flat lines that make polygons of facets, in one round after another."""
    found = (
        (
            sum(each.loose for each in rounds),
            "part",
            "of the drawing lie{} loose inside a facet: two flat lines (F) join {} to the lines "
            "around.",
        ),
        (
            sum(each.slits for each in rounds),
            "end",
            "of cuts lie{} inside a facet: a flat line (F) goes on from {} to the next line.",
        ),
        (
            sum(each.hanging for each in rounds),
            "part",
            "of the drawing hang{} in a facet at one vertex: a flat line (F) joins {} to the lines "
            "around.",
        ),
    )
    return tuple(
        Finding(
            "loose-parts",
            f"{_many(count, noun)} {says.format(*(('s', 'it') if count == 1 else ('', 'each')))}",
        )
        for count, noun, says in found
        if count
    )


def told_of_rulings(count: int) -> Finding:
    """What is told of the lines along which paper bends beside curved creases."""
    return Finding(
        "curved-lines",
        f"{_many(count, 'ruling')} (F) across the facets beside curved creases {_are(count)} "
        "added: there the paper bends.",
    )


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _many(count: int, noun: str) -> str:
    return f"{count} {noun}" + ("" if count == 1 else "s")


def _at(lines: CreaseLines, line: int) -> str:
    x, y = lines.ends[line].mean(axis=0).tolist()
    return f"({x:.6g}, {y:.6g})"
