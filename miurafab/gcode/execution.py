"""The execution of a checked block: the actions that it asks of the machine, in order.

The order is that of RS274/NGC section 3.8 as GRBL implements it (``gcode.c``): feed, spindle speed,
spindle, coolant, dwell, plane, units, offsets, distance mode, stored positions, motion, stop. The
modal state changes between the actions, as in the firmware, so the performer of an action sees the
state of that moment.
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

    ``speed`` is its S (0 where laser mode turns the beam off) and ``spindle`` 0, 3 or 4. ``feed``
    is in mm/min, or in 1/min with ``inverse_time``; a ``rapid`` does not use it. Feed overrides do
    not apply to a ``steady`` move.
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
    """A jog; its performer sets ``accepted``."""

    move: StraightMove
    accepted: bool = True


@dataclass(slots=True)
class Probe:
    """A probing move; its performer sets the position of the state afterwards."""

    move: StraightMove
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
    """Wait for all motion to end; the work offsets change."""


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
    """Wait for a person (M0)."""


@dataclass(slots=True)
class ProgramEnd:
    """The program ends and the modes are reset (M2, M30)."""


Action = (
    StraightMove | Jog | Probe | SpindleSync | CoolantSync | Dwell | OffsetsChanged | Store
    | Synchronize | Pause | ProgramEnd
)  # fmt: skip


def execute(block: Block, state: ModalState, rules: Rules) -> Iterator[Action]:
    """Yield the actions of ``block``; ``state`` is updated between them."""
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
    move = StraightMove(
        block.target, False, state.feed, bool(state.inverse_time), speed, state.spindle
    )
    if block.action:
        yield from _non_modal(block, state, move)
    state.motion = block.motion
    if block.claim is Claim.MOTION and block.motion != NO_MOTION:
        yield from _move(block, state, rules, move)
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


def _non_modal(block: Block, state: ModalState, move: StraightMove) -> Iterator[Action]:
    action = block.action
    if action == SET_OFFSET:
        yield Store(block.select, block.stored)
        if state.offset == block.select:
            state.coord_system = list(block.stored)
            yield OffsetsChanged()
    elif action in (GO_G28, GO_G30):
        move.rapid = True
        if block.claim is not Claim.NONE:
            yield move
        move.target = block.stored
        yield move
        state.position = list(block.stored)
    elif action in (STORE_G28, STORE_G30):
        yield Store(6 if action == STORE_G28 else 7, list(state.position))
    elif action in (SHIFT, UNSHIFT):
        state.coord_offset = list(block.target) if action == SHIFT else [0.0, 0.0, 0.0]
        yield OffsetsChanged()


def _move(block: Block, state: ModalState, rules: Rules, move: StraightMove) -> Iterator[Action]:
    motion = block.motion
    move.target = block.target
    move.rapid = motion == SEEK
    if motion in PROBES:
        move.steady = True
        kind = PROBES.index(motion)
        yield Probe(move, away=kind >= 2, tolerant=kind % 2 == 1)
        return
    if motion in (CLOCKWISE, COUNTERCLOCKWISE):
        yield from _arc(block, state, rules, move)
    else:
        yield move
    state.position = list(block.target)


def _arc(block: Block, state: ModalState, rules: Rules, move: StraightMove) -> Iterator[Action]:
    """The chords of an arc. In G93 the firmware multiplies the feed by the number of chords and
    then reads it as mm/min (``mc_arc``); this does the same.
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
    if move.inverse_time and count:
        move.feed *= count
        move.inverse_time = False
    for end in ends:
        move.target = end
        yield move


def _stop(block: Block, state: ModalState) -> Iterator[Action]:
    yield Synchronize()
    if block.stop == 1:
        yield Pause()
        return
    state.motion = LINEAR
    state.plane = state.distance = state.inverse_time = state.offset = 0
    state.spindle = state.coolant = 0
    yield ProgramEnd()
