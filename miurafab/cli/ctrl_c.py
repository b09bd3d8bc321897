"""Ctrl-C that is not lost: a ``KeyboardInterrupt`` that Python or a library drops is raised again.

Python drops an exception that is raised in a finaliser or in a callback. A library may catch every
exception of a module that it loads: trimesh takes scipy and networkx as missing then, and goes on.
Commands with a machine or a server have their own handler (:mod:`miurafab.machine.signals`) while
they run.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from types import FrameType, TracebackType
from typing import Any

_AGAIN_S = 0.1


class CtrlC:
    """``with CtrlC() as ctrl_c``, in the main thread; inactive where Ctrl-C is ignored.

    ``came`` says whether Ctrl-C has come. At the end of the block :meth:`check` raises a
    ``KeyboardInterrupt`` that was dropped.
    """

    def __init__(self) -> None:
        self.came = False
        self._again: threading.Timer | None = None
        self._hook: Any = None

    def check(self) -> None:
        """Raise ``KeyboardInterrupt`` if Ctrl-C has come."""
        if self.came:
            raise KeyboardInterrupt

    def __enter__(self) -> CtrlC:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._hook, sys.unraisablehook = sys.unraisablehook, self._dropped
            signal.signal(signal.SIGINT, self._handle)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._hook is not None:
            if self._again is not None:
                self._again.cancel()
            signal.signal(signal.SIGINT, signal.default_int_handler)
            sys.unraisablehook = self._hook

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        if _loads_a_module(frame):
            self._raise_again()
        raise KeyboardInterrupt

    def _dropped(self, report: sys.UnraisableHookArgs) -> None:
        """Called by Python with an exception that it drops."""
        if report.exc_type is KeyboardInterrupt:
            self._raise_again()
        else:
            self._hook(report)

    def _raise_again(self) -> None:
        """In a moment, when the code that drops exceptions has ended, unless the block has."""
        self._again = threading.Timer(_AGAIN_S, _thread.interrupt_main)
        self._again.daemon = True
        self._again.start()


def _loads_a_module(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
