"""How long this computer has slept: a laptop that is opened again must not burn on by itself.

A controller under M4 goes dark when it has made what it holds, and takes the rest of the job
whenever that comes. The clock of the waits stands still in a sleep on Linux and macOS, so that
nothing there would tell of it. Neither clock here is ever set, as the wall clock is: a board
without a battery sets that by hours when it reaches its network.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

SLEPT_S = 1.0
"""A shorter sleep is over before the controller has made what it holds."""
_TORN_S = 0.1


def slept_s() -> float:
    """The seconds that this computer has slept, from an arbitrary number on.

    A process that stood still between two clocks (Ctrl-Z, a busy computer) reads them again.
    Sources: clock_gettime(2) of Linux (``CLOCK_BOOTTIME``), clock_gettime(3) of macOS;
    ``QueryUnbiasedInterruptTime`` and ``GetTickCount64`` of Windows.

    >>> -1.0 < slept_s() - slept_s() < 1.0
    True
    """
    while True:
        began = _awake_s()
        slept = _passed_s() - began
        if _awake_s() - began < _TORN_S:
            return slept


class SleepWatch:
    """Tells of each sleep once; ``asleep`` is as :func:`slept_s`."""

    def __init__(self, asleep: Callable[[], float]) -> None:
        self._asleep, self._slept = asleep, asleep()

    def slept(self) -> float:
        """The seconds of sleep since the last call; 0 for less than :data:`SLEPT_S`."""
        before, self._slept = self._slept, self._asleep()
        return self._slept - before if self._slept - before > SLEPT_S else 0.0


if sys.platform == "win32":
    import ctypes

    _kernel = ctypes.WinDLL("kernel32")
    _kernel.GetTickCount64.restype = ctypes.c_ulonglong

    def _awake_s() -> float:
        awake = ctypes.c_ulonglong()
        _kernel.QueryUnbiasedInterruptTime(ctypes.byref(awake))
        return awake.value / 1e7

    def _passed_s() -> float:
        return float(_kernel.GetTickCount64() / 1e3)

elif sys.platform == "darwin":

    def _awake_s() -> float:
        return time.clock_gettime(time.CLOCK_UPTIME_RAW)

    def _passed_s() -> float:
        return time.clock_gettime(time.CLOCK_MONOTONIC_RAW)

else:
    _PASSED = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)

    def _awake_s() -> float:
        return time.monotonic()

    def _passed_s() -> float:
        return time.clock_gettime(_PASSED)
