"""``miurafab machine open``: one session with a machine, in a terminal or by lines of words."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import sys
import threading
from collections import deque
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

from miurafab.cli.console import Console
from miurafab.cli.declared import MachineOption, Named, argument, option, takes
from miurafab.errors import DONE, InputError, JobStopped, MachineError
from miurafab.options import Text, length, read_options
from miurafab.profiles.own import own_defaults

if TYPE_CHECKING:
    from miurafab.machine.known_controller import MachineState
    from miurafab.machine.signals import StopSignals
    from miurafab.workflow.at_machine import Operator
    from miurafab.workflow.cut_options import CutOptions

EXAMPLES = (
    "miurafab machine open /dev/ttyUSB0 jobs/hypar",
    "miurafab machine open virtual",
    "printf 'jog x10 y5\\norigin\\n' | miurafab machine open virtual",
)

_AT_ONCE = {
    "hold": " ",
    "resume": "r",
    "stop": "q",
    "feed +": "+",
    "feed -": "-",
    "feed 100": "0",
    "power +": "]",
    "power -": "[",
    "power 100": "p",
}
_ACTIONS = {
    "home": "home",
    "unlock": "unlock",
    "origin": "set_origin",
    "go": "go_to_origin",
    "status": "look",
}
_OTHERS = ("jog x10 y-5", "jog to x0 y0", "frame", "start", "fresh", "sheet 2", "say LINE", "quit")
_WORDS = ", ".join((*_OTHERS, *_ACTIONS, *_AT_ONCE))


def _session_options() -> type[CutOptions]:
    from miurafab.workflow.cut_options import CutOptions

    return CutOptions


@takes(
    _session_options,
    without=("home", "at", "check_mode", "resume", "from_stroke", "frame", "align"),
)
def open_(
    place: Annotated[
        str | None, argument("PORT", "As --port. Without either it is that of 'miurafab use'.")
    ] = None,
    thing: Annotated[
        Named | None, argument("THING", "A job directory or a G-code file to frame and to cut.")
    ] = None,
    /,
    *,
    port: Annotated[
        str | None,
        option(Text("PORT"), "A serial device, a pyserial URL (socket://HOST:PORT), or 'virtual'."),
    ] = None,
    machine: MachineOption = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Hold one session with a machine: jog, home, frame, cut without a reset.

    In a terminal it is a small screen, and ? lists its keys. Else it reads words, one action a
    line, and ends at the end of the input: jog x10 y-5, jog to x0 y0, home, unlock, origin, go,
    frame, start, fresh, sheet 2, status, say LINE, quit. The words hold, resume, stop, feed + or
    - or 100, power + or - or 100 act at once. However it ends, the machine is left dark.
    """
    from miurafab.machine.known_controller import require_talk
    from miurafab.machine.session_process import SessionProcess, suspending_signals
    from miurafab.machine.transport import VIRTUAL, require_port
    from miurafab.profiles import read_machine
    from miurafab.workflow.at_machine import Operator
    from miurafab.workflow.cut import prepare

    if port is not None and place is not None and thing is None:
        place, thing = None, place
    port = port or place or own_defaults().port
    if port is None:
        raise InputError(
            "Name the machine's `port` ('virtual' needs no machine; 'miurafab use' names it once)."
        )
    options: CutOptions = read_options(_session_options(), given)
    require_port(port)
    prepared = None if thing is None else prepare(thing, machine=machine, unread=options.unread)
    profile = read_machine(machine) if prepared is None else prepared.machine
    require_talk(profile.dialect)
    screen = sys.stdin.isatty() and sys.stdout.isatty() and not console.wants_json
    with suspending_signals() as signals:
        signals.at_once = False
        speed = 1.0 if port == VIRTUAL and screen else None
        process = SessionProcess(profile, port, signals, speed)
        operator = Operator(process, prepared, options)
        how = ""
        try:
            if screen:
                _by_keys(operator)
            else:
                _by_words(operator, console)
        finally:
            how = operator.close()
        _say_how(signals, how)
    return DONE


def _say_how(signals: StopSignals, how: str) -> None:
    if how:
        raise MachineError(how)
    if signals.caught is not None:
        raise JobStopped(f"The session was ended by {signals.reason}.")


def _by_keys(operator: Operator) -> None:
    from miurafab.cli.session_screen import SessionScreen
    from miurafab.machine.keys import terminal_keys

    screen = SessionScreen(operator)
    with terminal_keys(arrows=True) as keys:
        while not screen.done and not operator.over:
            operator.take()
            screen.press(keys.pressed())
            screen.draw()
        screen.draw(last=True)
    if operator.over and screen.failure is not None:
        raise screen.failure


