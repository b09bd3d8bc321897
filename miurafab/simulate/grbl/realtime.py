"""The realtime requests of the simulated controller: holds, starts, stops, overrides, alarms.

The main program calls :func:`realtime` wherever it may have to wait (``protocol.c``). It serves the
requests of the interrupts in a fixed order and keeps the segment queue filled. While the controller
is suspended (a hold, an open door, a jog cancel) it does not return.
"""

from __future__ import annotations

from miurafab.motion import cpu
from miurafab.simulate.grbl import report
from miurafab.simulate.grbl.output import (
    prepare,
    reset_motors,
    rest_motors,
    say,
    set_flood,
    set_spindle,
    sync_positions,
)
from miurafab.simulate.grbl.state import (
    HARD_LIMIT,
    SOFT_LIMIT,
    SPINDLE_STOP,
    FirmwareState,
    Machine,
    RealtimeRequest,
    Routine,
    StopOverride,
    Suspend,
    Until,
)

_ALARM_PAUSE = 0.5
_DOOR_SPINDLE, _DOOR_COOLANT = 4.0, 1.0
"""s; the delays after an alarm message, and of spindle and coolant after a door (``config.h``)."""
_LEAST_OVERRIDE, _MOST_OVERRIDE = 10, 200
_FEED_STEPS = {0x91: 10, 0x92: -10, 0x93: 1, 0x94: -1}
_SPINDLE_STEPS = {0x9A: 10, 0x9B: -10, 0x9C: 1, 0x9D: -1}
_RAPIDS = {0x95: 100, 0x96: 50, 0x97: 25}
_HOLDING = {
    RealtimeRequest.CANCEL,
    RealtimeRequest.HOLD,
    RealtimeRequest.DOOR,
    RealtimeRequest.SLEEP,
}
_BLOCK_START = {RealtimeRequest.CANCEL, RealtimeRequest.HOLD, RealtimeRequest.DOOR}
_STEPPING = {
    FirmwareState.CYCLE,
    FirmwareState.HOLD,
    FirmwareState.DOOR,
    FirmwareState.HOMING,
    FirmwareState.SLEEP,
    FirmwareState.JOG,
}
_FLOOD_STATES = {FirmwareState.IDLE, FirmwareState.CYCLE, FirmwareState.HOLD, FirmwareState.JOG}


def realtime(machine: Machine) -> Routine:
    """Serve the requests; while suspended, do not return."""
    yield from flags(machine)
    if machine.suspend:
        yield from _suspended(machine)


def flags(machine: Machine) -> Routine:
    """Serve the requests once."""
    if machine.pending():
        yield from _flags(machine)
        if machine.abort:
            return
    if machine.state in _STEPPING and machine.stepper.room:
        yield from prepare(machine)


def start_when_idle(machine: Machine) -> None:
    """Request a start if moves are planned and the controller is idle."""
    if machine.planner.moves and machine.state is FirmwareState.IDLE:
        machine.requests.add(RealtimeRequest.START)


def synchronize(machine: Machine) -> Routine:
    """Wait until all motion has ended or the machine is reset."""
    while True:
        start_when_idle(machine)
        yield from realtime(machine)
        if machine.abort:
            return
        if not machine.planner.moves and machine.state is not FirmwareState.CYCLE:
            return
        if not machine.pending():
            yield None


def dwell(machine: Machine, seconds: float) -> Routine:
    """Wait ``seconds`` in steps of 50 ms; serve the requests before each step."""
    for _ in range(cpu.dwell_steps(seconds)):
        if machine.abort:
            return
        yield from realtime(machine)
        yield float(cpu.DWELL_STEP)


def _flags(machine: Machine) -> Routine:
    if machine.interrupt_delay:
        delay, machine.interrupt_delay = machine.interrupt_delay, 0
        yield Until(machine.now + delay)
    if machine.alarm:
        yield from _raise_alarm(machine)
    requests = set(machine.requests)
    if RealtimeRequest.RESET in requests:
        machine.abort = True
        return
    stopped = machine.stepper.stopped
    if RealtimeRequest.STATUS in requests:
        yield from say(machine, report.status(machine))
        machine.requests.discard(RealtimeRequest.STATUS)
    if requests & _HOLDING:
        yield from _hold(machine, requests)
        machine.requests -= _HOLDING
    if RealtimeRequest.START in requests:
        if not requests & _BLOCK_START:
            yield from _start(machine)
        machine.requests.discard(RealtimeRequest.START)
    if stopped:
        yield from _stop(machine)
        machine.stepper.stopped = False
    if machine.motion_overrides:
        _override_motion(machine)
    if machine.accessory_overrides:
        _override_accessories(machine)


def _raise_alarm(machine: Machine) -> Routine:
    machine.state = FirmwareState.ALARM
    yield from say(machine, machine.dialect.alarm_text(machine.alarm))
    yield _ALARM_PAUSE * cpu.CLOCK
    if machine.alarm in (HARD_LIMIT, SOFT_LIMIT):
        yield from say(machine, report.message(machine, "Reset to continue"))
        machine.requests.discard(RealtimeRequest.RESET)
        while RealtimeRequest.RESET not in machine.requests:
            yield None
    machine.alarm = 0


