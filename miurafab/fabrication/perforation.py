"""Perforation: the dashes that let a crease fold, as real segments.

Along a crease of length L, with u = L - 2 end_bridge, n dashes and n - 1 gaps fill u exactly:

    u = 2 e + (n - 2) cut + (n - 1) gap,

all inner dashes being ``cut`` and all gaps ``gap`` long, and both end dashes of the equal length
e >= min_end. The largest such n is taken, so e < min_end + (cut + gap) / 2, and the crease is the
same seen from either end. A crease too short for two dashes has one, which fills u; one too short
even for a dash of min_end has one in its middle, min_end long but never more than half of L, and
the bridges give way. So every crease has at least one dash.

All of these are lengths *burnt*. The beam is as wide as the kerf, so a stroke of length s burns
s + kerf, and each stroke is drawn shorter than its dash by kerf / 2 at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.profiles import Material

MIN_STROKE_MM = 0.05
"""A shorter stroke is a dot to every controller (GRBL reports and plans to 0.001 mm; judged)."""


@dataclass(frozen=True, eq=False)
class Dashes:
    """D dashes of N creases, in order along each crease.

    ``starts`` and ``ends`` (D, 2) in mm, as drawn; ``crease`` (D,) int64, the crease each lies on.
    """

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    crease: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.crease)


def perforate(starts: NDArray[np.float64], ends: NDArray[np.float64], material: Material) -> Dashes:
    """The dashes of N creases from ``starts`` (N, 2) to ``ends`` (N, 2), in mm.

    Raises :class:`~miurafab.errors.LayoutError` if the material asks for dashes that its kerf
    would fill.
    """
    rule, kerf = material.perforation, material.kerf_mm
    least = kerf + MIN_STROKE_MM
    if rule.cut_mm < least:
        raise LayoutError(
            f"The material '{material.name}' asks for dashes of {rule.cut_mm:g} mm, which a kerf "
            f"of {kerf:g} mm cannot draw; make 'cut' at least {least:g} mm."
        )
    if not len(starts):
        return Dashes(np.empty((0, 2)), np.empty((0, 2)), np.empty(0, dtype=np.int64))
    length = np.linalg.norm(ends - starts, axis=1)
    count, bridge, end = _fit(
        length, rule.cut_mm, rule.gap_mm, rule.end_bridge_mm, max(rule.min_end_mm, least)
    )
    crease = np.repeat(np.arange(len(count)), count)
    index = np.arange(len(crease)) - np.repeat(np.cumsum(count) - count, count)
    last = index == count[crease] - 1
    period = rule.cut_mm + rule.gap_mm
    begin = bridge + end + rule.gap_mm - period
    at = np.where(index == 0, bridge[crease], begin[crease] + index * period)
    at = np.where(last, (length - bridge - end)[crease], at)
    to = np.where((index == 0) | last, at + end[crease], at + rule.cut_mm)
    # A dash in a crease shorter than two kerfs stays a stroke, in the middle of the crease.
    shorten = np.minimum(kerf, np.maximum(to - at - MIN_STROKE_MM, 0.0)) / 2
    part = np.stack([at + shorten, to - shorten], axis=1) / length[crease, None]
    along = (ends - starts)[crease]
    drawn = starts[crease, None] + part[..., None] * along[:, None]
    return Dashes(drawn[:, 0], drawn[:, 1], crease)


def _fit(
    length: NDArray[np.float64], cut: float, gap: float, end_bridge: float, min_end: float
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """(N,) number of dashes, bridge at each end, and length of the end dashes."""
    used = length - 2 * end_bridge
    # The slack keeps a crease that is an exact fit from losing a dash to rounding.
    count = np.floor((used + 2 * cut + gap - 2 * min_end) / (cut + gap) + 1e-9).astype(np.int64)
    single = count < 2
    count = np.where(single, 1, count)
    end = np.where(single, used, (used - (count - 2) * cut - (count - 1) * gap) / 2)
    short = used < min_end
    end = np.where(short, np.minimum(min_end, length / 2), end)
    bridge = np.where(short, (length - end) / 2, end_bridge)
    return count, bridge, end
