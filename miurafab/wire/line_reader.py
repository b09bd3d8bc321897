"""The line reader: bytes arrive in any chunks and leave as lines."""

from __future__ import annotations

MOST_BYTES = 1024
"""After this many bytes without a line end the reader gives them out as a line, because they are
noise; GRBL's longest report has about 160 bytes."""


class LineReader:
    """Takes bytes and returns complete lines, stripped of the ``edges`` characters."""

    def __init__(self, edges: bytes = b"\r\0") -> None:
        self._edges = edges
        self._rest = bytearray()

    def take(self, data: bytes) -> list[str]:
        """The non-empty lines that end in ``data``; bytes from 0x80 up become escapes."""
        self._rest += data
        *lines, rest = self._rest.split(b"\n")
        if len(rest) > MOST_BYTES:
            lines.append(rest)
            rest = bytearray()
        self._rest = rest
        texts = (line.strip(self._edges).decode("ascii", "backslashreplace") for line in lines)
        return [text for text in texts if text]
