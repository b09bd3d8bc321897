"""The stream of an HPGL file to a cutter: whole instructions, and the pen up at the end.

The cutter answers nothing. It only says when to wait (XOFF) and when to go on (XON); with RTS/CTS
the driver or the cable does this unseen. So the sender knows what it sent, and not what is drawn.

An abort must not leave the tool down, nor half an instruction, because a truncated number is
another position. So the stream sends the rest of the instruction begun, then ``PU``, then
``ESC.K``, which makes a plotter drop its unexecuted instructions, then ``PU`` and ``SP0`` again. A
cutter that does not know ``ESC.K`` executes its whole buffer and then lifts the tool.
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
    """One instruction: its 1-based ``line`` in the file, its ``data`` as sent, and whether it
    ``ends`` the line.
    """

    line: int
    data: bytes
    ends: bool


def send_instructions(job: Job) -> Iterator[Instruction]:
    """Yield the instructions of ``job``, each ended by a semicolon.

    Raises :class:`~miurafab.errors.GcodeError` for text that is no instruction.
    """
    for number, line in enumerate(job.iter_lines(), 1):
        texts = [f"{name}{rest};" for name, rest in instructions(job.name, number, line)]
        for index, text in enumerate(texts, 1):
            yield Instruction(number, text.encode("ascii"), index == len(texts))


class PlotterStream:
    """Sends ``job``: ``lines`` lines are sent completely, the last of them is ``line``."""

    def __init__(self, job: Job) -> None:
        self.line = 0
        self.lines = 0
        self.waits = False
        self._instructions = send_instructions(job)
        self._begun = b""  # the unsent rest of the current instruction
        self._instruction: Instruction | None = None
        self._ended = False

    @property
    def finished(self) -> bool:
        """Whether everything is sent, including the pen up at the end."""
        return self._ended and not self._begun

    def next_bytes(self, most: int) -> bytes:
        """Up to ``most`` bytes that may be sent now; report to :meth:`took` how many were sent."""
        if not self._begun and not self._ended:
            following = next(self._instructions, None)
            if following is None:
                self._ended, self._begun = True, PEN_UP
            else:
                self._begun, self._instruction = following.data, following
        return b"" if self.waits else self._begun[:most]

    def took(self, count: int) -> None:
        """``count`` of the last bytes were sent."""
        self._begun = self._begun[count:]
        done = self._instruction
        if count and not self._begun and not self._ended and done is not None and done.ends:
            self.lines += 1
            self.line = done.line

    def hear(self, data: bytes) -> None:
        """Take bytes from the cutter: XOFF to wait, XON to go on."""
        for byte in data:
            if byte in (XON, XOFF):
                self.waits = byte == XOFF

    def abort(self) -> bytes:
        """The bytes that end the stream now; nothing may follow."""
        rest, self._begun, self._ended = self._begun, b"", True
        return rest + b"PU;" + DROP_ALL + PEN_UP
