"""The virtual controller behind a real port: a practice laser for any sender.

It is served over a pseudo-terminal (whose path a sender opens like a USB port) or over TCP, in
real time or a multiple of it. The controller goes on living when a sender closes the port. Like
most boards it is reset by the rising edge of the line DTR, and then says its banner. A
pseudo-terminal has no such line, so it is modelled: the kernel raises DTR when a port is opened,
and lowers it when the last program closes it with HUPCL set (Linux, ``tty_port.c``). Over TCP,
where a serial server opens its port for each sender, each opening is an edge.

What the beam did is written to the beam log as it happens, one segment a line::

    t0,t1,x0,y0,x1,y1,power

seconds of virtual time, machine millimetres, and the power as a fraction of full power.
"""

from __future__ import annotations

import contextlib
import math
import os
import select
import socket
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TextIO

from miurafab.errors import InputError, PortError, ProfileError
from miurafab.machine.actions import read_dump
from miurafab.machine.dialects import virtual_machine
from miurafab.machine.faulty import FaultyDevice
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import Device
from miurafab.profiles import load_machine
from miurafab.profiles.machine import BAUD
from miurafab.simulate.faults import Fault
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.simulate.grbl.dialect import DIALECTS

STOCK = "stock"
_GRBL_FAULTS = ("alarm", "stall")
_BOOT_S = 0.1  # from the opening to the banner: senders flush what came while they set up the port
_TICK_S = 0.01  # the longest sleep: how late a client's coming or a signal is seen
_CHUNK = 4096


class Wire(Protocol):
    """A wire that serves one sender at a time."""

    address: str

    def wait(self, timeout: float) -> tuple[bytes, bool]:
        """The bytes that arrive within ``timeout`` seconds, and whether a sender just opened."""

    @property
    def edge(self) -> bool:
        """Whether the last opening raised DTR, which was low before."""

    def write(self, data: bytes) -> None:
        """Send to the sender; without one the bytes are lost, as on a serial line."""

    def unplug(self) -> None:
        """Take the cable out: the port of the sender is gone."""

    def plug(self) -> None:
        """Put the cable in again; ``address`` may have changed, as with USB."""

    def close(self) -> None:
        """Release the address."""


class PtyWire:
    """A pseudo-terminal in raw mode; ``address`` is the path that a sender opens."""

    def __init__(self) -> None:
        if os.name != "posix":
            raise InputError(
                "This system has no pseudo-terminals; serve over TCP and open it as "
                "'socket://localhost:PORT'."
            )
        self.plug()

    def plug(self) -> None:
        """See :class:`Wire`."""
        import termios
        import tty

        self._plugged = True
        self._master, sender_side = os.openpty()
        tty.setraw(sender_side)
        attributes = termios.tcgetattr(sender_side)
        attributes[2] |= termios.HUPCL  # as a serial port has it, and a pseudo-terminal has not
        termios.tcsetattr(sender_side, termios.TCSANOW, attributes)
        self._line_up = self.edge = False
        self.address = os.ttyname(sender_side)
        # Only while no one holds the other side open does the kernel tell when somebody does.
        os.close(sender_side)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._open = False

    def wait(self, timeout: float) -> tuple[bytes, bool]:
        """See :class:`Wire`."""
        if not self._plugged:
            time.sleep(timeout)
            return b"", False
        flags = dict(self._poll.poll(timeout * 1000)).get(self._master, 0)
        was_open, self._open = self._open, not flags & select.POLLHUP
        if was_open and not self._open:
            self._line_up = not self._hangs_up()
        elif self._open and not was_open:
            self.edge, self._line_up = not self._line_up, True
        data = b""
        if flags & select.POLLIN:
            with contextlib.suppress(OSError):
                data = os.read(self._master, _CHUNK)
        if not self._open and not data:
            time.sleep(timeout)  # poll returns at once while the other side is closed
        return data, self._open and not was_open

    def _hangs_up(self) -> bool:
        """Whether the sender left HUPCL set: the master sees the settings of the other side."""
        import termios

        return bool(termios.tcgetattr(self._master)[2] & termios.HUPCL)

    def write(self, data: bytes) -> None:
        """See :class:`Wire`."""
        if self._open:
            with contextlib.suppress(OSError):
                os.write(self._master, data)

    def unplug(self) -> None:
        """See :class:`Wire`."""
        if self._plugged:
            os.close(self._master)
        self._plugged = self._open = False

    def close(self) -> None:
        """See :class:`Wire`."""
        self.unplug()


