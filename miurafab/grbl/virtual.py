"""A GRBL 1.1h controller in memory: bytes in, bytes out, and time only by :meth:`advance`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BeamSegment:
    """The beam on from ``t0`` to ``t1`` (s of virtual time), moving evenly from (``x0``, ``y0``)
    to (``x1``, ``y1``) in machine mm (equal: standing still), at ``power``, the PWM duty in 0..1.
    """

    t0: float
    t1: float
    x0: float
    y0: float
    x1: float
    y1: float
    power: float

    @property
    def standing(self) -> bool:
        """Whether the beam burnt in place."""
        return self.x0 == self.x1 and self.y0 == self.y1


class VirtualGrbl:
    """The device side of the wire.

    ``settings`` maps a ``$`` number to its value, over the firmware's stock defaults (None: just
    those). ``baud`` paces the wire both ways, ten bit times a byte; None: bytes take no time.
    At power-up the banner is in the output.
    """

    def __init__(
        self, settings: Mapping[int, float] | None = None, *, baud: int | None = None
    ) -> None:
        raise NotImplementedError

    now: float
    """Virtual seconds since power-up."""
    lost_bytes: int
    """Bytes that found the 128-byte ring full, or came while an EEPROM write blocked interrupts."""
    beam_log: list[BeamSegment]
    """What was burnt so far, in order of time."""

    def receive(self, data: bytes) -> None:
        """Bytes that reach the UART (with ``baud``: start down the wire) now."""
        raise NotImplementedError

    def advance(self, seconds: float) -> None:
        """Let ``seconds`` of virtual time pass: the only way time enters."""
        raise NotImplementedError

    def take_output(self) -> bytes:
        """The bytes that have come out of the UART since the last call."""
        raise NotImplementedError

    def next_event_in(self) -> float | None:
        """Seconds until something changes by itself; None if nothing will without input."""
        raise NotImplementedError

    @property
    def beam_on(self) -> bool:
        """Whether the beam burns now."""
        raise NotImplementedError

    @property
    def position(self) -> tuple[float, float, float]:
        """The machine position in mm now."""
        raise NotImplementedError

    def load_settings_dump(self, text: str) -> None:
        """Take the settings from the text that ``$$`` printed, at power-up."""
        raise NotImplementedError
