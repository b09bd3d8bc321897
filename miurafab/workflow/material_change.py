"""Material change: who puts fresh material in before each further sheet.

A sheet that is cut lies in the machine. The next one needs other material, and only a person, or a
machine that feeds itself, can put it in. So a job waits there on every path, and ends where nobody
is. A program that waits for a person (M0) is treated in the same way. A sheet that is worked from
both sides is turned over in between.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from miurafab.machine.keys import Keys, NoKeys
from miurafab.machine.planning import AtPause, put_in
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import VIRTUAL
from miurafab.workflow.cut import Prepared

WAITS = "waits for fresh material"
"""Why a sheet was not cut that no person put material in for."""


def needs_person(prepared: Prepared, port: str, pause: bool | None) -> bool:
    """Whether a person puts in the material of each further sheet; ``pause`` if that is given."""
    feeds_itself = prepared.machine.bed.roll_fed and pause is None and not turns_over(prepared)
    return is_attended(port, pause) and not feeds_itself


def turns_over(prepared: Prepared) -> bool:
    """Whether a sheet is worked from both sides; no machine turns one over."""
    return any(prepared.back_of(number) for number in range(1, len(prepared.jobs) + 1))


def wanted(prepared: Prepared, number: int, burnt: int | None = None) -> str:
    """What a person does before sheet ``number``, after sheet ``burnt`` or the one before it."""
    return put_in(prepared.sha256_of(burnt or max(1, number - 1)), prepared.back_of(number))


def is_attended(port: str, pause: bool | None) -> bool:
    """Whether what is done at ``port`` waits for a person; ``pause`` if that is given."""
    return port != VIRTUAL if pause is None else pause


def at_pause(waits: bool, keys: Keys | None) -> AtPause:
    """What is done where a program waits for a person (M0)."""
    if not waits:
        return "go on"
    return "stop" if keys is None or isinstance(keys, NoKeys) else "wait"


class MaterialChange:
    """The material in each machine: one person puts it in, at one machine after another.

    ``asks``: there is such a person.
    """

    def __init__(
        self,
        prepared: Prepared,
        ports: Sequence[str],
        pause: bool | None,
        before_sheet: Callable[[int, str, Callable[[], bool]], bool] | None,
        signals: StopSignals,
    ) -> None:
        self.missing = False
        self.asks = before_sheet is not None
        self._waits = {port: needs_person(prepared, port, pause) for port in ports}
        self._before_sheet = before_sheet
        self._signals = signals
        self._one_at_a_time = threading.Lock()

    def at_pause(self, port: str) -> AtPause:
        """What a machine does where a program waits for a person: nobody is at its keys."""
        return at_pause(self._waits[port], None)

    def is_in(self, number: int, port: str, lost: Callable[[], bool]) -> bool:
        """Whether fresh material is in the machine at ``port``, for sheet ``number``; nobody is
        asked on where the machine is ``lost``.
        """

        def over() -> bool:
            return self._signals.caught is not None or lost()

        if not self._waits[port]:
            return True
        with self._one_at_a_time:
            ask = self._before_sheet
            is_in = ask is not None and ask(number, port, over)
        self.missing = self.missing or not (is_in or over())
        return is_in