class TcpWire:
    """A listening TCP socket at ``HOST:PORT`` (port 0: any free one), one sender at a time."""

    edge = True

    def __init__(self, where: str) -> None:
        host, colon, port = where.rpartition(":")
        if not colon or not port.isdigit() or int(port) > 65_535:
            raise InputError(f"'{where}' is not HOST:PORT, such as 'localhost:7000'.")
        try:
            self._listener = socket.create_server((host.strip("[]"), int(port)))
        except OSError as fault:
            raise PortError(f"Cannot listen at {where}: {fault.strerror}.") from None
        self._listener.setblocking(False)
        self._plugged = True
        self._sender: socket.socket | None = None
        self.address = f"socket://{host}:{self._listener.getsockname()[1]}"

    def wait(self, timeout: float) -> tuple[bytes, bool]:
        """See :class:`Wire`."""
        watched = [self._listener] + ([self._sender] if self._sender else [])
        ready, _, _ = select.select(watched, [], [], timeout)
        data, opened = b"", False
        if self._sender in ready and self._sender is not None:
            with contextlib.suppress(OSError):
                data = self._sender.recv(_CHUNK)
            if not data:
                self._sender.close()
                self._sender = None
        if self._listener in ready:
            newcomer, _ = self._listener.accept()
            if self._sender is not None or not self._plugged:
                newcomer.close()
            else:
                newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                newcomer.setblocking(False)
                self._sender, opened = newcomer, True
        return data, opened

    def write(self, data: bytes) -> None:
        """See :class:`Wire`."""
        if self._sender is not None:
            with contextlib.suppress(OSError):
                self._sender.send(data)

    def unplug(self) -> None:
        """See :class:`Wire`."""
        self._plugged = False
        if self._sender is not None:
            self._sender.close()
        self._sender = None

    def plug(self) -> None:
        """See :class:`Wire`."""
        self._plugged = True

    def close(self) -> None:
        """See :class:`Wire`."""
        self.unplug()
        self._listener.close()


def load_controller(source: str, faults: Iterable[Fault] = (), *, greets: bool = True) -> Device:
    """The machine meant by ``stock``, a machine profile's name or file, or a ``$$`` dump's file.

    A profile's answers as its dialect does, the others are GRBL 1.1h. Without ``greets`` it says no
    banner. Raises :class:`~miurafab.errors.ProfileError` if ``source`` is none of them, or for a
    fault or a silence that only a machine that speaks GRBL can have.
    """
    path = Path(source)
    if source == STOCK:
        return VirtualGrbl(baud=BAUD, faults=faults, greets=greets)
    if path.is_file() and path.suffix != ".toml":
        return VirtualGrbl(read_dump(path).values, baud=BAUD, faults=faults, greets=greets)
    machine = load_machine(source)
    if machine.dialect not in DIALECTS:
        device, faults = virtual_machine(machine), tuple(faults)
        if not greets:
            raise ProfileError(
                f"{machine.name} speaks {machine.dialect}, and only machines that speak "
                f"{', '.join(DIALECTS)} may be silent at a start; leave `silent_greeting` out."
            )
        for fault in faults:
            if fault.kind in _GRBL_FAULTS:
                raise ProfileError(
                    f"{machine.name} speaks {machine.dialect}, and only machines that speak "
                    f"{', '.join(DIALECTS)} have the fault '{fault.kind}'; leave it out."
                )
        return FaultyDevice(device, faults) if faults else device
    return VirtualGrbl(
        virtual_settings(machine),
        baud=machine.controller.baud,
        dialect=machine.dialect,
        faults=faults,
        greets=greets,
    )


@dataclass(frozen=True)
class Served:
    """The use of a virtual controller: its seconds, the seconds with the beam on, bytes lost."""

    seconds: float
    beam_on_seconds: float
    lost_bytes: int


