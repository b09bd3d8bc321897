"""An HPGL file on its way to a cutter that answers nothing: whole instructions, then the pen up.

The cutter only says when to wait (XOFF) and when to go on (XON), and where the driver or the cable
does that (RTS/CTS) not even that is seen here. So what it has done is not known, only what it was
given: its buffer is filled no further than the wire is held up.

Ended before its time, the file must leave neither the tool down nor half an instruction, whose
last number would be cut short and so be another place: the rest of the instruction begun is sent,
then ``PU``, then ``ESC.K``, which makes a plotter drop what it holds unexecuted, then ``PU`` and
``SP0`` again. A cutter that does not know ``ESC.K`` cuts what it holds to its end, and then lifts
the tool.
Sources: HP 7550A Interfacing and Programming Manual, device-control instructions ``ESC.K`` and
``ESC.I`` (Xon-Xoff handshake); Roland CAMM-1 manual.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from miurafab.gcode.hpgl_reader import instructions
from miurafab.gcode.job import Job

XON, XOFF = 0x11, 0x13
PEN_UP = b"PU;SP0;\n"
DROP_ALL = b"\x1b.K"


@dataclass(frozen=True, slots=True)
class Instruction:
    """One instruction: its 1-based ``line`` in the file, ``data`` as it goes down the wire, and
    whether it ``ends`` the line.
    """

    line: int
    data: bytes
    ends: bool


def prepared(job: Job) -> Iterator[Instruction]:
    """The instructions of ``job``, one at a time, each ended by a semicolon.

    Raises :class:`~miurafab.errors.GcodeError` for what is none.
    """
    for number, line in enumerate(job.iter_lines(), 1):
        found = [f"{name}{rest};" for name, rest in instructions(job.name, number, line)]
        for index, text in enumerate(found, 1):
            yield Instruction(number, text.encode("ascii"), index == len(found))


class PlotterStream:
    """What of ``job`` may be handed to the wire; ``lines`` went whole, the last being ``line``."""

    def __init__(self, job: Job) -> None:
        self.line = 0
        self.lines = 0
        self.waits = False
        self._instructions = prepared(job)
        self._begun = b""  # what is left of the instruction on the wire
        self._instruction: Instruction | None = None
        self._ended = False

    @property
    def finished(self) -> bool:
        """Whether all was handed over, the pen up at the end."""
        return self._ended and not self._begun

    def next_bytes(self, most: int) -> bytes:
        """Up to ``most`` bytes that may go now; say with :meth:`took` how many went."""
        if not self._begun and not self._ended:
            following = next(self._instructions, None)
            if following is None:
                self._ended, self._begun = True, PEN_UP
            else:
                self._begun, self._instruction = following.data, following
        return b"" if self.waits else self._begun[:most]

    def took(self, count: int) -> None:
        """The wire took ``count`` of the bytes given last."""
        self._begun = self._begun[count:]
        done = self._instruction
        if count and not self._begun and not self._ended and done is not None and done.ends:
            self.lines += 1
            self.line = done.line

    def hear(self, data: bytes) -> None:
        """What the cutter said: wait, or go on."""
        for byte in data:
            if byte in (XON, XOFF):
                self.waits = byte == XOFF

    def abort(self) -> bytes:
        """The bytes that end it now, whatever was given; nothing else may follow."""
        rest, self._begun, self._ended = self._begun, b"", True
        return rest + b"PU;" + DROP_ALL + PEN_UP
