"""How long this computer has slept: a laptop that is opened again must not burn on by itself.

A controller under M4 goes dark when it has made what it holds, and takes the rest of the job
whenever that comes. The clock of the waits stands still in a sleep on Linux and macOS, so that
nothing there would tell of it.
"""

from __future__ import annotations

import sys
import time


def slept_s() -> float:
    """The seconds that this computer has slept, from an arbitrary number on.

    Sources: clock_gettime(2) of Linux (``CLOCK_BOOTTIME``) and of macOS (``CLOCK_MONOTONIC`` goes
    on in a sleep, Python's does not); ``QueryUnbiasedInterruptTime`` and ``GetTickCount64`` of
    Windows.

    >>> -1.0 < slept_s() - slept_s() < 1.0
    True
    """
    if sys.platform == "win32":
        import ctypes

        kernel, awake = ctypes.windll.kernel32, ctypes.c_ulonglong()
        kernel.QueryUnbiasedInterruptTime(ctypes.byref(awake))
        kernel.GetTickCount64.restype = ctypes.c_ulonglong
        return float(kernel.GetTickCount64() / 1e3 - awake.value / 1e7)
    clock = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
    return time.clock_gettime(clock) - time.monotonic()
