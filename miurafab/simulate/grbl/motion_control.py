"""The simulated controller performs the actions of G-code blocks (``motion_control.c``)."""

from __future__ import annotations

from miurafab.gcode.block_errors import BlockError
from miurafab.gcode.dialect_words import adapt
from miurafab.gcode.execution import (
    Action,
    CoolantSync,
    Dwell,
    Jog,
    OffsetsChanged,
    Pause,
    Probe,
    ProgramEnd,
    SpindleSync,
    Store,
    StraightMove,
    Synchronize,
    execute,
)
from miurafab.gcode.parser import parse_block
from miurafab.motion import cpu
from miurafab.simulate.grbl import report
from miurafab.simulate.grbl.output import (
    prepare,
    reset_motors,
    say,
    set_flood,
    set_spindle,
    sync_positions,
)
from miurafab.simulate.grbl.realtime import dwell, realtime, start_when_idle, synchronize
from miurafab.simulate.grbl.state import (
    PROBE_BEFORE,
    PROBE_NOTHING,
    SOFT_LIMIT,
    FirmwareState,
    Machine,
    RealtimeRequest,
    Routine,
)

_TRAVEL_EXCEEDED = 15
_EEPROM_BYTE = round(3.4e-3 * cpu.CLOCK)
"""The cycles to program one EEPROM byte (ATmega328P data sheet, table 8-2)."""


def run_gcode(machine: Machine, line: str, *, jog: bool = False) -> Routine:
    """Execute a line of G-code, or of a jog; its code goes to :attr:`Machine.answer`."""
    letters = sum("A" <= character <= "Z" for character in line)
    yield float(cpu.LINE_FIXED + cpu.words_cost(letters, len(line), line.count(".")))
    settings = machine.settings
    machine.answer = 0
    adapted = adapt(line, machine.dialect.name)
    try:
        block = parse_block(adapted.code, machine.parser, settings.position, settings, jog=jog)
    except BlockError as fault:
        machine.answer = fault.code
        return
    if adapted.waits:
        yield from synchronize(machine)
    chord = float(cpu.ARC_CHORD) if block.radius else 0.0
    if chord:
        yield float(cpu.ARC_SETUP)
    for action in execute(block, machine.parser, settings):
        yield chord
        yield from _perform(machine, action)


def remember(machine: Machine, waits: int) -> Routine:
    """Write to the EEPROM; the controller is deaf during each of the ``waits``."""
    for _ in range(waits):
        machine.uart.deaf = machine.dialect.deaf_writes
        yield float(_EEPROM_BYTE)
        machine.uart.hear(machine.now)


def offsets_changed(machine: Machine) -> Routine:
    """Wait for all motion to end; the next report holds the new offset."""
    yield from synchronize(machine)
    machine.offset_count = 0


def _perform(machine: Machine, action: Action) -> Routine:
    checking = machine.state is FirmwareState.CHECK
    if isinstance(action, StraightMove):
        yield from plan_move(machine, action)
    elif isinstance(action, Jog):
        yield from _jog(machine, action)
    elif isinstance(action, Probe):
        yield from _probe(machine, action)
    elif isinstance(action, SpindleSync):
        if not checking:
            yield from synchronize(machine)
            set_spindle(machine, action.spindle, action.speed)
    elif isinstance(action, CoolantSync):
        if not checking:
            yield from synchronize(machine)
            set_flood(machine, bool(action.coolant))
    elif isinstance(action, Dwell):
        if not checking:
            yield from synchronize(machine)
            yield from dwell(machine, action.seconds)
    elif isinstance(action, OffsetsChanged):
        yield from offsets_changed(machine)
    elif isinstance(action, Store):
        yield from synchronize(machine)
        yield from remember(machine, machine.settings.store_position(action.index, action.values))
    elif isinstance(action, Synchronize):
        yield from synchronize(machine)
    elif isinstance(action, Pause):
        if not checking:
            machine.requests.add(RealtimeRequest.HOLD)
            yield from realtime(machine)
    else:
        assert isinstance(action, ProgramEnd)
        yield from _end_program(machine)


