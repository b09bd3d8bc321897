"""The arrow keys as a jog pad: a step a press, smooth while held, at rest within a step of release.

A terminal tells of presses and never of a release; a held key is a run of presses. So at most two
steps are under way at a time, whatever is pressed: the one that moves and the next, which joins it
without a stop. When a run of presses ends, the jog is cancelled (0x85). The feed is such that the
way until then, and that of braking, are one step::

    v T + v^2 / 2a = s,   so   v = a (sqrt(T^2 + 2 s / a) - T)

with the step s, the acceleration a of the axis (``$120``, ``$121``) and the time T from the last
press to the cancel. A press in another direction cancels too, and moves when the axes stand.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

from miurafab.errors import InputError
from miurafab.machine.keys import JOG_CANCEL

_RUN_S = 0.12
"""The longest time between two presses of a held key; a slow keyboard repeats 10 times a second."""
_RELEASE_S = _RUN_S + 0.15
"""T above: until the run has ended, that was seen, and the cancel has come through what the
controller has prepared (0.05 s of steps, ``stepper.c``)."""
_RUN = 3  # presses in a row that mean a held key
_REPORT_S = 0.3  # a status report that says Idle so long after a jog was sent is not from before it
_NEAR_MM = 0.02
_STOCK_ACCELERATION, _STOCK_RATE = 10.0, 500.0
"""mm/s^2 and mm/min, GRBL's own (``defaults_generic.h``), for a controller that does not tell."""


class JogPad:
    """What is pressed and what is under way; mutable, in the machine's own coordinates."""

    def __init__(self) -> None:
        self._wanted: tuple[float, float] | None = None
        self._step: tuple[float, float] | None = None
        self._presses: deque[float] = deque(maxlen=_RUN)
        self.forget()

    @property
    def busy(self) -> bool:
        """Whether a press is unanswered or a step is under way."""
        return self._wanted is not None or self._step is not None

    def forget(self) -> None:
        """Nothing is pressed and nothing is under way: the machine was stopped."""
        self._wanted = self._step = None
        self._target = (0.0, 0.0)
        self._sent_at = -math.inf
        self._cancelled = False

    def press(self, dx: float, dy: float, now: float) -> None:
        """A key that moves by ``dx`` and ``dy`` mm was pressed."""
        self._wanted = (dx, dy)
        self._presses.append(now)

    def next_order(
        self,
        now: float,
        position: tuple[float, ...] | None,
        idle: bool,
        settings: Mapping[int, float],
    ) -> bytes | None:
        """The jog or the cancel to send now, None for none; ``position`` is that of the machine."""
        if position is None:
            return None
        left = math.dist(self._target, position[:2])
        if idle and (left < _NEAR_MM or now - self._sent_at > _REPORT_S):
            self._step, self._cancelled = None, False
        if self._step is None:
            if self._wanted is None:
                return None
            self._target = (position[0], position[1])
            return self._send(now, settings)
        if self._cancelled:
            return None
        if self._wanted is not None and _turned(self._wanted, self._step):
            return self._cancel()
        if self._wanted is not None:
            if left <= 1.01 * math.hypot(*self._step):
                return self._send(now, settings)
            self._wanted = None
        held = len(self._presses) == _RUN and self._presses[-1] - self._presses[0] < _RUN * _RUN_S
        if held and now - self._presses[-1] > _RUN_S and left > _NEAR_MM:
            self._presses.clear()
            return self._cancel()
        return None

    def _cancel(self) -> bytes:
        self._cancelled = True
        return JOG_CANCEL

    def _send(self, now: float, settings: Mapping[int, float]) -> bytes:
        assert self._wanted is not None
        (dx, dy), self._wanted = self._wanted, None
        self._step, self._sent_at = (dx, dy), now
        self._target = (self._target[0] + dx, self._target[1] + dy)
        words = "".join(f"{axis}{way:.3f}" for axis, way in (("X", dx), ("Y", dy)) if way)
        return f"$J=G21G91{words}F{_feed(dx, dy, settings):.0f}".encode("ascii")


def _turned(wanted: tuple[float, float], step: tuple[float, float]) -> bool:
    """Whether two steps are not along the same line in the same sense."""
    along = wanted[0] * step[0] + wanted[1] * step[1]
    return along < (1 - 1e-9) * math.hypot(*wanted) * math.hypot(*step)


def _feed(dx: float, dy: float, settings: Mapping[int, float]) -> float:
    """The feed in mm/min of the module's docstring, at most the axis' own."""
    axes = [n for n, way in enumerate((dx, dy)) if way]
    a = min(settings.get(120 + n, _STOCK_ACCELERATION) for n in axes)
    rate = min(settings.get(110 + n, _STOCK_RATE) for n in axes)
    v = a * (math.sqrt(_RELEASE_S**2 + 2 * math.hypot(dx, dy) / a) - _RELEASE_S)
    return max(1.0, min(60 * v, rate))


def require_way(x: float | None, y: float | None) -> str:
    """The words of a jog by ``x`` and ``y``; raises ``InputError`` if neither is given."""
    words = "".join(f"{a}{v:.3f}" for a, v in (("X", x), ("Y", y)) if v is not None)
    if not words:
        raise InputError("A jog needs a distance along X, along Y, or both.")
    return words