def serve_virtual(
    *,
    tcp: str | None = None,
    settings: str = STOCK,
    speed: float = 1.0,
    beam_log: Path | None = None,
    reset_on_open: str = "edge",
    greets: bool = True,
    faults: Iterable[Fault] = (),
    announce: Callable[[str], None] = print,
) -> Served:
    """Serve a virtual controller until Ctrl-C, SIGTERM or SIGHUP.

    Over TCP at ``tcp`` (``HOST:PORT``), else over a pseudo-terminal; ``announce`` is called with
    the address to open, and again if it is another after the cable was out. ``settings``: see
    :func:`load_controller`, also for ``greets``. ``speed`` is virtual seconds a real second.
    ``reset_on_open`` says when the opening of the port switches the controller off and on: at an
    ``edge`` of DTR, ``always`` or ``never``. ``faults`` strike once each, in all. Raises
    :class:`~miurafab.errors.InputError` for an option at fault,
    :class:`~miurafab.errors.PortError` for an address that is taken.
    """
    if not 0 < speed < math.inf:
        raise InputError(f"A speed of {speed:g} does not run; give a positive number.")
    device = load_controller(settings, faults, greets=greets)
    if not device.resets_on_open:
        reset_on_open = "never"
    with contextlib.ExitStack() as at_end:
        log = _BeamLog(device, beam_log)
        at_end.callback(log.close)
        wire: Wire = TcpWire(tcp) if tcp is not None else PtyWire()
        at_end.callback(wire.close)
        signals = at_end.enter_context(StopSignals())
        signals.at_once = False
        announce(wire.address)
        with contextlib.suppress(KeyboardInterrupt):
            _serve(device, wire, speed, log, signals.check, announce, reset_on_open)
    return Served(device.now, log.seconds, device.lost_bytes)


def _serve(
    device: Device,
    wire: Wire,
    speed: float,
    log: _BeamLog,
    check: Callable[[], None],
    announce: Callable[[str], None],
    reset_on_open: str,
) -> None:
    start = time.monotonic()
    booted_at = 0.0
    plugged = True
    while True:
        check()
        upcoming = device.next_event_in()
        timeout = _TICK_S if upcoming is None else min(_TICK_S, upcoming / speed)
        data, opened = wire.wait(timeout)
        device.advance(max(0.0, (time.monotonic() - start) * speed - device.now))
        if opened and (reset_on_open == "always" or (reset_on_open == "edge" and wire.edge)):
            device.power_cycle()
            booted_at = time.monotonic() + _BOOT_S
        if time.monotonic() >= booted_at:  # a board that boots hears nothing
            if data:
                device.receive(data)
            output = device.take_output()
            if output:
                wire.write(output)
        if device.connected != plugged:
            plugged = device.connected
            _replug(wire, plugged, announce)
        log.update()


def _replug(wire: Wire, plugged: bool, announce: Callable[[str], None]) -> None:
    if not plugged:
        wire.unplug()
        return
    before = wire.address
    wire.plug()
    if wire.address != before:
        announce(wire.address)


class _BeamLog:
    """Writes the segments that ``device`` burns to ``path`` as they come."""

    def __init__(self, device: Device, path: Path | None) -> None:
        self.seconds = 0.0
        self._device = device
        self._due = 0.0
        self._file: TextIO | None = None
        if path is not None:
            try:
                self._file = path.open("w", encoding="ascii", newline="\n", buffering=1)
            except OSError as fault:
                raise InputError(
                    f"The beam log {path} cannot be written: {fault.strerror}."
                ) from None
            self._file.write("t0,t1,x0,y0,x1,y1,power\n")

    def update(self) -> None:
        """Write the new segments, at most once a second of virtual time."""
        if self._device.now >= self._due:
            self._due = self._device.now + 1.0
            # The last segment may still grow.
            self._take(len(self._device.beam_log) - 1)

    def close(self) -> None:
        """Write the last segments and close the file."""
        self._take(len(self._device.beam_log))
        if self._file is not None:
            self._file.close()

    def _take(self, count: int) -> None:
        log = self._device.beam_log
        segments = log[: max(count, 0)]
        del log[: max(count, 0)]
        self.seconds += sum(s.t1 - s.t0 for s in segments)
        if self._file is not None and segments:
            self._file.write(
                "".join(
                    f"{s.t0:.6f},{s.t1:.6f},{s.x0:.4f},{s.y0:.4f},{s.x1:.4f},{s.y1:.4f},"
                    f"{s.power:.4f}\n"
                    for s in segments
                )
            )