def plan_move(machine: Machine, move: StraightMove) -> Routine:
    """Plan a move as soon as the planner has room."""
    if machine.settings.values[20] and machine.state is not FirmwareState.JOG:
        yield from _check_soft_limits(machine, move)
    if machine.state is FirmwareState.CHECK:
        return
    planner = machine.planner
    while True:
        yield from realtime(machine)
        if machine.abort:
            return
        if not planner.full:
            break
        start_when_idle(machine)
        if not machine.pending():
            yield None
    planned = planner.append(
        move.target,
        move.feed,
        rapid=move.rapid,
        inverse_time=move.inverse_time,
        steady=move.steady,
        spindle=move.spindle,
        speed_word=move.speed,
    )
    cycles, planner.cycles = planner.cycles, 0
    yield float(cycles)
    if planned is None and machine.settings.laser and move.spindle == 3:
        yield from synchronize(machine)
        set_spindle(machine, 3, move.speed)


def _check_soft_limits(machine: Machine, move: StraightMove) -> Routine:
    """If the target is beyond the travel: hold, then raise the alarm."""
    if not machine.settings.beyond_travel(move.target):
        return
    machine.soft_limit = True
    if machine.is_in(FirmwareState.CYCLE):
        machine.requests.add(RealtimeRequest.HOLD)
        yield from _until_idle(machine)
        if machine.abort:
            return
    machine.reset()
    machine.alarm = SOFT_LIMIT
    yield from realtime(machine)


def _until_idle(machine: Machine) -> Routine:
    """Wait until the motion has ended or the machine is reset."""
    while True:
        yield from realtime(machine)
        if machine.abort or machine.is_in(FirmwareState.IDLE):
            return
        if not machine.pending():
            yield None


def _jog(machine: Machine, jog: Jog) -> Routine:
    settings = machine.settings
    if settings.values[20] and settings.beyond_travel(jog.move.target):
        jog.accepted = False
        machine.answer = _TRAVEL_EXCEEDED
        return
    yield from plan_move(machine, jog.move)
    if machine.state is FirmwareState.IDLE and machine.planner.moves:
        machine.state = FirmwareState.JOG
        yield from prepare(machine)
        machine.stepper.wake(machine.now)


def _probe(machine: Machine, probe: Probe) -> Routine:
    """Move until the probe changes (``mc_probe_cycle``), and set the parser's position there."""
    if machine.is_in(FirmwareState.CHECK):
        machine.parser.position = list(probe.move.target)
        return
    yield from synchronize(machine)
    if machine.abort:
        return
    machine.probe_succeeded = False
    machine.probe_away = probe.away
    if machine.probe_triggered:
        machine.alarm = PROBE_BEFORE
        yield from realtime(machine)
        machine.probe_away = False
        return
    yield from plan_move(machine, probe.move)
    machine.watch_probe()
    machine.requests.add(RealtimeRequest.START)
    yield from _until_idle(machine)
    yield from _end_probe(machine, probe)


def _end_probe(machine: Machine, probe: Probe) -> Routine:
    if machine.abort:
        return
    machine.probe_succeeded = machine.probe_seen
    if not machine.probe_seen:
        if probe.tolerant:
            machine.probe_position = machine.position
        else:
            machine.alarm = PROBE_NOTHING
    machine.probing = machine.probe_away = False
    yield from realtime(machine)
    yield from reset_motors(machine)
    machine.planner.reset(machine.position)
    yield from say(machine, report.probe(machine))
    if machine.probe_succeeded:
        sync_positions(machine)
    else:
        machine.parser.position = list(probe.move.target)


def _end_program(machine: Machine) -> Routine:
    machine.planner.feed_override = machine.planner.rapid_override = 100
    machine.spindle_override = 100
    if machine.state is not FirmwareState.CHECK:
        machine.parser.coord_system = list(machine.settings.position(0))
        yield from offsets_changed(machine)
        set_spindle(machine, 0, 0.0)
        set_flood(machine, False)
    yield from say(machine, report.message(machine, "Pgm End"))