def _hold(machine: Machine, requests: set[RealtimeRequest]) -> Routine:
    if machine.state not in (FirmwareState.ALARM, FirmwareState.CHECK):
        suspend = machine.suspend
        if machine.state in (FirmwareState.CYCLE, FirmwareState.JOG):
            if not suspend & {Suspend.MOTION_CANCEL, Suspend.JOG_CANCEL}:
                machine.generator.hold()
                if machine.state is FirmwareState.JOG and RealtimeRequest.SLEEP not in requests:
                    suspend.add(Suspend.JOG_CANCEL)
        elif machine.state is FirmwareState.IDLE:
            machine.suspend = suspend = {Suspend.HELD}
        if RealtimeRequest.CANCEL in requests and machine.state is not FirmwareState.JOG:
            suspend.add(Suspend.MOTION_CANCEL)
        held = machine.state not in (FirmwareState.DOOR, FirmwareState.JOG, FirmwareState.SLEEP)
        if RealtimeRequest.HOLD in requests and held:
            machine.state = FirmwareState.HOLD
        if RealtimeRequest.DOOR in requests:
            yield from say(machine, report.message(machine, "Check Door"))
            if Suspend.JOG_CANCEL not in suspend:
                if machine.state is FirmwareState.DOOR and Suspend.RESTORING in suspend:
                    suspend -= {Suspend.RETRACTED, Suspend.RESTORING, Suspend.RESTORED}
                if machine.state is not FirmwareState.SLEEP:
                    machine.state = FirmwareState.DOOR
            suspend.add(Suspend.DOOR_AJAR)
    if RealtimeRequest.SLEEP in requests:
        if machine.state is FirmwareState.ALARM:
            machine.suspend |= {Suspend.RETRACTED, Suspend.HELD}
        machine.state = FirmwareState.SLEEP


def _start(machine: Machine) -> Routine:
    suspend = machine.suspend
    if machine.state is FirmwareState.DOOR and Suspend.DOOR_AJAR not in suspend:
        if Suspend.RESTORED in suspend:
            machine.state = FirmwareState.IDLE
        else:  # all is out by then
            suspend.add(Suspend.RESTORING)
    held = machine.state is FirmwareState.HOLD and Suspend.HELD in suspend
    if machine.state is not FirmwareState.IDLE and not held:
        return
    if held and machine.stop_override is not StopOverride.OFF:
        machine.stop_override = StopOverride.RESTORE_AND_START
        return
    machine.generator.resume()
    machine.generator.refresh_power = False
    cancelled = Suspend.MOTION_CANCEL in suspend
    machine.suspend = set()
    if machine.planner.moves and not cancelled:
        machine.state = FirmwareState.CYCLE
        yield from prepare(machine)
        machine.stepper.wake(machine.now)
    else:
        machine.state = FirmwareState.IDLE


def _stop(machine: Machine) -> Routine:
    """All prepared motion has ended: a hold is complete, or the cycle is over."""
    generator, suspend = machine.generator, machine.suspend
    holding = machine.state in (FirmwareState.HOLD, FirmwareState.DOOR, FirmwareState.SLEEP)
    if holding and not machine.soft_limit and Suspend.JOG_CANCEL not in suspend:
        machine.planner.restart()
        if generator.holding:
            suspend.add(Suspend.HELD)
        generator.holding = False
        generator.system_move = None
        return
    if Suspend.JOG_CANCEL in suspend:
        machine.planner.reset(machine.position)
        yield from reset_motors(machine)
        sync_positions(machine)
    if Suspend.DOOR_AJAR in suspend:
        suspend.discard(Suspend.JOG_CANCEL)
        suspend.add(Suspend.HELD)
        machine.state = FirmwareState.DOOR
    else:
        machine.suspend = set()
        machine.state = FirmwareState.IDLE


def _clamp(percent: int) -> int:
    """An override, wrapped to a byte as in the firmware, then clipped to its range."""
    return min(max(percent & 0xFF, _LEAST_OVERRIDE), _MOST_OVERRIDE)


def _override_motion(machine: Machine) -> None:
    asked, machine.motion_overrides = machine.motion_overrides, set()
    planner = machine.planner
    feed = 100 if 0x90 in asked else planner.feed_override
    feed = _clamp(feed + sum(step for byte, step in _FEED_STEPS.items() if byte in asked))
    rapid = planner.rapid_override
    for byte, percent in _RAPIDS.items():
        if byte in asked:
            rapid = percent
    if (feed, rapid) != (planner.feed_override, planner.rapid_override):
        machine.override_count = 0
        planner.override(feed, rapid)


