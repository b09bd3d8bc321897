"""The virtual controller behind a real port: a practice laser for any sender.

It is served over a pseudo-terminal (whose path a sender opens like a USB port) or over TCP, in
real time or a multiple of it. The controller goes on living when a sender closes the port, and
with ``reset_on_open`` it is reset when one opens it, as the DTR line resets most boards: that is
when a sender sees the banner.

What the beam did is written to the beam log as it happens, one segment a line::

    t0,t1,x0,y0,x1,y1,power

seconds of virtual time, machine millimetres, and the power as a fraction of full power.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol, TextIO

from miurafab.errors import InputError, PortError
from miurafab.grbl.settings import virtual_settings
from miurafab.grbl.virtual import VirtualGrbl
from miurafab.machine.actions import read_dump
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine

STOCK = "stock"
BAUD = 115_200
_TICK_S = 0.01  # the longest sleep: how late a client's coming or a signal is seen
_CHUNK = 4096


class Wire(Protocol):
    """Where the senders are, one at a time."""

    address: str

    def wait(self, timeout: float) -> tuple[bytes, bool]:
        """What arrived within ``timeout`` seconds, and whether a sender has just opened."""

    def write(self, data: bytes) -> None:
        """Send to whoever listens; what nobody takes is lost, as on a serial line."""

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
        import tty

        self._master, sender_side = os.openpty()
        tty.setraw(sender_side)
        self.address = os.ttyname(sender_side)
        # Only while no one holds the other side open does the kernel tell when somebody does.
        os.close(sender_side)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._open = False

    def wait(self, timeout: float) -> tuple[bytes, bool]:
        """See :class:`Wire`."""
        flags = dict(self._poll.poll(timeout * 1000)).get(self._master, 0)
        was_open, self._open = self._open, not flags & select.POLLHUP
        data = b""
        if flags & select.POLLIN:
            with contextlib.suppress(OSError):
                data = os.read(self._master, _CHUNK)
        if not self._open and not data:
            time.sleep(timeout)  # poll returns at once while the other side is closed
        return data, self._open and not was_open

    def write(self, data: bytes) -> None:
        """See :class:`Wire`."""
        if self._open:
            with contextlib.suppress(OSError):
                os.write(self._master, data)

    def close(self) -> None:
        """See :class:`Wire`."""
        os.close(self._master)


class TcpWire:
    """A listening TCP socket at ``HOST:PORT`` (port 0: any free one), one sender at a time."""

    def __init__(self, where: str) -> None:
        host, colon, port = where.rpartition(":")
        if not colon or not port.isdigit() or int(port) > 65_535:
            raise InputError(f"'{where}' is not HOST:PORT, such as 'localhost:7000'.")
        try:
            self._listener = socket.create_server((host.strip("[]"), int(port)))
        except OSError as fault:
            raise PortError(f"Cannot listen at {where}: {fault.strerror}.") from None
        self._listener.setblocking(False)
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
            if self._sender is not None:
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

    def close(self) -> None:
        """See :class:`Wire`."""
        if self._sender is not None:
            self._sender.close()
        self._listener.close()


def load_virtual_settings(source: str) -> Mapping[int, float] | None:
    """The settings meant by ``stock``, a machine profile's name or file, or a ``$$`` dump's file.

    Raises :class:`~miurafab.errors.ProfileError` if it is none of them.
    """
    if source == STOCK:
        return None
    path = Path(source)
    if path.is_file() and path.suffix != ".toml":
        return read_dump(path).values
    return virtual_settings(load_machine(source))


def serve_virtual(
    *,
    tcp: str | None = None,
    settings: str = STOCK,
    speed: float = 1.0,
    beam_log: Path | None = None,
    reset_on_open: bool = True,
    announce: Callable[[str], None] = print,
) -> VirtualGrbl:
    """Serve a virtual controller until Ctrl-C, SIGTERM or SIGHUP; returns it as it then stands.

    Over TCP at ``tcp`` (``HOST:PORT``), else over a pseudo-terminal; ``announce`` is called once
    with the address to open. ``settings``: see :func:`load_virtual_settings`. ``speed`` is
    virtual seconds a real second. Raises :class:`~miurafab.errors.InputError` for an option at
    fault, :class:`~miurafab.errors.PortError` for an address that is taken.
    """
    if not speed > 0:
        raise InputError(f"A speed of {speed:g} does not run; give a positive number.")
    device = VirtualGrbl(load_virtual_settings(settings), baud=BAUD)
    with contextlib.ExitStack() as at_end:
        log = None if beam_log is None else at_end.enter_context(_BeamLog(beam_log, device))
        wire: Wire = TcpWire(tcp) if tcp is not None else PtyWire()
        at_end.callback(wire.close)
        signals = at_end.enter_context(StopSignals())
        signals.at_once = False
        announce(wire.address)
        with contextlib.suppress(KeyboardInterrupt):
            _serve(device, wire, speed, log, signals.check, reset_on_open=reset_on_open)
    return device


def _serve(
    device: VirtualGrbl,
    wire: Wire,
    speed: float,
    log: _BeamLog | None,
    check: Callable[[], None],
    *,
    reset_on_open: bool,
) -> None:
    start = time.monotonic()
    while True:
        check()
        upcoming = device.next_event_in()
        timeout = _TICK_S if upcoming is None else min(_TICK_S, upcoming / speed)
        data, opened = wire.wait(timeout)
        device.advance(max(0.0, (time.monotonic() - start) * speed - device.now))
        if opened and reset_on_open:
            device.take_output()
            device.receive(b"\x18")
        if data:
            device.receive(data)
        output = device.take_output()
        if output:
            wire.write(output)
        if log is not None:
            log.update()


class _BeamLog:
    """The segments of ``device.beam_log``, written to ``path`` as they come."""

    def __init__(self, path: Path, device: VirtualGrbl) -> None:
        self._device = device
        self._written = 0
        try:
            self._file: TextIO = path.open("w", encoding="ascii", newline="\n", buffering=1)
        except OSError as fault:
            raise InputError(f"The beam log {path} cannot be written: {fault.strerror}.") from None
        self._file.write("t0,t1,x0,y0,x1,y1,power\n")

    def __enter__(self) -> _BeamLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.update()
        self._file.close()

    def update(self) -> None:
        """Write the segments that have come since."""
        segments = self._device.beam_log[self._written :]
        self._written += len(segments)
        self._file.write(
            "".join(
                f"{s.t0:.6f},{s.t1:.6f},{s.x0:.4f},{s.y0:.4f},{s.x1:.4f},{s.y1:.4f},{s.power:.4f}\n"
                for s in segments
            )
        )
