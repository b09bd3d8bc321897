"""Actions on a machine besides cutting: query it, home it, unlock it, move it.

Each function is a session (:mod:`~miurafab.machine.machine_session`) with one action: it opens the
port, greets the controller, does one thing and closes the port. The controller is reset first on
every way out that leaves it moving or the beam on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict, Unpack

from miurafab.errors import ControllerError, GcodeError, JobStopped, ProfileError
from miurafab.files import MOST_TEXT_BYTES, Reading, read_bytes
from miurafab.grbl.settings import Settings, parse_dump
from miurafab.machine.jog_pad import require_way
from miurafab.machine.known_controller import MachineState
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import open_port
from miurafab.profiles.machine import BAUD, WAIT_S


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
    signals: StopSignals | None = None,
    **line: Unpack[LineOptions],
) -> Iterator[MachineSession]:
    """A session with the controller at ``port``, open; closed at the end.

    ``signals`` are caught by the block, so that it can rule when they raise. Raises
    :class:`~miurafab.errors.JobStopped` for Ctrl-C, SIGTERM and SIGHUP, and what
    :meth:`~miurafab.machine.session.Session.greet` raises.
    """
    with signals or StopSignals() as signals:
        transport = open_port(port, line.get("baud", BAUD), line.get("settings"))
        session = MachineSession(transport, signals)
        try:
            session.open(line.get("wait", WAIT_S), reset=line.get("reset", False))
            if "on_restart" in line and session.conversation.take_restart():
                line["on_restart"]()
            yield session
        except KeyboardInterrupt:
            raise JobStopped(f"Stopped by {signals.reason}.") from None
        finally:
            session.close()


def machine_info(port: str, **line: Unpack[LineOptions]) -> MachineInfo:
    """The identity and state of the controller at ``port``; moves and changes nothing."""
    with conversation(port, **line) as session:
        known, state = session.known, session.look()
        banner, version, options = session.conversation.banner, known.version, known.options
        return MachineInfo(
            port=port,
            firmware=banner.firmware,
            version=banner.version,
            build=version.version if version else None,
            options=options.flags if options else None,
            planner_blocks=options.planner_blocks if options else None,
            rx_bytes=options.rx_bytes if options else None,
            state=state.state,
            position=state.position,
            machine_position=state.machine_position,
            beam_off=state.beam_off,
            modes=" ".join(state.modes),
            startup_blocks=tuple(
                f"$N{n}={text}" for n, text in known.modes.startup.items() if text
            ),
        )


def read_settings(port: str, **line: Unpack[LineOptions]) -> Settings:
    """The settings that the controller reports (``$$``)."""
    with conversation(port, **line) as session:
        return session.known.settings


def read_dump(path: Path) -> Settings:
    """The settings saved in a file; raises :class:`~miurafab.errors.ProfileError` naming it."""
    text = read_bytes(path, ProfileError, MOST_TEXT_BYTES).decode("utf-8", errors="replace")
    with Reading(path.name, "a list of settings", ProfileError):
        return parse_dump(text, path.name)


def write_settings(port: str, wanted: Settings, **line: Unpack[LineOptions]) -> dict[int, str]:
    """Write the settings of ``wanted`` that differ, one at a time; returns the changes, read back.

    Homing (``$22``) goes first: soft limits are refused without it. Raises
    :class:`~miurafab.errors.ControllerError` for a setting that is refused or does not stick.
    """
    with conversation(port, **line) as session:
        before = session.known.settings
        differing = [n for n, text in wanted.texts.items() if before.texts.get(n) != text]
        for number in sorted(differing, key=lambda n: (n != 22, n)):
            setting = f"${number}={wanted.texts[number]}"
            session.conversation.command(setting)
            session.known.may_differ(setting)
        session.look()
        after = session.known.settings
    left = after.differences({n: v for n, v in wanted.values.items() if n in differing})
    if left:
        raise ControllerError(f"Not every setting was taken: {', '.join(map(str, left))}.")
    return {n: after.texts[n] for n in differing if n in after.texts}


def unlock(port: str, **line: Unpack[LineOptions]) -> MachineState:
    """Unlock the controller after an alarm (``$X``); its position must still be right."""
    with conversation(port, **line) as session:
        return session.unlock()


def home(port: str, **line: Unpack[LineOptions]) -> MachineState:
    """Run the homing cycle (``$H``) and wait for its end."""
    with conversation(port, **line) as session:
        return session.home()


def jog(
    port: str,
    *,
    x: float | None = None,
    y: float | None = None,
    feed_mm_min: float = 1000.0,
    absolute: bool = False,
    **line: Unpack[LineOptions],
) -> MachineState:
    """See :meth:`~miurafab.machine.machine_session.MachineSession.jog`."""
    require_way(x, y)
    with conversation(port, **line) as session:
        return session.jog(x=x, y=y, feed_mm_min=feed_mm_min, absolute=absolute)


def talk(
    port: str,
    lines: Iterable[str],
    tell: Callable[[str], None],
    **line: Unpack[LineOptions],
) -> None:
    """Send ``lines`` one at a time as they come; ``tell`` the modes in force at the start, and the
    answers of the controller.

    ``?``, ``!`` and ``~`` alone on a line are the realtime bytes, ``reset`` is a soft reset. A
    refused line is told and does not end the conversation. At the end the function waits for dark
    moves. Then, and on every way out, it resets the controller unless that is idle with the beam
    off.
    """
    signals = StopSignals()
    with conversation(port, signals=signals, **line) as session:
        tell(f"Modes in force: {' '.join(session.state.modes) or 'not told'}")
        session.lines.on_line = tell
        for each in _awaited(lines, signals):
            try:
                session.say(each)
            except (ControllerError, GcodeError) as error:
                tell(str(error))
        session.settle()


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
