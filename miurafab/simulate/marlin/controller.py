"""A simulated Marlin controller: bytes in, bytes out, and time only by ``advance``.

It models what a sender meets: line numbers and checksums, a queue of four commands, ``ok`` delayed
while the planner is full, ``busy`` every two seconds, M112 and M410 with or without the emergency
parser, and a laser whose power goes with the moves (``M3 I``, ``M4 I``). Parsing takes no time.
Sources: MarlinFirmware/Marlin, ``queue.cpp``, ``e_parser.cpp``, ``M3-M5.cpp``.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Generator

from miurafab.gcode.block_errors import BlockError
from miurafab.gcode.execution import StraightMove, execute
from miurafab.gcode.marlin import grbl_words
from miurafab.gcode.parser import ModalState, ReaderRules, parse_block
from miurafab.marlin.connection import checksum
from miurafab.motion.parameters import MotionParameters
from miurafab.simulate.beam import BeamSegment
from miurafab.simulate.marlin.carriage import Carriage

QUEUE = 4
"""The commands that can wait (``BUFSIZE``)."""
RX_RING = 128
LONGEST_LINE = 95
"""The characters kept of a line; the rest is dropped (``MAX_CMD_SIZE``)."""
_BUSY_S = 2.0  # unless M113 says otherwise
_STOCK_FEED = 1500.0  # mm/min, before any F
_LINE = re.compile(r"(?:N(\d+) ?)?([^*]*)(?:\*(\d+))?")
_WORD = re.compile(r"([A-Z])([-+]?[\d.]*)")
_NAME = re.compile(r"([GM])0*(\d+)(?:\.\d+)?(?=[A-Z]|$)")
_CUTTER = re.compile(r"M0*([345])(I?)(?:S([\d.]+))?(I?)$")

CommandRoutine = Generator[Callable[[], bool], None, None]
"""A command in execution: it yields the condition for which it waits."""


class VirtualMarlin:
    """The device side of a Marlin connection. With ``baud`` None bytes take no time.

    At power-up ``start`` is in the output.
    """

    resets_on_open = True

    def __init__(
        self,
        parameters: MotionParameters,
        *,
        baud: int | None = None,
        emergency_parser: bool = True,
    ) -> None:
        self.now = 0.0
        self.beam_log: list[BeamSegment] = []
        self.lost_bytes = 0
        self.connected = True
        self.homed = 0
        self._parameters = parameters
        self._byte = 10.0 / baud if baud else 0.0
        self._emergency_parser = emergency_parser
        self._coming: deque[tuple[float, int]] = deque()
        self._going: deque[tuple[float, int]] = deque()
        self._in_free = self._out_free = 0.0
        self._carriage = Carriage(parameters, self.beam_log)
        self.power_cycle()

    def power_cycle(self) -> None:
        """Switch off and on: all state is lost."""
        self._coming.clear()
        self._going.clear()
        self.killed = False
        self._state = ModalState()
        self._carriage.halt(self.now)
        self._carriage.stand(self.now, 0.0)
        self._carriage = Carriage(self._parameters, self.beam_log)
        self._ring: deque[int] = deque()
        self._text = bytearray()
        self._early = bytearray()
        self._queue: deque[str] = deque()
        self._command: CommandRoutine | None = None
        self._condition: Callable[[], bool] = _now
        self._busy_at = self._wake_at = math.inf
        self._thaws_at = -math.inf
        self._stop_at_thaw: bool | None = None  # True: a kill
        self._busy_period = _BUSY_S
        self._count = 0
        self._inline = False
        self._power = 0.0
        self._say("start")

    def freeze(self, seconds: float = math.inf) -> None:
        """The main program hangs: it answers nothing, and the planned motion runs out."""
        self._thaws_at = self.now + seconds

    # Time

    def advance(self, seconds: float) -> None:
        """Let ``seconds`` of virtual time pass."""
        self._run(self.now + max(seconds, 0.0), stop_at_line=False)

    def advance_to_line(self, seconds: float) -> None:
        """Let time pass until a line of output is out, ``seconds`` at the most."""
        self._run(self.now + max(seconds, 0.0), stop_at_line=True)

    def next_event_in(self) -> float | None:
        """Seconds until the next change without input; None if there is none."""
        event = min(self._events())
        return None if math.isinf(event) else max(0.0, event - self.now)

    def _events(self) -> tuple[float, ...]:
        return (
            self._coming[0][0] if self._coming else math.inf,
            next((at for at, _ in self._going if at > self.now), math.inf),
            self._carriage.due,
            self._main_due(),
        )

    def _main_due(self) -> float:
        """The time of the main program's next step, or of the end of its hang."""
        return self._thaws_at if self._frozen else min(self._busy_at, self._wake_at)

    @property
    def _frozen(self) -> bool:
        return self.now < self._thaws_at

    def _run(self, target: float, *, stop_at_line: bool) -> None:
        while True:
            if stop_at_line:
                line = next((at for at, byte in self._going if byte == ord("\n")), math.inf)
                target = min(target, max(line, self.now))
            arrival = self._coming[0][0] if self._coming else math.inf
            motion = self._carriage.due
            event = min(arrival, motion, self._main_due())
            if event > target:
                break
            self.now = max(self.now, event)
            if arrival <= self.now:
                self._arrive(self._coming.popleft()[1])
            if motion <= self.now:
                self._carriage.go_on(self.now)
            if self._frozen:
                continue
            if self._stop_at_thaw is not None:
                self._emergency(self._stop_at_thaw)
                self._stop_at_thaw = None
            if self._busy_at <= self.now:
                self._say("echo:busy: processing")
                self._busy_at = self.now + self._busy_period
            if self._wake_at <= self.now:
                self._wake_at = math.inf
            self._work()
        self.now = max(self.now, target)

    # The wire

    def receive(self, data: bytes) -> None:
        """Bytes start on the wire to the controller."""
        for byte in data:
            self._in_free = max(self._in_free, self.now) + self._byte
            self._coming.append((self._in_free, byte))
        self._run(self.now, stop_at_line=False)

    def take_output(self) -> bytes:
        """The bytes that came out since the last call."""
        out = bytearray()
        while self._going and self._going[0][0] <= self.now:
            out.append(self._going.popleft()[1])
        return bytes(out)

    def _say(self, text: str) -> None:
        for byte in text.encode("ascii", "replace") + b"\n":
            self._out_free = max(self._out_free, self.now) + self._byte
            self._going.append((self._out_free, byte))

    def _arrive(self, byte: int) -> None:
        if self.killed:
            return
        if self._emergency_parser:
            self._look_for_emergency(byte)
        if len(self._ring) < RX_RING:
            self._ring.append(byte)
        else:
            self.lost_bytes += 1

    def _look_for_emergency(self, byte: int) -> None:
        if byte not in b"\r\n":
            self._early.append(byte)
            return
        line, self._early = bytes(self._early), bytearray()
        match = re.match(rb"\s*(?:N\d+\s*)?(M112|M410)(?!\d)", line)
        if match is not None and self._frozen:  # only the main program acts on it
            self._stop_at_thaw = self._stop_at_thaw or match[1] == b"M112"
        elif match is not None:
            self._emergency(match[1] == b"M112")

    def _emergency(self, kill: bool) -> None:
        """Stop at once; with ``kill`` until a reset."""
        self._state.position = self._carriage.halt(self.now)
        if kill:
            self._carriage.stand(self.now, 0.0)
            self._ring.clear()
            self._queue.clear()
            self._command, self._busy_at = None, math.inf
            self.killed = True
            self._say("Error:Printer halted. kill() called!")

    # The main loop

    def _work(self) -> None:
        """Execute commands until one must wait."""
        while not self.killed:
            if self._command is not None:
                if not self._condition():
                    return
                try:
                    self._condition = next(self._command)
                    self._busy_at = min(self._busy_at, self.now + self._busy_period)
                except StopIteration:
                    self._command, self._busy_at = None, math.inf
                    self._say("ok")
                continue
            self._read()
            if not self._queue:
                return
            self._command, self._condition = self._obey(self._queue.popleft()), _now

    def _read(self) -> None:
        while self._ring and len(self._queue) < QUEUE and not self.killed:
            byte = self._ring.popleft()
            if byte not in b"\r\n":
                if len(self._text) < LONGEST_LINE:
                    self._text.append(byte)
                continue
            text = self._text.decode("ascii", "replace").partition(";")[0]
            self._text.clear()
            if text.strip():
                self._enqueue(text)

    def _enqueue(self, text: str) -> None:
        match = _LINE.fullmatch(text)
        number, code = (match[1], match[2]) if match else (None, text)
        code = code.replace(" ", "").upper()
        if match is not None and number is not None:
            anew = code.startswith("M110")
            body = text.rpartition("*")[0].encode("ascii", "replace")
            if not anew and int(number) != self._count + 1:
                return self._refuse("Line Number is not Last Line Number+1")
            if match[3] is None:
                return self._refuse("No Checksum with line number")
            if int(match[3]) != checksum(body):
                return self._refuse("checksum mismatch")
            self._count = int(code.partition("N")[2] or number) if anew else int(number)
        if code in ("M112", "M410") and not self._emergency_parser:
            self._emergency(code == "M112")
        self._queue.append(code)
        return None

    def _refuse(self, why: str) -> None:
        self._ring.clear()
        self._say(f"Error:{why}, Last Line: {self._count}")
        self._say(f"Resend: {self._count + 1}")
        self._say("ok")

    # Commands

    def _obey(self, code: str) -> CommandRoutine:
        name = _NAME.match(code)
        words = dict(_WORD.findall(code[name.end() :] if name else ""))
        said = f"{name[1]}{name[2]}" if name else ""
        cutter = _CUTTER.fullmatch(code)
        if cutter is not None:
            yield from self._cutter(cutter)
        elif said in ("M110", "M112", "M410", "M106", "M107", "M8", "M9", "M17", "M220"):
            if said == "M220" and "S" in words:
                self._carriage.planner.override(round(float(words["S"])), 100)
        elif said == "M113":
            self._busy_period = float(words.get("S") or 0) or math.inf
        elif said == "M115":
            self._say("FIRMWARE_NAME:Marlin 2.1.2 (virtual) PROTOCOL_VERSION:1.0 EXTRUDER_COUNT:0")
            self._say(f"Cap:EMERGENCY_PARSER:{int(self._emergency_parser)}")
        elif said == "M114":
            x, y, z = self._carriage.place(self.now)
            self._say(f"X:{x:.2f} Y:{y:.2f} Z:{z:.2f} E:0.00")
        elif said == "M400":
            yield self._at_rest
        elif said == "G4":
            yield self._at_rest
            seconds = float(words.get("P") or 0) / 1000 + float(words.get("S") or 0)
            yield from self._until(self.now + seconds)
        elif said in ("M0", "M1") and self._emergency_parser:
            yield self._at_rest
            yield lambda: False  # until somebody presses its button
        elif said == "G28":
            yield self._at_rest
            self.homed += 1
            yield from self._until(self.now + 3.0)
            self._state.position = [0.0, 0.0, 0.0]
            self._carriage.put(self._state.position)
        else:
            yield from self._gcode(code)

    def _until(self, end: float) -> CommandRoutine:
        self._wake_at = end
        yield lambda: self.now >= end

    def _cutter(self, match: re.Match[str]) -> CommandRoutine:
        off = match[1] == "5"
        self._inline = bool(match[2] or match[4]) and not off
        power = float(match[3] or 0) / self._parameters.s_max
        if self._inline:
            self._power = 0.0
            return
        yield self._at_rest
        self._power = 0.0
        self._carriage.stand(self.now, 0.0 if off else power)

    def _gcode(self, code: str) -> CommandRoutine:
        try:
            code = grbl_words(code)
        except ValueError:
            self._say(f'echo:Unknown command: "{code}"')
            return
        state, rules = self._state, ReaderRules(arc_tolerance=0.1)
        state.feed = state.feed or _STOCK_FEED
        try:
            block = parse_block(code, state, lambda index: (0.0, 0.0, 0.0), rules)
        except BlockError:
            self._say(f'echo:Unknown command: "{code}"')
            return
        rapid = block.motion == 0
        self._power = 0.0 if rapid else block.words.get("S", self._power)
        for action in execute(block, state, rules):
            if isinstance(action, StraightMove):
                yield lambda: not self._carriage.planner.full
                power = self._power if self._inline else 0.0
                self._carriage.plan(self.now, action.target, state.feed, power)

    def _at_rest(self) -> bool:
        self._carriage.hurry(self.now)
        return not self._carriage.planner.moves

    @property
    def beam_on(self) -> bool:
        """Whether the beam is on."""
        return self._carriage.burning


def _now() -> bool:
    return True