def _override_accessories(machine: Machine) -> None:
    asked, machine.accessory_overrides = machine.accessory_overrides, set()
    percent = 100 if 0x99 in asked else machine.spindle_override
    percent = _clamp(percent + sum(n for byte, n in _SPINDLE_STEPS.items() if byte in asked))
    if percent != machine.spindle_override:
        machine.spindle_override = percent
        if machine.state is FirmwareState.IDLE:
            set_spindle(machine, machine.parser.spindle, machine.parser.speed)
        else:
            machine.generator.refresh_power = True
        machine.override_count = 0
    if SPINDLE_STOP in asked and machine.state is FirmwareState.HOLD:
        if machine.stop_override is StopOverride.OFF:
            machine.stop_override = StopOverride.BEGIN
        elif machine.stop_override is StopOverride.ON:
            machine.stop_override = StopOverride.RESTORE
    if 0xA0 in asked and machine.state in _FLOOD_STATES:
        machine.parser.coolant ^= 1
        set_flood(machine, bool(machine.parser.coolant))


def _suspended(machine: Machine) -> Routine:
    """Wait until the hold, door or cancelled motion is over."""
    move = machine.planner.moves[0] if machine.planner.moves else None
    if move is None:
        restore = machine.parser.spindle, machine.parser.speed, bool(machine.parser.coolant)
    else:
        restore = move.spindle, move.speed_word, machine.flood
    if machine.settings.laser:
        machine.accessory_overrides.add(SPINDLE_STOP)
    while machine.suspend:
        if machine.abort:
            return
        before = _progress(machine)
        if Suspend.HELD in machine.suspend:
            if machine.state is FirmwareState.SLEEP and Suspend.RETRACTED in machine.suspend:
                yield from _sleep(machine)
                return
            if machine.state in (FirmwareState.DOOR, FirmwareState.SLEEP):
                yield from _door(machine, restore)
            else:
                yield from _held(machine, restore)
        yield from flags(machine)
        if before == _progress(machine) and not machine.pending():
            yield None


def _progress(machine: Machine) -> tuple[object, ...]:
    """The parts of a suspended machine's state that change without input."""
    return (
        machine.state,
        frozenset(machine.suspend),
        machine.stop_override,
        machine.generator.refresh_power,
    )


def _sleep(machine: Machine) -> Routine:
    yield from say(machine, report.message(machine, "Sleeping"))
    set_spindle(machine, 0, 0.0)
    set_flood(machine, False)
    yield from rest_motors(machine)
    while not machine.abort:
        yield from flags(machine)
        if not machine.pending():
            yield None


def _door(machine: Machine, restore: tuple[int, float, bool]) -> Routine:
    """Power down after the stop; at a start with the door closed, power up and continue."""
    suspend = machine.suspend
    if Suspend.RETRACTED not in suspend:
        machine.stop_override = StopOverride.OFF
        set_spindle(machine, 0, 0.0)
        set_flood(machine, False)
        suspend.add(Suspend.RETRACTED)
        return
    suspend.discard(Suspend.DOOR_AJAR)
    if Suspend.RESTORING not in suspend:
        return
    spindle, word, flood = restore
    if machine.parser.spindle:
        if machine.settings.laser:
            machine.generator.refresh_power = True
        else:
            set_spindle(machine, spindle, word)
            yield from _restore_wait(machine, _DOOR_SPINDLE)
    if machine.parser.coolant and Suspend.RESTORING in machine.suspend:
        set_flood(machine, flood)
        yield from _restore_wait(machine, _DOOR_COOLANT)
    if Suspend.RESTORING in machine.suspend:
        machine.suspend.add(Suspend.RESTORED)
        machine.requests.add(RealtimeRequest.START)


def _restore_wait(machine: Machine, seconds: float) -> Routine:
    """Wait for spindle or coolant to start, unless the door opens again."""
    for _ in range(cpu.dwell_steps(seconds)):
        yield from flags(machine)
        if machine.abort or Suspend.RESTORING not in machine.suspend:
            return
        yield float(cpu.DWELL_STEP)


def _held(machine: Machine, restore: tuple[int, float, bool]) -> Routine:
    """In a complete hold: stop the spindle on request, and restore it before a start."""
    stop = machine.stop_override
    spindle, word, _ = restore
    if stop is StopOverride.BEGIN:
        machine.stop_override = StopOverride.OFF
        if machine.parser.spindle:
            set_spindle(machine, 0, 0.0)
            machine.stop_override = StopOverride.ON
    elif stop in (StopOverride.RESTORE, StopOverride.RESTORE_AND_START):
        if machine.parser.spindle:
            yield from say(machine, report.message(machine, "Restoring spindle"))
            if machine.settings.laser:
                machine.generator.refresh_power = True
            else:
                set_spindle(machine, spindle, word)
        if stop is StopOverride.RESTORE_AND_START:
            machine.requests.add(RealtimeRequest.START)
        machine.stop_override = StopOverride.OFF
    elif stop is StopOverride.OFF and machine.generator.refresh_power:
        set_spindle(machine, spindle, word)
        machine.generator.refresh_power = False
