"""The wire: the one place that opens a port, and the only home of pyserial.

A transport moves bytes and tells the time by its own clock, no more. There are two: a serial
port or pyserial URL in real time, and a controller in memory, whose time passes only while
somebody reads. Whoever holds a transport cannot tell them apart, so what is tested against
the one holds for the other.

Most boards are reset by the rising edge of DTR, the line that says that a computer is there.

* POSIX systems raise DTR when a port is opened, and lower it when the last program closes it, if
  the flag HUPCL is set (termios(3)). So the flag is cleared once a port is open: the line stays up
  at the close, and the next opening makes no edge. The first opening after the board was plugged in
  does.
* Windows lowers DTR at each close. So a port is opened with DTR and RTS low (pyserial sets them
  before it opens), and they are raised only if the board says nothing: a board with USB of its own
  may send only to a computer that is there.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

import serial
import serial.tools.list_ports

from miurafab.errors import PortError
from miurafab.machine.owner import holder_of, owner_of
from miurafab.profiles.machine import BAUD
from miurafab.simulate.beam import BeamSegment
from miurafab.simulate.grbl.controller import VirtualGrbl

VIRTUAL = "virtual"
"""The port name of the controller in memory."""

# What pyserial lets through when a port goes away: a TypeError for a descriptor that is None by
# now, a termios.error (no OSError) for a request to a line that has hung up.
_FAULTS: tuple[type[Exception], ...] = (serial.SerialException, OSError, TypeError)
if sys.platform != "win32":
    import termios

    _FAULTS += (termios.error,)

_LOWERS_LINES = os.name == "nt"  # at the close of a port
_QUIET_S = 0.7  # from the opening to the raising of the lines; a running board answers in 0.1 s
_SLICE = 0.005  # s; how late a key is seen, and pyserial on Windows cannot be interrupted within
_WRITE_TIMEOUT = 1.0  # s; far beyond the 90 ms that a full 1024-byte buffer takes at 115200 baud
_MOST_BEHIND = 1.0  # s; a busy computer catches up with less
_INSTANT = 1e-6  # s; the least that a virtual clock moves, far above its rounding


class Transport(Protocol):
    """A wire to one controller; every method but ``now`` raises ``PortError`` once it is gone.

    ``name`` is how messages call it. ``blocks`` says whether a read waits in real time and may
    be interrupted by a signal at any point without harm.
    """

    name: str
    blocks: bool

    def write(self, data: bytes) -> None:
        """Hand all of ``data`` to the wire."""

    def write_now(self, data: bytes) -> None:
        """Send ``data`` ahead of all bytes that are still waiting."""

    def read(self, timeout: float) -> bytes:
        """The bytes that have arrived; waits up to ``timeout`` seconds for the first."""

    def now(self) -> float:
        """Seconds on the clock of this wire, from an arbitrary start."""

    def close(self) -> None:
        """Release the port; does nothing the second time."""


class FlowTransport(Transport, Protocol):
    """A wire to a machine that holds up its sender by flow control."""

    @property
    def waiting(self) -> int:
        """The number of bytes that wait to be sent."""

    def offer(self, data: bytes) -> int:
        """Offer ``data``; returns the number of bytes that the wire took. Never waits."""


class SerialTransport:
    """A serial device (``/dev/ttyUSB0``, ``COM3``) or pyserial URL, locked for this process.

    The lock is advisory between programs that ask for it (``flock``); Windows locks by itself.
    ``flow_control`` is "none", "xon-xoff" or "rts-cts". Raises
    :class:`~miurafab.errors.PortError` if the port cannot be opened.
    """

    blocks = True

    def __init__(self, port: str, baud: int, flow_control: str = "none") -> None:
        self.name = port
        # pyserial's RFC 2217 client refuses a write timeout.
        if "://" in port and owner_of(port) is not None:  # no system locks these
            raise PortError(_in_use(port))
        patience = None if port.lower().startswith("rfc2217:") else _WRITE_TIMEOUT
        try:
            self._serial = serial.serial_for_url(
                port,
                baudrate=baud,
                timeout=_SLICE,
                write_timeout=patience,
                exclusive=True,
                xonxoff=flow_control == "xon-xoff",
                rtscts=flow_control == "rts-cts",
                do_not_open=True,
            )
            self._quiet_until = math.inf
            if _LOWERS_LINES and flow_control == "none" and "://" not in port:
                self._serial.dtr = self._serial.rts = False
                self._quiet_until = self.now() + _QUIET_S
            self._serial.open()
        except (serial.SerialException, OSError, ValueError) as fault:
            raise PortError(_why_not_opened(port, fault)) from None
        self._keep_lines()
        self._reduce_latency()

    def _keep_lines(self) -> None:
        """Leave DTR up when the port is closed, so that the next opening makes no edge."""
        if isinstance(self._serial, serial.Serial) and sys.platform != "win32":
            with contextlib.suppress(*_FAULTS):  # a port that has no lines
                attributes = termios.tcgetattr(self._serial.fileno())
                attributes[2] &= ~termios.HUPCL
                termios.tcsetattr(self._serial.fileno(), termios.TCSANOW, attributes)

    def _raise_lines(self) -> None:
        """The board said nothing: it may wait for the lines, or be reset by them."""
        self._quiet_until = math.inf
        self._serial.dtr = self._serial.rts = True

    def _reduce_latency(self) -> None:
        """Ask the driver to hand over each byte at once (FTDI chips else collect for 16 ms)."""
        set_mode = getattr(self._serial, "set_low_latency_mode", None)
        if set_mode is not None:
            with contextlib.suppress(OSError, ValueError, NotImplementedError):
                set_mode(True)

    def write(self, data: bytes) -> None:
        """Hand all of ``data`` to the driver."""
        with self._gone():
            self._serial.write(data)

    def write_now(self, data: bytes) -> None:
        """Drop what the driver has not sent yet, then send ``data``."""
        # Only here is that at once: over RFC 2217 it is a question that waits for its answer.
        if isinstance(self._serial, serial.Serial):
            with contextlib.suppress(*_FAULTS):
                self._serial.reset_output_buffer()
        self.write(data)

    @property
    def waiting(self) -> int:
        """The number of bytes that wait to be sent, as far as the operating system tells."""
        with self._gone():
            return self._serial.out_waiting if isinstance(self._serial, serial.Serial) else 0

    def offer(self, data: bytes) -> int:
        """Offer ``data``; returns the number of bytes taken. Does not wait for an XON; on Windows,
        whose driver gives no byte back, a second at most and byte by byte.
        """
        taken = 0
        with self._gone():
            if isinstance(self._serial, serial.Serial) and os.name == "posix":
                try:
                    return os.write(self._serial.fileno(), data)
                except BlockingIOError:
                    return 0
            with contextlib.suppress(serial.SerialTimeoutException):
                for taken in range(len(data)):
                    self._serial.write(data[taken : taken + 1])
                return len(data)
        return taken

    def read(self, timeout: float) -> bytes:
        """The bytes that have arrived; waits up to ``timeout`` seconds for the first."""
        end = self.now() + timeout
        with self._gone():
            while True:
                data: bytes = self._serial.read(max(1, self._serial.in_waiting))
                if data:
                    self._quiet_until = math.inf
                elif self.now() >= self._quiet_until:
                    self._raise_lines()
                if data or self.now() >= end:
                    return data

    def now(self) -> float:
        """The monotonic clock."""
        return time.monotonic()

    def close(self) -> None:
        """Release the port."""
        with contextlib.suppress(*_FAULTS):
            self._serial.close()

    @contextlib.contextmanager
    def _gone(self) -> Iterator[None]:
        try:
            yield
        except _FAULTS as fault:
            raise PortError(
                f"The port {self.name} went away ({fault}); is the cable in and the power on?"
            ) from None


class Device(Protocol):
    """A machine in memory, as :class:`VirtualTransport` drives it: see ``VirtualGrbl``."""

    @property
    def now(self) -> float:
        """Its clock, s."""

    @property
    def connected(self) -> bool:
        """Whether the cable is in."""

    @property
    def beam_log(self) -> list[BeamSegment]:
        """The segments that it burnt or drew."""

    @property
    def lost_bytes(self) -> int:
        """The number of bytes lost for want of room."""

    @property
    def resets_on_open(self) -> bool:
        """Whether the opening of its port resets it, as it does most controller boards."""

    def power_cycle(self) -> None:
        """Switch off and on."""

    def freeze(self, seconds: float) -> None:
        """Its program hangs for ``seconds`` (``math.inf``: for good); prepared motion runs out."""

    def next_event_in(self) -> float | None:
        """Seconds until something changes by itself; None if nothing will."""

    def advance(self, seconds: float) -> None:
        """Let time pass."""

    def receive(self, data: bytes) -> None:
        """Bytes start down the wire."""

    def take_output(self) -> bytes:
        """The bytes that it sent since the last call."""

    def advance_to_line(self, seconds: float) -> None:
        """Let time pass until it has spoken a line, ``seconds`` at the most."""


class VirtualTransport:
    """A controller in memory, as fast as the computer allows or at ``speed`` times real time.

    With ``forgets`` it keeps nothing of what the beam did, which nobody then can ask for.
    """

    name = VIRTUAL
    blocks = False

    def __init__(
        self, device: Device, speed: float | None = None, *, forgets: bool = False
    ) -> None:
        self.device = device
        self._forgets = forgets
        self._speed = speed
        self._start = time.monotonic()

    def write(self, data: bytes) -> None:
        """Hand ``data`` to the controller."""
        self._require_cable()
        self.device.receive(data)

    def write_now(self, data: bytes) -> None:
        """Hand ``data`` to the controller."""
        self._require_cable()
        self.device.receive(data)

    @property
    def waiting(self) -> int:
        """The number of bytes that are still on the wire."""
        return int(getattr(self.device, "waiting", 0))

    def offer(self, data: bytes) -> int:
        """Hand ``data`` to the controller."""
        self.write(data)
        return len(data)

    def read(self, timeout: float) -> bytes:
        """Let the controller's time pass until it has spoken a line, or for ``timeout`` seconds."""
        self._require_cable()
        if timeout > 0:
            self.device.advance_to_line(max(timeout, _INSTANT))
        output = self.device.take_output()
        if self._forgets:
            self.device.beam_log.clear()
        self._keep_pace()
        return output

    def _require_cable(self) -> None:
        if not self.device.connected:
            raise PortError(f"The port {self.name} went away; is the cable in and the power on?")

    def _keep_pace(self) -> None:
        if self._speed is not None:
            ahead = self.device.now / self._speed - (time.monotonic() - self._start)
            if ahead > 0:
                time.sleep(ahead)
            elif ahead < -_MOST_BEHIND:  # nobody has read for a while, so no time has passed
                self._start -= ahead

    def now(self) -> float:
        """The controller's clock."""
        return self.device.now

    def close(self) -> None:
        """Nothing to release."""


