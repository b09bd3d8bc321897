"""Lines out of bytes that arrive in any chunks, and out of noise that never ends a line."""

from __future__ import annotations

MOST_BYTES = 1024
"""Bytes without a line end after which the stream is taken for noise; GRBL's longest report has
about 160."""


class LineReader:
    """Takes bytes and gives the lines that are whole, without the ``edges`` around them."""

    def __init__(self, edges: bytes = b"\r\0") -> None:
        self._edges = edges
        self._rest = bytearray()

    def take(self, data: bytes) -> list[str]:
        """The lines that end in ``data``, but for empty ones; bytes from 0x80 stand as escapes."""
        self._rest += data
        *lines, rest = self._rest.split(b"\n")
        if len(rest) > MOST_BYTES:
            lines.append(rest)
            rest = bytearray()
        self._rest = rest
        texts = (line.strip(self._edges).decode("ascii", "backslashreplace") for line in lines)
        return [text for text in texts if text]
