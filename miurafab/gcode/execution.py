"""What a checked block does, step by step: the actions it asks of the machine, in order.

The order is that of RS274/NGC section 3.8 as GRBL keeps it (``gcode.c``): feed, spindle speed,
spindle, coolant, dwell, plane, units, offsets, distance mode, stored positions, motion, stop.
The modal state changes between the actions, as it does in the firmware, so whoever performs
them sees it as it is at that moment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from miurafab.gcode.arcs import arc_chords
from miurafab.gcode.parser import PLANES, TOOL_AXIS, Block, ModalState, Rules
from miurafab.gcode.words import (
    CLOCKWISE,
    COUNTERCLOCKWISE,
    DWELL,
    GO_G28,
    GO_G30,
    LINEAR,
    NO_MOTION,
    PROBES,
    SEEK,
    SET_OFFSET,
    SHIFT,
    STORE_G28,
    STORE_G30,
    UNSHIFT,
    Claim,
)

_BURNING = (LINEAR, CLOCKWISE, COUNTERCLOCKWISE)
_CONSTANT_POWER = 3


@dataclass(slots=True)
class StraightMove:
    """A straight move to ``target`` (machine mm).

    ``speed`` is the S it runs with (0 where laser mode darkens it), ``spindle`` 0, 3 or 4;
    ``feed`` in mm/min, or in 1/min with ``inverse_time``; unused for a ``rapid``.
    ``steady``: overrides do not touch its feed.
    """

    target: Sequence[float]
    rapid: bool
    feed: float
    inverse_time: bool
    speed: float
    spindle: int
    steady: bool = False


@dataclass(slots=True)
class Jog:
    """A jog; whoever performs it says whether it was ``accepted``."""

    line: StraightMove
    accepted: bool = True


@dataclass(slots=True)
class Probe:
    """A probing move; whoever performs it sets the state's position afterwards."""

    line: StraightMove
    away: bool
    tolerant: bool


@dataclass(slots=True)
class SpindleSync:
    """Wait for all motion to end, then run the spindle as M3, M4 or off (0) at ``speed``."""

    spindle: int
    speed: float


@dataclass(slots=True)
class CoolantSync:
    """Wait for all motion to end, then switch the coolant."""

    coolant: int


@dataclass(slots=True)
class Dwell:
    """Wait for all motion to end, then ``seconds``."""

    seconds: float


@dataclass(slots=True)
class OffsetsChanged:
    """Work offsets are about to be new; wait for all motion to end."""


@dataclass(slots=True)
class Store:
    """Write a stored position: 0 to 5 for G54 to G59, 6 for G28, 7 for G30."""

    index: int
    values: Sequence[float]


@dataclass(slots=True)
class Synchronize:
    """Wait for all motion to end."""


@dataclass(slots=True)
class Pause:
    """Wait for somebody (M0)."""


@dataclass(slots=True)
class ProgramEnd:
    """The program is over and the modes are reset (M2, M30)."""


Action = (
    StraightMove | Jog | Probe | SpindleSync | CoolantSync | Dwell | OffsetsChanged | Store
    | Synchronize | Pause | ProgramEnd
)  # fmt: skip


def execute(block: Block, state: ModalState, rules: Rules) -> Iterator[Action]:
    """The actions of ``block``; ``state`` is updated between them."""
    if block.jog:
        jog = Jog(
            StraightMove(block.target, False, block.feed, False, state.speed, state.spindle, True)
        )
        yield jog
        if jog.accepted:
            state.position = list(block.target)
        return
    moving = bool(block.axes) and block.claim is Claim.MOTION
    dark = rules.laser and block.motion not in _BURNING
    state.inverse_time = block.inverse_time
    state.feed = block.feed
    stepped = rules.laser and moving
    restart = (
        rules.laser
        and not moving
        and state.spindle == _CONSTANT_POWER
        and (state.motion in _BURNING) == dark
    )
    if state.speed != block.speed or restart:
        if state.spindle and not stepped:
            yield SpindleSync(state.spindle, 0.0 if dark else block.speed)
        state.speed = block.speed
    speed = 0.0 if dark else state.speed
    state.tool = block.tool
    if state.spindle != block.spindle:
        yield SpindleSync(block.spindle, speed)
        state.spindle = block.spindle
    if state.coolant != block.coolant:
        yield CoolantSync(block.coolant)
        state.coolant = block.coolant
    if block.action == DWELL:
        yield Dwell(block.words["P"])
    state.plane = block.plane
    state.inches = block.inches
    yield from _offsets(block, state)
    state.distance = block.distance
    line = StraightMove(
        block.target, False, state.feed, bool(state.inverse_time), speed, state.spindle
    )
    if block.action:
        yield from _non_modal(block, state, line)
    state.motion = block.motion
    if block.claim is Claim.MOTION and block.motion != NO_MOTION:
        yield from _move(block, state, rules, line)
    if block.stop:
        yield from _stop(block, state)


def _offsets(block: Block, state: ModalState) -> Iterator[Action]:
    if block.claim is Claim.TOOL_LENGTH:
        state.tool_length = block.tool_length
        height = block.target[TOOL_AXIS] if block.tool_length else 0.0
        if state.tool_offset != height:
            state.tool_offset = height
            yield OffsetsChanged()
    if state.offset != block.offset:
        state.offset = block.offset
        state.coord_system = list(block.coord_system)
        yield OffsetsChanged()


def _non_modal(block: Block, state: ModalState, line: StraightMove) -> Iterator[Action]:
    action = block.action
    if action == SET_OFFSET:
        yield Store(block.select, block.stored)
        if state.offset == block.select:
            state.coord_system = list(block.stored)
            yield OffsetsChanged()
    elif action in (GO_G28, GO_G30):
        line.rapid = True
        if block.claim is not Claim.NONE:
            yield line
        line.target = block.stored
        yield line
        state.position = list(block.stored)
    elif action in (STORE_G28, STORE_G30):
        yield Store(6 if action == STORE_G28 else 7, list(state.position))
    elif action in (SHIFT, UNSHIFT):
        state.coord_offset = list(block.target) if action == SHIFT else [0.0, 0.0, 0.0]
        yield OffsetsChanged()


def _move(block: Block, state: ModalState, rules: Rules, line: StraightMove) -> Iterator[Action]:
    motion = block.motion
    line.target = block.target
    line.rapid = motion == SEEK
    if motion in PROBES:
        line.steady = True
        kind = PROBES.index(motion)
        yield Probe(line, away=kind >= 2, tolerant=kind % 2 == 1)
        return
    if motion in (CLOCKWISE, COUNTERCLOCKWISE):
        yield from _arc(block, state, rules, line)
    else:
        yield line
    state.position = list(block.target)


def _arc(block: Block, state: ModalState, rules: Rules, line: StraightMove) -> Iterator[Action]:
    """The chords of an arc. In G93 the firmware multiplies the feed by their number and then
    takes it for mm/min (``mc_arc``); so does this.
    """
    count, ends = arc_chords(
        state.position,
        block.target,
        block.centre,
        block.radius,
        PLANES[block.plane],
        block.motion == CLOCKWISE,
        rules.arc_tolerance,
    )
    if line.inverse_time and count:
        line.feed *= count
        line.inverse_time = False
    for end in ends:
        line.target = end
        yield line


def _stop(block: Block, state: ModalState) -> Iterator[Action]:
    yield Synchronize()
    if block.stop == 1:
        yield Pause()
        return
    state.motion = LINEAR
    state.plane = state.distance = state.inverse_time = state.offset = 0
    state.spindle = state.coolant = 0
    yield ProgramEnd()
