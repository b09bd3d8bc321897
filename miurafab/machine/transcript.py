"""The transcript: all bytes on the wire, both ways, with the time.

One line a piece as it was written, or a reply up to its line end: seconds on the wire's clock
since the opening (of a reply: when its end came), ``>`` for what we sent or ``<`` for what came,
and the bytes with line ends and other invisible bytes escaped as in Python (``\\n``, ``\\x18``)::

    0.412345 > G1X10Y5S500F1200\\nX20\\n
    0.415002 < ok\\r\\n
"""

from __future__ import annotations

from pathlib import Path

from miurafab.machine.append_log import DurableFile


class Transcript:
    """The file at ``path``, written anew; ``title`` is a line that tells what it is.

    Raises :class:`~miurafab.errors.InputError` if it cannot be written.
    """

    def __init__(self, path: Path, title: str) -> None:
        self._file = DurableFile(path, "transcript", f"# {title}\n".encode(), append=False)
        self._coming = b""
        self._at = 0.0

    def sent(self, at: float, data: bytes) -> None:
        """Record bytes that were sent."""
        self._note(at, ">", data)

    def came(self, at: float, data: bytes) -> None:
        """Record bytes that arrived."""
        *lines, self._coming = (self._coming + data).split(b"\n")
        self._at = at
        for line in lines:
            self._note(at, "<", line + b"\n")

    def _note(self, at: float, direction: str, data: bytes) -> None:
        text = data.decode("latin-1").encode("unicode_escape")
        self._file.append(f"{at:.6f} {direction} ".encode() + text + b"\n")

    def check(self) -> None:
        """Raise :class:`~miurafab.errors.MachineError` if something could not be written."""
        self._file.check()

    def close(self) -> None:
        """Finish the file."""
        if self._coming:
            self._note(self._at, "<", self._coming)
            self._coming = b""
        self._file.close()
