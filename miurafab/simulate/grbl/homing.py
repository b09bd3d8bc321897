"""The homing cycle of the simulated controller: find the switches, pull off, find them slowly.

Z homes first, then X and Y together (``limits.c``, ``config.h``). Each axis has one switch, half
the travel away from the position at power-up; ``homing_switches`` says whether they exist. Only a
reset ends the cycle early; all other requests wait until its end.
"""

from __future__ import annotations

import math

from miurafab.motion import cpu
from miurafab.motion.planner import Move, to_steps
from miurafab.motion.stepper import steps_taken
from miurafab.simulate.grbl.output import prepare, reset_motors, sync_positions
from miurafab.simulate.grbl.realtime import realtime
from miurafab.simulate.grbl.state import (
    AXES,
    HOMING_DOOR,
    HOMING_NO_SWITCH,
    HOMING_PULL_OFF,
    Machine,
    RealtimeRequest,
    Routine,
    Until,
)

_CYCLES = ((2,), (0, 1))
_SEARCH, _LOCATE = 1.5, 5.0
"""The search distance in travels, and the distance of the slow search in pull-offs."""


def home(machine: Machine) -> Routine:
    """``$H``: home all axes; the state is already HOMING."""
    machine.stepper.idle_lock = 0
    for axes in _CYCLES:
        if not machine.abort:
            yield from _home(machine, axes)
    machine.stepper.idle_lock = machine.idle_cycles
    yield from realtime(machine)
    if not machine.abort:
        sync_positions(machine)


def _home(machine: Machine, axes: tuple[int, ...]) -> Routine:
    """One cycle: search, pull off, locate, pull off."""
    values = machine.settings.values
    reach = max(_SEARCH * values[130 + axis] for axis in axes)
    pull_off = values[27]
    for approach, distance, rate in (
        (True, reach, values[25]),
        (False, pull_off, values[25]),
        (True, pull_off * _LOCATE, values[24]),
        (False, pull_off, values[25]),
    ):
        yield from _leg(machine, axes, approach, distance, rate)
        if machine.abort:
            return
    for axis in axes:
        _set_home(machine, axis)
    machine.generator.resume()


def _set_home(machine: Machine, axis: int) -> None:
    """Set machine zero at the switch end of the travel, after the pull-off."""
    values = machine.settings.values
    steps_per_mm, pull_off = values[100 + axis], values[27]
    direction, switch = machine.home_switch(axis)
    position = list(machine.position)
    gap = switch - position[axis]
    at = -pull_off if direction > 0 else -values[130 + axis] + pull_off
    position[axis] = to_steps(at, steps_per_mm)
    machine.switches[axis] = (direction, position[axis] + gap)
    machine.count_from(tuple(position))


def _leg(
    machine: Machine, axes: tuple[int, ...], approach: bool, distance: float, rate: float
) -> Routine:
    """Move ``axes`` towards their switches until each is pressed, or away by ``distance``."""
    _count_from_zero(machine, axes)
    target = machine.millimetres(machine.position)
    for axis in axes:
        direction, _ = machine.home_switch(axis)
        target[axis] = direction * distance if approach else -direction * distance
    speed = rate * math.sqrt(len(axes))
    planned = machine.planner.make(target, speed, steady=True, origin=machine.position)
    generator, stepper = machine.generator, machine.stepper
    moving = set(axes)
    if planned is not None:
        generator.system_move = move = planned[0]
        stopped: dict[int, int] = {}
        yield from prepare(machine)
        stepper.wake(machine.now)
        while moving:
            if approach:
                for axis in sorted(moving):
                    if _pressed(machine, axis):
                        moving.discard(axis)
                        stopped[axis] = machine.position_now()[axis]
            yield from prepare(machine)
            if _ended(machine, axes, approach):
                yield from realtime(machine)
                return
            if stepper.stopped:
                stepper.stopped = False
                break
            if moving:
                press = _next_press(machine, move, moving) if approach else None
                yield None if press is None else Until(press)
        yield from reset_motors(machine)
        machine.position = tuple(stopped.get(axis, at) for axis, at in enumerate(machine.position))
    yield machine.settings.values[26] * 1e-3 * cpu.CLOCK


def _count_from_zero(machine: Machine, axes: tuple[int, ...]) -> None:
    """Count the axes of a leg from zero; the switches do not move."""
    position = list(machine.position)
    for axis in axes:
        direction, switch = machine.home_switch(axis)
        machine.switches[axis] = (direction, switch - position[axis])
        position[axis] = 0
    machine.count_from(tuple(position))


def _pressed(machine: Machine, axis: int) -> bool:
    return AXES[axis] in machine.engaged_limits()


def _ended(machine: Machine, axes: tuple[int, ...], approach: bool) -> bool:
    """Whether the cycle failed: a reset, a door, a switch not found or not released."""
    requests = machine.requests
    done = machine.stepper.stopped
    if not done and not requests & {RealtimeRequest.RESET, RealtimeRequest.DOOR}:
        return False
    if RealtimeRequest.DOOR in requests:
        machine.alarm = HOMING_DOOR
    if not approach and any(_pressed(machine, axis) for axis in axes):
        machine.alarm = HOMING_PULL_OFF
    if approach and done:
        machine.alarm = HOMING_NO_SWITCH
    if machine.alarm or RealtimeRequest.RESET in requests:
        machine.reset()
        return True
    return False


def _next_press(machine: Machine, move: Move, moving: set[int]) -> int | None:
    """The time in the running segment when the next ``moving`` axis reaches its switch."""
    stepper = machine.stepper
    if not machine.homing_switches or not stepper.running:
        return None
    segment = stepper.queue[0]
    presses = []
    for axis in moving:
        direction, switch = machine.home_switch(axis)
        low, high = 1, segment.ticks
        if direction * (_after(move, segment.done + high * segment.stride, axis) - switch) < 0:
            continue
        while low < high:
            middle = (low + high) // 2
            micro = segment.done + middle * segment.stride
            if direction * (_after(move, micro, axis) - switch) >= 0:
                high = middle
            else:
                low = middle + 1
        presses.append(stepper.began + (low - 1) * segment.period)
    return min(presses, default=None)


def _after(move: Move, micro: int, axis: int) -> int:
    return steps_taken(move, micro)[axis]
