"""The G-code parser: one line, checked against the modal state, becomes a block or an error.

The checks are GRBL's, in GRBL's order (``gcode.c``): first each word, then the block as a whole. A
refused block leaves the state unchanged. :mod:`miurafab.gcode.execution` executes a block.

Legend: positions and offsets in mm, feeds in mm/min (or 1/min with ``inverse_time``), axes as
indices 0, 1, 2 for X, Y, Z.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from miurafab.gcode import block_errors
from miurafab.gcode.arcs import centre_from_radius
from miurafab.gcode.block_errors import BlockError, Reason
from miurafab.gcode.numbers import read_single, single, whole_byte
from miurafab.gcode.words import (
    CLOCKWISE,
    COUNTERCLOCKWISE,
    DWELL,
    GO_G28,
    GO_G30,
    LINEAR,
    MACHINE,
    NO_MOTION,
    PROBES,
    SEEK,
    SET_OFFSET,
    SHIFT,
    Claim,
    Group,
    look_up,
    split_words,
)

AXES = "XYZ"
TOOL_AXIS = 2
MM_PER_INCH = 25.4
_LARGEST_LINE_NUMBER = 10_000_000
_LARGEST_TOOL = 255
_VALUES = frozenset("FIJKLNPRSTXYZ")
_NEVER_NEGATIVE = frozenset("FNPTS")
_CENTRES = ("I", "J", "K")
PLANES = ((0, 1, 2), (2, 0, 1), (1, 2, 0))
"""First, second and normal axis of G17, G18, G19."""
_JOG_GROUPS = {Group.NON_MODAL, Group.DISTANCE, Group.UNITS}

Vector = list[float]
StoredOffsets = Callable[[int], Sequence[float]]
"""The stored positions: 0 to 5 for G54 to G59, 6 for G28, 7 for G30."""


class Rules(Protocol):
    """The build options and settings of the firmware that the parser depends on."""

    @property
    def laser(self) -> bool:
        """Laser mode, $32."""

    @property
    def arc_tolerance(self) -> float:
        """The largest distance between a chord and its arc, $12, mm."""

    @property
    def mist(self) -> bool:
        """Whether this build has M7."""

    @property
    def single_precision(self) -> bool:
        """Whether to round to 32-bit floats, as the firmware does."""


@dataclass(frozen=True, slots=True)
class ReaderRules:
    """The :class:`Rules` for reading a file: every word is known, numbers are not rounded."""

    laser: bool = True
    arc_tolerance: float = 0.002
    mist: bool = True
    single_precision: bool = False


class ModalState:
    """The modes and values that persist from line to line; at power-up all are zero."""

    __slots__ = (
        "coolant", "coord_offset", "coord_system", "distance", "feed", "inches", "inverse_time",
        "motion", "offset", "plane", "position", "speed", "spindle", "tool", "tool_length",
        "tool_offset",
    )  # fmt: skip

    def __init__(self) -> None:
        self.motion = self.inverse_time = self.inches = self.distance = self.plane = 0
        self.tool_length = self.offset = self.coolant = self.spindle = self.tool = 0
        self.speed = self.feed = self.tool_offset = 0.0
        self.position: Vector = [0.0, 0.0, 0.0]
        self.coord_system: Vector = [0.0, 0.0, 0.0]
        self.coord_offset: Vector = [0.0, 0.0, 0.0]


class Block:
    """One checked line: the modes after it, and what it does.

    ``target`` is the end of its motion, or the new G92 shift; ``stored`` the G10 offset, or the
    stored position of G28 or G30; ``centre`` the vector from the start to an arc's centre.
    """

    __slots__ = (
        "action", "axes", "centre", "claim", "coolant", "coord_system", "distance", "feed",
        "groups", "inches", "inverse_time", "jog", "motion", "offset", "plane", "radius",
        "select", "speed", "spindle", "stop", "stored", "target", "tool", "tool_length", "words",
    )  # fmt: skip

    def __init__(self, state: ModalState, jog: bool) -> None:
        self.jog = jog
        self.motion = LINEAR if jog else state.motion
        self.inverse_time = 0 if jog else state.inverse_time
        self.inches = state.inches
        self.distance = state.distance
        self.plane = state.plane
        self.tool_length = state.tool_length
        self.offset = state.offset
        self.coolant = state.coolant
        self.spindle = state.spindle
        self.stop = self.action = self.select = self.tool = 0
        self.claim = Claim.NONE
        self.groups: set[Group] = set()
        self.words: dict[str, float] = {}
        self.axes: tuple[int, ...] = ()
        self.feed = self.speed = self.radius = 0.0
        self.coord_system = state.coord_system
        self.target: Vector = [0.0, 0.0, 0.0]
        self.stored: Sequence[float] = (0.0, 0.0, 0.0)
        self.centre: Vector = [0.0, 0.0, 0.0]


def parse_block(
    line: str, state: ModalState, stored: StoredOffsets, rules: Rules, *, jog: bool = False
) -> Block:
    """Parse ``line``, bare upper-case words, in ``state``.

    With ``jog`` the line is the text after ``$J=``. Raises :class:`BlockError`.
    """
    block = Block(state, jog)
    _read_words(line, block, rules)
    words = block.words
    left = set(words)
    block.axes = tuple(axis for axis in (0, 1, 2) if AXES[axis] in words)
    if block.axes and block.claim is Claim.NONE:
        block.claim = Claim.MOTION
    if words.get("N", 0.0) > _LARGEST_LINE_NUMBER:
        raise BlockError(block_errors.LINE_NUMBER, f"N{words['N']:.0f}")
    _set_feed(block, state)
    block.speed = words.get("S", state.speed)
    block.tool = int(words.get("T", 0.0))
    if block.action == DWELL:
        if "P" not in words:
            raise BlockError(block_errors.VALUE_MISSING, "G4")
        left.discard("P")
    if block.inches:
        for axis in block.axes:
            words[AXES[axis]] *= MM_PER_INCH
    if block.claim is Claim.TOOL_LENGTH and block.tool_length and block.axes != (TOOL_AXIS,):
        raise BlockError(block_errors.OFFSET_AXIS, "G43.1")
    if block.offset != state.offset:
        block.coord_system = list(stored(block.offset))
    _set_target(block, state, stored, left)
    if rules.single_precision:
        block.target = [single(value) for value in block.target]
    _check_motion(block, state, left)
    left -= {"N", "F"} if jog else {"N", "F", "S", "T"}
    if block.claim is not Claim.NONE:
        left.difference_update(AXES)
    if left:
        raise BlockError(block_errors.LEFT_OVER, min(left, key=list(words).index))
    if jog and (not block.groups <= _JOG_GROUPS or block.action not in (0, MACHINE)):
        raise BlockError(block_errors.BAD_JOG, "a mode or command")
    return block


def _read_words(line: str, block: Block, rules: Rules) -> None:
    number_of = read_single if rules.single_precision else float
    words, groups = block.words, block.groups
    for letter, text in split_words(line):
        if letter in "GM":
            command, claims = look_up(letter, text, rules.mist)
            if claims and block.claim is not Claim.NONE:
                raise BlockError(block_errors.AXES_CLAIMED_TWICE, letter + text)
            if isinstance(command, Reason):
                raise BlockError(command, letter + text)
            if command.group in groups:
                raise BlockError(block_errors.GROUP_CONFLICT, letter + text)
            groups.add(command.group)
            if command.claim is not Claim.NONE:
                block.claim = command.claim
            if command.slot == "coolant" and command.value:
                block.coolant |= command.value
            elif command.slot:
                setattr(block, command.slot, command.value)
            continue
        if letter not in _VALUES:
            raise BlockError(block_errors.UNSUPPORTED, letter + text)
        value = number_of(text)
        if letter == "T" and value > _LARGEST_TOOL:
            raise BlockError(block_errors.TOOL_NUMBER, letter + text)
        if letter in words:
            raise BlockError(block_errors.WORD_REPEATED, letter)
        if value < 0.0 and letter in _NEVER_NEGATIVE:
            raise BlockError(block_errors.NEGATIVE, letter + text)
        words[letter] = value


def _set_feed(block: Block, state: ModalState) -> None:
    """F persists in G94; in G93 each feed move needs an F, and a change to G94 clears it."""
    feed = block.words.get("F")
    if block.jog:
        if feed is None:
            raise BlockError(block_errors.NO_FEED, "a jog")
        block.feed = feed * MM_PER_INCH if block.inches else feed
    elif block.inverse_time:
        moves = block.claim is Claim.MOTION and block.motion not in (NO_MOTION, SEEK)
        if moves and feed is None:
            raise BlockError(block_errors.NO_FEED, "a move under G93")
        block.feed = feed or 0.0
    elif state.inverse_time:
        block.feed = feed or 0.0
    elif feed is None:
        block.feed = state.feed
    else:
        block.feed = feed * MM_PER_INCH if block.inches else feed


def _set_target(block: Block, state: ModalState, stored: StoredOffsets, left: set[str]) -> None:
    """The meaning of the axis words: an offset (G10, G92) or a position in machine coordinates."""
    words, position = block.words, state.position
    if block.action == SET_OFFSET:
        _set_offset(block, state, stored, left)
        return
    if block.action == SHIFT:
        if not block.axes:
            raise BlockError(block_errors.NO_AXES, "G92")
        block.target = list(state.coord_offset)
        for axis in block.axes:
            block.target[axis] = position[axis] - block.coord_system[axis] - words[AXES[axis]]
            if axis == TOOL_AXIS:
                block.target[axis] -= state.tool_offset
        return
    if block.claim is Claim.TOOL_LENGTH:
        block.target[TOOL_AXIS] = words.get("Z", 0.0)
    elif block.axes:
        target = block.target = list(position)
        for axis in block.axes:
            value = words[AXES[axis]]
            if block.action == MACHINE:
                target[axis] = value
            elif block.distance:
                target[axis] += value
            else:
                target[axis] = value + block.coord_system[axis] + state.coord_offset[axis]
                if axis == TOOL_AXIS:
                    target[axis] += state.tool_offset
    if block.action in (GO_G28, GO_G30):
        home = stored(6 if block.action == GO_G28 else 7)
        if block.axes:
            block.stored = [home[i] if i in block.axes else position[i] for i in (0, 1, 2)]
        else:
            block.stored = list(home)
            block.claim = Claim.NONE
    elif block.action == MACHINE and block.motion not in (SEEK, LINEAR):
        raise BlockError(block_errors.G53_MOTION, "G53")


def _set_offset(block: Block, state: ModalState, stored: StoredOffsets, left: set[str]) -> None:
    words = block.words
    if not block.axes:
        raise BlockError(block_errors.NO_AXES, "G10")
    if "P" not in words and "L" not in words:
        raise BlockError(block_errors.VALUE_MISSING, "G10")
    number = whole_byte(words.get("P", 0.0))
    if number > 6:
        raise BlockError(block_errors.NO_SUCH_OFFSET, f"G10 P{number}")
    form = whole_byte(words.get("L", 0.0))
    if form not in (2, 20) or (form == 2 and "R" in words):
        raise BlockError(block_errors.UNSUPPORTED, f"G10 L{form}" + " R" * (form == 2))
    left -= {"P", "L"}
    block.select = number - 1 if number else block.offset
    offset = list(stored(block.select))
    for axis in block.axes:
        value = words[AXES[axis]]
        offset[axis] = value
        if form == 20:
            offset[axis] = state.position[axis] - state.coord_offset[axis] - value
            if axis == TOOL_AXIS:
                offset[axis] -= state.tool_offset
    block.stored = offset


def _check_motion(block: Block, state: ModalState, left: set[str]) -> None:
    motion = block.motion
    if motion == NO_MOTION:
        if block.axes:
            raise BlockError(block_errors.AXES_WHILE_OFF, "G80")
        return
    if block.claim is not Claim.MOTION:
        return
    if motion != SEEK and block.feed == 0.0:
        raise BlockError(block_errors.NO_FEED, "the move")
    if motion in (SEEK, LINEAR):
        if not block.axes:
            block.claim = Claim.NONE
    elif not block.axes:
        raise BlockError(block_errors.NO_AXES, "the arc or probing move")
    elif motion in (CLOCKWISE, COUNTERCLOCKWISE):
        _check_arc(block, state, left)
    elif motion in PROBES and block.target == state.position:
        raise BlockError(block_errors.IMPOSSIBLE_TARGET, "the probing move")


def _check_arc(block: Block, state: ModalState, left: set[str]) -> None:
    first, second, _ = PLANES[block.plane]
    words, scale = block.words, MM_PER_INCH if block.inches else 1.0
    if first not in block.axes and second not in block.axes:
        raise BlockError(block_errors.NO_AXES_IN_PLANE, "the arc")
    x = block.target[first] - state.position[first]
    y = block.target[second] - state.position[second]
    if "R" in words:
        left.discard("R")
        if block.target == state.position:
            raise BlockError(block_errors.IMPOSSIBLE_TARGET, "the arc")
        radius = words["R"] * scale
        block.radius = abs(radius)
        centre = centre_from_radius(x, y, radius, block.motion == CLOCKWISE)
        if centre is None:
            raise BlockError(block_errors.IMPOSSIBLE_RADIUS, "the arc")
        block.centre[first], block.centre[second] = centre
        return
    if _CENTRES[first] not in words and _CENTRES[second] not in words:
        raise BlockError(block_errors.NO_CENTRE, "the arc")
    left.difference_update(_CENTRES)
    block.centre = [words.get(letter, 0.0) * scale for letter in _CENTRES]
    block.radius = math.hypot(block.centre[first], block.centre[second])
    miss = abs(math.hypot(x - block.centre[first], y - block.centre[second]) - block.radius)
    if miss > 0.005 and (miss > 0.5 or miss > 0.001 * block.radius):
        raise BlockError(block_errors.IMPOSSIBLE_TARGET, "the arc")
