"""Perforation: a crease as dashes, real segments.

On a crease of length L, n dashes and n - 1 gaps fill u = L - 2 bridge exactly, symmetric from both
ends. The material chooses which length is adapted:

* ``centre``: inner dashes have length ``cut``, gaps length ``gap``, and both end dashes the same
  length e >= min_end, with u = 2 e + (n - 2) cut + (n - 1) gap. The largest such n is taken, so
  e < min_end + (cut + gap) / 2.
* ``stretch_cut``: gaps have length ``gap`` and all dashes c = (u - (n - 1) gap) / n, for the n that
  brings c nearest to ``cut`` by whole periods, with c >= min_end.
* ``stretch_gap``: dashes have length ``cut`` and all gaps g = (u - n cut) / (n - 1), for the
  largest n with g >= gap, so that no crease is weaker than asked for.

A crease too short for two dashes has one dash of length u. A crease too short for a dash of min_end
has one dash in its middle, min_end long but at most L / 2, and shorter bridges. So every crease has
at least one dash. A scored or cut crease has exactly one.

All these lengths are lengths *burnt*. The beam is as wide as the kerf, so a stroke of length s
burns s + kerf: each stroke is drawn shorter than its dash by kerf / 2 at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.errors import LayoutError
from miurafab.geometry.arrays import Floats, Ints, places_in_runs
from miurafab.profiles import Material
from miurafab.profiles.material import Perforation

MIN_STROKE_MM = 0.05
"""A shorter stroke is a dot for every controller (GRBL plans to 0.001 mm; judged)."""


@dataclass(frozen=True, eq=False)
class Dashes:
    """D dashes of N creases, in order along each crease: ``starts`` and ``ends`` (D, 2) in mm, as
    drawn, and the ``crease`` (D,) int64 of each dash.
    """

    starts: Floats
    ends: Floats
    crease: Ints

    def __len__(self) -> int:
        return len(self.crease)


def perforate(starts: Floats, ends: Floats, material: Material, kind: str = "mountain") -> Dashes:
    """The dashes of N creases of one ``kind`` from ``starts`` (N, 2) to ``ends`` (N, 2), in mm.

    Raises :class:`~miurafab.errors.LayoutError` if the material asks for dashes that its kerf
    would fill.
    """
    rule, kerf = material.perforation_of(kind), material.kerf_mm
    least = kerf + MIN_STROKE_MM
    if rule.cut_mm < least:
        raise LayoutError(
            f"The material '{material.name}' asks for dashes of {rule.cut_mm:g} mm, which a kerf "
            f"of {kerf:g} mm cannot draw; make 'cut' at least {least:g} mm."
        )
    length = np.linalg.norm(ends - starts, axis=1)
    return _drawn(starts, ends, length, _FITS[rule.fit](length, rule, least), kerf)


def unbroken(starts: Floats, ends: Floats, material: Material, kind: str = "mountain") -> Dashes:
    """One stroke along each of N creases of one ``kind``, except for the bridges at its ends."""
    rule = material.perforation_of(kind)
    length = np.linalg.norm(ends - starts, axis=1)
    nothing = np.zeros_like(length)
    ones = np.ones(len(length), dtype=np.int64)
    bridge, end = _single(length, rule)
    return _drawn(starts, ends, length, _Fit(ones, bridge, end, nothing, nothing), material.kerf_mm)


def burnt_shares(dashes: Dashes, lengths: Floats, kerf_mm: float) -> Floats:
    """(N,) the part of each crease, of ``lengths`` (N,) in mm, that ``dashes`` burn through."""
    burnt = np.linalg.norm(dashes.ends - dashes.starts, axis=1) + kerf_mm
    return np.asarray(np.bincount(dashes.crease, burnt) / lengths)


@dataclass(frozen=True, eq=False)
class _Fit:
    """(N,) for each crease: the number of dashes, the bridge at each end, the lengths of the end
    dashes, of the inner dashes, and of the gaps.
    """

    count: Ints
    bridge: Floats
    end: Floats
    cut: Floats
    gap: Floats


def _drawn(starts: Floats, ends: Floats, length: Floats, fit: _Fit, kerf: float) -> Dashes:
    crease = np.repeat(np.arange(len(length)), fit.count)
    index = places_in_runs(fit.count)
    last = index == fit.count[crease] - 1
    begin, period = fit.bridge + fit.end + fit.gap, fit.cut + fit.gap
    inner = begin[crease] + (index - 1) * period[crease]
    at = np.where(index == 0, fit.bridge[crease], inner)
    at = np.where(last, (length - fit.bridge - fit.end)[crease], at)
    to = at + np.where((index == 0) | last, fit.end[crease], fit.cut[crease])
    # A dash too short for its kerf is a short stroke in its middle.
    shorten = np.minimum(kerf, np.maximum(to - at - MIN_STROKE_MM, 0.0)) / 2
    part = np.stack([at + shorten, to - shorten], axis=1) / length[crease, None]
    along = (ends - starts)[crease]
    drawn = starts[crease, None] + part[..., None] * along[:, None]
    return Dashes(drawn[:, 0], drawn[:, 1], crease)


def _single(length: Floats, rule: Perforation) -> tuple[Floats, Floats]:
    """(N,) the bridge at each end and the length of the dash, for creases with one dash."""
    used = length - 2 * rule.bridge_mm
    min_end = max(rule.min_end_mm, MIN_STROKE_MM)
    end = np.where(used < min_end, np.minimum(min_end, length / 2), used)
    return (length - end) / 2, end


def _fitted(
    length: Floats,
    rule: Perforation,
    count: Ints,
    end: Floats,
    cut: Floats,
    gap: Floats,
) -> _Fit:
    """The given fit for creases with two dashes or more, a single dash for other creases."""
    bridge, alone = _single(length, rule)
    single = count < 2
    return _Fit(np.where(single, 1, count), bridge, np.where(single, alone, end), cut, gap)


# The slack keeps an exact fit from losing a dash to rounding.
_SLACK = 1e-9


def _centre(length: Floats, rule: Perforation, least: float) -> _Fit:
    cut, gap, min_end = rule.cut_mm, rule.gap_mm, max(rule.min_end_mm, least)
    used = length - 2 * rule.bridge_mm
    count = np.floor((used + 2 * cut + gap - 2 * min_end) / (cut + gap) + _SLACK).astype(np.int64)
    end = (used - (count - 2) * cut - (count - 1) * gap) / 2
    inner, gaps = np.full_like(length, cut), np.full_like(length, gap)
    return _fitted(length, rule, count, end, inner, gaps)


def _stretch_cut(length: Floats, rule: Perforation, least: float) -> _Fit:
    cut, gap, min_end = rule.cut_mm, rule.gap_mm, max(rule.min_end_mm, least)
    used = length - 2 * rule.bridge_mm
    nearest = np.floor((used + gap) / (cut + gap) + 0.5)
    most = np.floor((used + gap) / (min_end + gap) + _SLACK)
    count = np.minimum(nearest, most).astype(np.int64)
    dash = (used - (count - 1) * gap) / np.maximum(count, 1)
    return _fitted(length, rule, count, dash, dash, np.full_like(length, gap))


def _stretch_gap(length: Floats, rule: Perforation, least: float) -> _Fit:
    cut, gap = rule.cut_mm, rule.gap_mm
    used = length - 2 * rule.bridge_mm
    most = np.floor((used + gap) / (cut + gap) + _SLACK)
    count = np.where(used < rule.min_end_mm, 1, most).astype(np.int64)
    space = (used - count * cut) / np.maximum(count - 1, 1)
    dash = np.full_like(length, cut)
    return _fitted(length, rule, count, dash, dash, space)


_FITS = {"centre": _centre, "stretch_cut": _stretch_cut, "stretch_gap": _stretch_gap}
