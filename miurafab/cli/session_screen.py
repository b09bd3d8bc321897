"""The screen of a machine session: a few lines that are drawn again, and what each key does.

The lines fit 80 columns and need no more of a terminal than to move the cursor up and to clear a
line. A terminal that cannot (``TERM=dumb``) gets each new state as a line of its own. Colour is
used only for the state, and not with ``NO_COLOR``.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable
from typing import TextIO

from miurafab.errors import MiurafabError
from miurafab.machine.keys import DOWN, KEYS, LEFT, PAGE_DOWN, PAGE_UP, RESET, RIGHT, UP
from miurafab.machine.known_controller import MachineState
from miurafab.workflow.at_machine import STEPS, Operator
from miurafab.workflow.dry_run import clock_text

_WAYS = {UP: (0, 1), DOWN: (0, -1), RIGHT: (1, 0), LEFT: (-1, 0)}
_SAID_LINES = 5
_DRAW_S = 0.1
_DUMB_S = 1.0
_COLOURS = {"Idle": "32", "Run": "33", "Jog": "33", "Home": "33", "Hold": "35", "Alarm": "31"}
HELP = (
    "arrows  jog by a step, hold to go on           PgUp PgDn or > <  the step",
    "o  origin here (G92)   g  go to the origin     h  home         u  unlock",
    "f  frame the sheet     a then s  arm, start    n  next sheet  m  new material",
    "space  hold            r  resume               q  stop: reset, dark",
    "+ - 0  feed            ] [ p  power            :  a line for the controller",
    "Ctrl-X  reset now      x  leave, dark (Ctrl-C: now)  ?  hides these lines",
)


class SessionScreen:
    """Draws an ``operator`` on ``out`` and carries out keys; ``done`` once the person leaves.

    ``failure`` is what ended the last action that failed.
    """

    def __init__(self, operator: Operator, out: TextIO = sys.stdout) -> None:
        self.done = False
        self.failure: MiurafabError | None = None
        self._operator, self._out = operator, out
        self._step = 1
        self._helps = True
        self._typing: str | None = None
        self._drawn: list[str] = []
        self._draw_at = 0.0
        self._dumb = os.environ.get("TERM") == "dumb" or not _moves_cursor(out)
        self._colours = not self._dumb and not os.environ.get("NO_COLOR")

    # The keys

    def press(self, keys: str) -> None:
        """Carry out keys. Presses of one arrow that come at once are one press."""
        for key, before in zip(keys, f" {keys}", strict=False):
            if key == before and key in _WAYS:
                continue
            try:
                if self._typing is not None and KEYS.get(key) != RESET:
                    self._type(key)
                else:
                    self._act(key)
            except MiurafabError as error:
                self._operator.said.append(str(error))

    def _act(self, key: str) -> None:
        operator, step = self._operator, STEPS[self._step]
        if key in _WAYS:
            x, y = _WAYS[key]
            operator.nudge(x * step, y * step)
        elif key in (PAGE_UP, ">"):
            self._step = min(self._step + 1, len(STEPS) - 1)
        elif key in (PAGE_DOWN, "<"):
            self._step = max(self._step - 1, 0)
        elif key in KEYS:
            operator.press(key)
        elif key == "?":
            self._helps = not self._helps
        elif key == ":":
            self._typing = ""
        elif key == "x":
            self.done = True
        elif key in self._actions:
            self._actions[key]()
        else:
            operator.armed = False

    @property
    def _actions(self) -> dict[str, Callable[[], None]]:
        operator = self._operator
        return {
            "o": lambda: operator.do("set_origin"),
            "g": lambda: operator.do("go_to_origin"),
            "h": lambda: operator.do("home"),
            "u": lambda: operator.do("unlock"),
            "f": operator.frame,
            "a": operator.arm,
            "s": operator.start,
            "m": operator.load,
            "n": lambda: operator.choose(operator.number % max(operator.count, 1) + 1),
        }

    def _type(self, key: str) -> None:
        assert self._typing is not None
        if key in "\r\n":
            text, self._typing = self._typing.strip(), None
            if text:
                self._operator.said.append(f"> {text}")
                self._operator.do("say", text=text)
        elif key in "\x7f\b":
            self._typing = self._typing[:-1]
        elif key.isprintable() and key.isascii():
            self._typing += key

    # The lines

    def lines(self, width: int) -> list[str]:
        """What there is to see, in lines of less than ``width`` columns."""
        operator, state = self._operator, self._operator.state
        while operator.failures:
            self.failure = operator.failures.popleft()
            operator.said.append(str(self.failure))
        text = _of_state(state) if state is not None else ["state    opening the port"]
        text.append(f"step     {STEPS[self._step]:g} mm")
        text.append(f"sheet    {operator.describe() if operator.prepared else 'no job named'}")
        text.append(f"now      {self._now()}")
        text.append("-" * min(78, width - 1))
        said = list(operator.said)[-_SAID_LINES:]
        text += said + [""] * (_SAID_LINES - len(said))
        if self._typing is not None:
            text.append(f"line: {self._typing}_   (Enter sends it)")
        elif self._helps:
            text += HELP
        else:
            text.append("? lists the keys")
        return [line[: width - 1] for line in text]

    def _now(self) -> str:
        operator = self._operator
        if operator.armed:
            return "ARMED: s burns this sheet, any other key does not"
        progress = operator.progress
        if progress is not None:
            doing = "held" if operator.held else "burning"
            return (
                f"{doing}: stroke {progress.stroke} of {progress.strokes}, "
                f"{clock_text(progress.seconds_left)} left (space holds, r resumes, q stops)"
            )
        return operator.busy.replace("_", " ") or "waits for a key"

    def draw(self, *, last: bool = False) -> None:
        """Draw what has changed, not more often than a person can see."""
        now = time.monotonic()
        if now < self._draw_at and not last:
            return
        self._draw_at = now + (_DUMB_S if self._dumb else _DRAW_S)
        width = max(40, min(shutil.get_terminal_size().columns, 100))
        lines = self.lines(width)
        if lines == self._drawn:
            return
        if self._dumb:
            new = [line for line in lines if line and line not in self._drawn]
            self._out.write("".join(f"{line}\n" for line in new))
        else:
            up = f"\x1b[{len(self._drawn)}A" if self._drawn else ""
            body = "".join(f"\r{self._coloured(line)}\x1b[K\n" for line in lines)
            self._out.write(f"{up}{body}\x1b[J")
        self._out.flush()
        self._drawn = lines

    def _coloured(self, line: str) -> str:
        word = line[9:].partition(" ")[0].partition(":")[0] if line.startswith("state") else ""
        if not self._colours or word not in _COLOURS:
            return line
        return line.replace(word, f"\x1b[{_COLOURS[word]}m{word}\x1b[0m", 1)


def _of_state(state: MachineState) -> list[str]:
    beam = "beam ON" if state.beam_on else "beam off" if state.beam_off else "beam not told"
    pins = f"   pins {state.pins}" if state.pins else ""
    shift = any(abs(value) > 5e-4 for value in state.shift[:2])
    loaded = f"burnt by {state.loaded}" if state.loaded else "fresh"
    return [
        f"machine  {state.port}   {state.firmware}",
        f"state    {state.state:<10} {beam}{pins}   sheet in it: {loaded}",
        f"work     {_xy(state.position)}   machine  {_xy(state.machine_position)}",
        f"origin   {_xy(state.work_offset)} of the machine{', set here (G92)' if shift else ''}",
        f"modes    {' '.join(state.modes) or 'not told yet'}",
        f"override {state.overrides.words or 'none: feed, rapid rate and power as written'}",
    ]


def _xy(place: tuple[float, ...] | None) -> str:
    return "not told" if place is None else f"X{place[0]:9.3f} Y{place[1]:9.3f}"


def _moves_cursor(out: TextIO) -> bool:
    """Whether ``out`` obeys the sequences that move its cursor; a Windows console is told to."""
    if not out.isatty():
        return False
    if sys.platform == "win32":
        import ctypes

        # ENABLE_VIRTUAL_TERMINAL_PROCESSING on STD_OUTPUT_HANDLE (consoleapi.h).
        kernel, mode = ctypes.windll.kernel32, ctypes.c_uint32()
        handle = kernel.GetStdHandle(-11)
        known = kernel.GetConsoleMode(handle, ctypes.byref(mode))
        return bool(known and kernel.SetConsoleMode(handle, mode.value | 4))
    return True
