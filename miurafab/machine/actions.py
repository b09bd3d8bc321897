"""Actions on a machine besides cutting: query it, home it, unlock it, move it.

Each function opens the port, greets the controller, does one thing and closes the port. Those
that move the machine reset it first on every way out but success, as the sender does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict, Unpack

from miurafab.errors import ControllerError, GcodeError, InputError, JobStopped, ProfileError
from miurafab.gcode.job import Job
from miurafab.grbl.connection import Connection
from miurafab.grbl.events import Options, StatusReport, Version
from miurafab.grbl.settings import Settings, parse_dump
from miurafab.machine.modes import ask_modes
from miurafab.machine.session import HOMING_S, Session
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import open_port
from miurafab.profiles.machine import BAUD, WAIT_S

_POLL_S = 0.1


@dataclass(frozen=True)
class MachineInfo:
    """The controller's report on itself; a figure that it does not report is None.

    ``position`` and ``machine_position`` are in mm, ``state`` as in its status report. ``modes``
    are those in force, ``startup_blocks`` the lines that it runs after each reset.
    """

    port: str
    firmware: str
    version: str
    build: str | None
    options: str | None
    planner_blocks: int | None
    rx_bytes: int | None
    state: str
    position: tuple[float, ...] | None
    machine_position: tuple[float, ...] | None
    beam_off: bool
    modes: str
    startup_blocks: tuple[str, ...]


class LineOptions(TypedDict, total=False):
    """``baud``, the seconds to ``wait`` for the start of the board, whether to ``reset`` it even if
    it is at rest, the ``settings`` of the controller in memory if the port is ``virtual``, and
    ``on_restart``, which is called if the opening of the port reset the board.
    """

    baud: int
    wait: float
    reset: bool
    on_restart: Callable[[], None]
    settings: Mapping[int, float] | None


@contextmanager
def conversation(
    port: str,
    *,
    moves: bool = False,
    signals: StopSignals | None = None,
    **line: Unpack[LineOptions],
) -> Iterator[Session]:
    """A session with the controller at ``port``, greeted; closed at the end.

    With ``moves`` the controller is reset if the block ends by an exception. ``signals`` are
    caught by the block, so that it can rule when they raise. Raises
    :class:`~miurafab.errors.JobStopped` for Ctrl-C, SIGTERM and SIGHUP, and what
    :meth:`~miurafab.machine.session.Session.greet` raises.
    """
    with signals or StopSignals() as signals:
        patience = line.get("wait", WAIT_S)
        transport = open_port(port, line.get("baud", BAUD), line.get("settings"))
        signals.at_once = transport.blocks
        session = Session(transport, Connection(), check=signals.check)
        at_risk = False
        try:
            session.greet(patience, reset=line.get("reset", False))
            if session.restarted and transport.blocks and "on_restart" in line:
                line["on_restart"]()
            at_risk = moves
            yield session
            at_risk = False
        except KeyboardInterrupt:
            raise JobStopped(f"Stopped by {signals.reason}.") from None
        finally:
            signals.hold()
            if at_risk:
                session.stop()
            session.close()


def machine_info(port: str, **line: Unpack[LineOptions]) -> MachineInfo:
    """The identity and state of the controller at ``port``; moves and changes nothing."""
    with conversation(port, **line) as session:
        banner = session.banner
        said = session.command("$I")
        modes = ask_modes(session)
        status = _state(session)
        version = next((event for event in said if isinstance(event, Version)), None)
        options = next((event for event in said if isinstance(event, Options)), None)
        return MachineInfo(
            port=port,
            firmware=banner.firmware,
            version=banner.version,
            build=version.version if version else None,
            options=options.flags if options else None,
            planner_blocks=options.planner_blocks if options else None,
            rx_bytes=options.rx_bytes if options else None,
            state=status.state,
            position=session.position,
            machine_position=status.machine_position,
            beam_off=status.beam_off,
            modes=" ".join(modes.modes),
            startup_blocks=tuple(f"$N{n}={text}" for n, text in modes.startup.items() if text),
        )


def read_settings(port: str, **line: Unpack[LineOptions]) -> Settings:
    """The settings that the controller reports (``$$``)."""
    with conversation(port, **line) as session:
        return Settings.from_events(session.command("$$"))


def read_dump(path: Path) -> Settings:
    """The settings saved in a file; raises :class:`~miurafab.errors.ProfileError` naming it."""
    try:
        text = path.read_text("utf-8", errors="replace")
    except OSError as fault:
        raise ProfileError(f"{path} cannot be read: {fault.strerror}.") from None
    return parse_dump(text, path.name)


def write_settings(port: str, wanted: Settings, **line: Unpack[LineOptions]) -> dict[int, str]:
    """Write the settings of ``wanted`` that differ, one at a time; returns the changes, read back.

    Homing (``$22``) goes first: soft limits are refused without it. Raises
    :class:`~miurafab.errors.ControllerError` for a setting that is refused or does not stick.
    """
    with conversation(port, **line) as session:
        before = Settings.from_events(session.command("$$"))
        differing = [n for n, text in wanted.texts.items() if before.texts.get(n) != text]
        for number in sorted(differing, key=lambda n: (n != 22, n)):
            session.command(f"${number}={wanted.texts[number]}")
        after = Settings.from_events(session.command("$$"))
    left = after.differences({n: v for n, v in wanted.values.items() if n in differing})
    if left:
        raise ControllerError(f"Not every setting was taken: {', '.join(map(str, left))}.")
    return {n: after.texts[n] for n in differing if n in after.texts}


def unlock(port: str, **line: Unpack[LineOptions]) -> StatusReport:
    """Unlock the controller after an alarm (``$X``); its position must still be right."""
    with conversation(port, **line) as session:
        session.command("$X")
        return _state(session)


def home(port: str, **line: Unpack[LineOptions]) -> StatusReport:
    """Run the homing cycle (``$H``) and wait for its end."""
    with conversation(port, moves=True, **line) as session:
        session.home()
        return _state(session)


def jog(
    port: str,
    *,
    x: float | None = None,
    y: float | None = None,
    feed_mm_min: float = 1000.0,
    absolute: bool = False,
    **line: Unpack[LineOptions],
) -> StatusReport:
    """Move by ``x`` and ``y`` mm (``absolute``: to these work coordinates), beam off, and wait.

    Raises :class:`~miurafab.errors.InputError` if neither is given,
    :class:`~miurafab.errors.ControllerError` if the controller refuses, as for a target outside
    its soft limits.
    """
    words = "".join(f"{a}{v:.3f}" for a, v in (("X", x), ("Y", y)) if v is not None)
    if not words:
        raise InputError("A jog needs a distance along X, along Y, or both.")
    mode = "G90" if absolute else "G91"
    with conversation(port, moves=True, **line) as session:
        session.command(f"$J=G21{mode}{words}F{feed_mm_min:g}")
        while True:
            status = session.wait_status()
            if status.state == "Idle":
                return _state(session)
            if status.state != "Jog":
                raise ControllerError(f"The jog ended in state {status.state}.")
            session.pause(_POLL_S)


def _state(session: Session) -> StatusReport:
    """The state, with positions in mm: ``$$`` tells the unit in which they are reported."""
    session.ask("$$")
    return session.wait_status()


def talk(
    port: str,
    lines: Iterable[str],
    tell: Callable[[str], None],
    **line: Unpack[LineOptions],
) -> None:
    """Send ``lines`` one at a time as they come, and ``tell`` the answers of the controller.

    ``?``, ``!`` and ``~`` alone on a line are the realtime bytes, ``reset`` is a soft reset. A
    refused line is told and does not end the conversation. At the end the function waits for dark
    moves. Then, and on every way out, it resets the controller unless that is idle with the beam
    off.
    """
    signals = StopSignals()
    with conversation(port, moves=True, signals=signals, **line) as session:
        heard = bytearray()

        def hear(data: bytes) -> None:
            heard.extend(data)
            while b"\n" in heard:
                line, _, rest = heard.partition(b"\n")
                heard[:] = rest
                if line.strip():
                    tell(line.decode("ascii", "backslashreplace").strip())

        session.on_data = hear
        for each in _awaited(lines, signals):
            text = each.strip()
            try:
                if text in _REALTIME:
                    session.write(session.connection.send_realtime(_REALTIME[text]))
                    session.pause(_POLL_S)
                elif text:
                    bare = next(Job("The console", text).send_lines(), None)
                    if bare is not None:
                        session.command(bare.data.decode("ascii"), HOMING_S)
            except (ControllerError, GcodeError) as error:
                tell(str(error))
        status = session.wait_status()
        while status.state in ("Run", "Jog") and not status.beam_on:
            session.pause(_POLL_S)
            status = session.wait_status()
        if status.beam_on or status.state != "Idle":
            session.stop()


def _awaited(lines: Iterable[str], signals: StopSignals) -> Iterator[str]:
    """``lines``; a signal ends the wait for a line, since no read of the wire is torn then."""
    iterator, at_once = iter(lines), signals.at_once
    while True:
        signals.at_once = True
        try:
            signals.check()
            line = next(iterator, None)
        finally:
            signals.at_once = at_once
        if line is None:
            return
        yield line


_REALTIME = {"?": b"?", "!": b"!", "~": b"~", "reset": b"\x18"}