def _by_words(operator: Operator, console: Console) -> None:
    """Carry out lines of words; raises the error of the first that fails."""
    lines = _Lines()
    asked = ""
    while not operator.over:
        operator.take()
        while operator.said:
            _answer(console, said=operator.said.popleft())
        while operator.failures:
            error = operator.failures.popleft()
            if not isinstance(error, JobStopped) or operator.over:
                raise error
            _answer(console, said=str(error))
            asked = ""
        if asked and not operator.busy:
            _answer(console, line=asked, state=operator.state)
            asked = ""
        line = lines.next(busy=bool(operator.busy), overtakes=bool(asked))
        while lines.void:
            _answer(console, said=f"'{lines.void.popleft()}' was stopped before it was begun.")
        if line is None:
            if lines.ended and not operator.busy:
                return
            if lines.ended and operator.held:
                operator.press("q")  # nobody is there to resume it
        elif line in _AT_ONCE:
            operator.press(_AT_ONCE[line])
            _answer(console, line=line, state=operator.state)
        elif line == "quit":
            return
        else:
            _carry_out(operator, line)
            asked = line


def _carry_out(operator: Operator, line: str) -> None:
    word, _, rest = line.partition(" ")
    if word in _ACTIONS and not rest:
        operator.do(_ACTIONS[word])
    elif word == "jog":
        operator.do("jog", **_jog(rest))
    elif word == "say" and rest:
        operator.do("say", text=rest)
    elif line == "frame":
        operator.frame()
    elif line == "start":
        operator.arm()
        operator.start()
    elif line == "fresh":
        operator.load()
    elif word == "sheet" and rest.isdigit():
        operator.choose(int(rest))
    else:
        raise InputError(f"'{line}' is no action of a session; there are {_WORDS}.")


def _jog(words: str) -> dict[str, object]:
    """The options of a jog written as ``x10 y-5`` or ``to x0 y0 f3000``."""
    options: dict[str, object] = {}
    names = {"x": "x", "y": "y", "f": "feed_mm_min"}
    for word in words.split():
        name = names.get(word[0].lower())
        if word == "to":
            options["absolute"] = True
        elif name is None:
            raise InputError(f"A jog is written 'jog x10 y-5' or 'jog to x0 y0', not '{words}'.")
        else:
            try:
                options[name] = length(-1e6).read(word[1:])
            except ValueError as fault:
                raise InputError(f"'{word}' in 'jog {words}' {fault}.") from None
    return options


def _answer(
    console: Console,
    *,
    line: str | None = None,
    said: str | None = None,
    state: MachineState | None = None,
) -> None:
    """One answer: a line for people, or a JSON object in a line."""
    if console.wants_json:
        values: dict[str, object] = {"said": said} if line is None else {"line": line}
        if state is not None:
            told = asdict(state)
            del told["settings"]
            values["state"] = told | {
                "overrides": state.overrides._asdict(),
                "loaded": state.loaded and state.loaded.name,
            }
        sys.stdout.write(json.dumps(values) + "\n")
        sys.stdout.flush()
    elif line is None:
        console.line(f"  {said}")
    elif state is None:
        console.line(f"{line}: the port is being opened")
    else:
        console.line(
            f"{line}: {state.state}, work {_xy(state.position)}, "
            f"machine {_xy(state.machine_position)}"
        )


def _xy(place: tuple[float, ...] | None) -> str:
    return "not told" if place is None else f"X{place[0]:.3f} Y{place[1]:.3f}"


class _Lines:
    """Lines of standard input, read without waiting; ``void`` are those that a stop overtook."""

    def __init__(self) -> None:
        self.void: deque[str] = deque()
        self._whole = False
        self._waiting: list[str] = []
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        # Not sys.stdin's own buffer, whose lock this thread would hold at the end of the program.
        threading.Thread(target=self._read, name="miurafab words", daemon=True).start()

    def _read(self) -> None:
        coming = b""
        with contextlib.suppress(OSError):
            while data := os.read(sys.stdin.fileno(), 4096):
                *whole, coming = (coming + data).split(b"\n")
                for line in whole:
                    self._lines.put(line.decode("utf-8", "replace"))
        self._lines.put(coming.decode("utf-8", "replace"))
        self._lines.put(None)

    @property
    def ended(self) -> bool:
        """Whether the last line was taken."""
        return self._whole and not self._waiting

    def next(self, *, busy: bool, overtakes: bool) -> str | None:
        """The next line that is not empty and can be carried out now, None if there is none: while
        the session is ``busy`` a word that acts at once, which ``overtakes`` the actions that wait.
        """
        with contextlib.suppress(queue.Empty):
            while not self._whole:
                line = self._lines.get_nowait()
                self._whole = line is None
                self._waiting += [" ".join(line.split())] if line and line.strip() else []
        for place, line in enumerate(self._waiting[: None if overtakes else 1]):
            if line in _AT_ONCE or not busy:
                if line == "stop":
                    self.void.extend(self._waiting[:place])
                    del self._waiting[:place]
                self._waiting.remove(line)
                return line
        return None