def open_port(
    port: str, baud: int = BAUD, settings: Mapping[int, float] | None = None
) -> FlowTransport:
    """The wire to ``port``: a device, a pyserial URL, or ``virtual``.

    The controller in memory has ``settings`` over the stock ones and runs as fast as the
    computer allows; the others ignore them. Raises
    :class:`~miurafab.errors.PortError` saying why a port cannot be opened.
    """
    if port == VIRTUAL:
        return VirtualTransport(VirtualGrbl(settings, baud=baud), forgets=True)
    return SerialTransport(port, baud)


def require_port(*ports: str) -> None:
    """Raise :class:`~miurafab.errors.PortError` if this computer has none of the ``ports``.

    Nothing is opened, so a board is not reset. On Windows, where a device is no file, and for a
    URL, only opening the port tells.
    """
    if os.name == "posix" and not any(
        port == VIRTUAL or "://" in port or Path(port).exists() for port in ports
    ):
        raise PortError(_no_such_port(ports[0]))


def list_ports() -> list[tuple[str, str]]:
    """The serial ports of this computer: device names and what the system says they are."""
    ports = serial.tools.list_ports.comports()
    return sorted((port.device, port.description or "") for port in ports)


def _in_use(port: str) -> str:
    who = holder_of(port)
    return f"The port {port} is in use by another program{who}, or close that program first."


def _no_such_port(port: str) -> str:
    known = ", ".join(name for name, _ in list_ports())
    there = f"the ports here are {known}" if known else "this computer has no serial port"
    return f"The port {port} does not exist; {there}, and '{VIRTUAL}' needs no machine."


def _why_not_opened(port: str, fault: Exception) -> str:
    number = getattr(fault, "errno", None)
    text = str(fault)
    if number in (errno.EAGAIN, errno.EWOULDBLOCK, errno.EBUSY) or "lock port" in text:
        return _in_use(port)
    if number == errno.EACCES or "Access is denied" in text:
        return (
            f"The port {port} may not be opened by this user, or another program has it; end that "
            "program, or let 'miurafab doctor' tell the command that gives you the port."
        )
    if number == errno.ENOENT or "FileNotFoundError" in text:
        return _no_such_port(port)
    if number == errno.ECONNREFUSED or "Connection refused" in text:
        return f"Nothing listens at {port}; start it there or correct the address."
    return f"The port {port} cannot be opened: {text.rstrip('.')}."
