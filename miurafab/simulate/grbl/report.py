"""The texts of the simulated controller (``report.c``, ``print.c`` of GRBL 1.1h)."""

from __future__ import annotations

from collections.abc import Sequence

from miurafab.gcode.numbers import single
from miurafab.gcode.words import PROBES
from miurafab.grbl.codes import setting_codes
from miurafab.simulate.grbl.state import FirmwareState, Machine, Suspend

HELP = "[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]\r\n"
_INCHES = single(0.0393701)
_BUSY_OFFSET, _IDLE_OFFSET = 30, 10
_BUSY_OVERRIDE, _IDLE_OVERRIDE = 20, 10
"""The reports between two WCO or Ov fields, in motion and at rest (``config.h``)."""
_BUSY = frozenset(
    {
        FirmwareState.HOMING,
        FirmwareState.CYCLE,
        FirmwareState.HOLD,
        FirmwareState.JOG,
        FirmwareState.DOOR,
    }
)


def number(value: float, decimals: int) -> str:
    """``value`` as the firmware prints a 32-bit float; an overflow prints 2^31."""
    sign = "-" if value < 0.0 else ""
    scaled = single(abs(value))
    for _ in range(decimals // 2):
        scaled = single(scaled * 100.0)
    if decimals % 2:
        scaled = single(scaled * 10.0)
    scaled = single(scaled + 0.5)
    digits = str(int(scaled) if scaled < 2.0**31 else 1 << 31).rjust(decimals + 1, "0")
    return f"{sign}{digits[:-decimals]}.{digits[-decimals:]}" if decimals else sign + digits


def banner(machine: Machine) -> str:
    """The banner of a start."""
    said = machine.dialect.banner
    return f"\r\n{said}\r\n" if said else ""


def message(machine: Machine, text: str) -> str:
    """A feedback message."""
    return machine.dialect.message.format(text)


def status_code(machine: Machine, code: int) -> str:
    """The answer to a line: ``ok`` or ``error:``."""
    return machine.dialect.error_text(code) if code else "ok\r\n"


def coordinate(machine: Machine, value: float) -> str:
    """A length in mm with three decimals, or in inches with four ($13)."""
    if machine.settings.values[13]:
        return number(single(value * _INCHES), 4)
    return number(value, 3)


def rate(machine: Machine, value: float) -> str:
    """A feed in mm/min, or in inches a minute with one decimal ($13)."""
    if machine.settings.values[13]:
        return number(single(value * _INCHES), 1)
    return number(value, 0)


def _vector(machine: Machine, values: Sequence[float]) -> str:
    return ",".join(coordinate(machine, value) for value in values)


def settings_list(machine: Machine) -> str:
    """The answer to ``$$``."""
    values, listed = machine.settings.values, machine.dialect.settings
    lines = []
    for code in setting_codes().values():
        if listed is not None and code.number not in listed:
            continue
        remark = "" if listed is None else listed[code.number].format(int(values[code.number]))
        tail = f" ({remark})" if remark else ""
        lines.append(f"${code.number}={number(values[code.number], code.decimals)}{tail}\r\n")
    return "".join(lines)


def probe(machine: Machine) -> str:
    """The last probed position."""
    where = _vector(machine, machine.millimetres(machine.probe_position))
    return f"[PRB:{where}:{int(machine.probe_succeeded)}]\r\n"


def parameters(machine: Machine) -> str:
    """The answer to ``$#``."""
    names = [f"G{54 + index}" for index in range(6)] + ["G28", "G30"]
    stored = "".join(
        f"[{name}:{_vector(machine, machine.settings.position(index))}]\r\n"
        for index, name in enumerate(names)
    )
    parser = machine.parser
    return (
        f"{stored}[G92:{_vector(machine, parser.coord_offset)}]\r\n"
        f"[TLO:{coordinate(machine, parser.tool_offset)}]\r\n{probe(machine)}"
    )


def modes(machine: Machine) -> str:
    """The answer to ``$G``."""
    parser = machine.parser
    probing = parser.motion in PROBES
    motion = f"38.{PROBES.index(parser.motion) + 2}" if probing else str(parser.motion)
    point = "." if machine.dialect.program_flow else ""
    words = [
        f"G{motion}",
        f"G{54 + parser.offset}",
        f"G{17 + parser.plane}",
        f"G{21 - parser.inches}",
        f"G{90 + parser.distance}",
        f"G{94 - parser.inverse_time}",
        *(["M0"] if machine.dialect.program_flow else []),
        f"M{parser.spindle or 5}",
        f"M{8 if parser.coolant else 9}",
        f"T{parser.tool}",
        f"F{rate(machine, parser.feed)}{point}",
        f"S{number(parser.speed, 0)}{point}",
    ]
    return machine.dialect.modes.format(" ".join(words))


def build_info(machine: Machine, note: str) -> str:
    """The answer to ``$I``: the version, the note of ``$I=``, and the dialect's other lines."""
    return "".join(f"{line}\r\n" for line in machine.dialect.build_info).format(note)


def status(machine: Machine) -> str:
    """The answer to ``?``; it advances the counters of the occasional fields."""
    values = machine.settings.values
    position = machine.millimetres(machine.position_now())
    mask = int(values[10])
    parser = machine.parser
    offset = [single(a + b) for a, b in zip(parser.coord_system, parser.coord_offset, strict=True)]
    offset[2] = single(offset[2] + parser.tool_offset)
    if machine.dialect.commas:
        return _status_with_commas(machine, position, offset)
    if mask & 1:
        where = f"MPos:{_vector(machine, position)}"
    else:
        work = [single(a - b) for a, b in zip(position, offset, strict=True)]
        where = f"WPos:{_vector(machine, work)}"
    fields = [_state(machine), where]
    if mask & 2:
        blocks = machine.dialect.planner_blocks - len(machine.planner.moves)
        fields.append(f"Bf:{blocks},{machine.uart.room}")
    speed = machine.generator.speed if machine.state in _BUSY else 0.0
    fields.append(f"FS:{rate(machine, speed)},{number(machine.spindle_speed, 0)}")
    pins = _pins(machine)
    if pins:
        fields.append(f"Pn:{pins}")
    fields += _occasional(machine, offset)
    return f"<{'|'.join(fields)}>\r\n"


def _status_with_commas(
    machine: Machine, position: Sequence[float], offset: Sequence[float]
) -> str:
    """The status of GRBL 0.9: both positions and the buffer levels, by the bits of $10."""
    mask = int(machine.settings.values[10])
    fields = [_state(machine).partition(":")[0]]
    if mask & 1:
        fields.append(f"MPos:{_vector(machine, position)}")
    if mask & 2:
        work = [single(a - b) for a, b in zip(position, offset, strict=True)]
        fields.append(f"WPos:{_vector(machine, work)}")
    if mask & 4:
        fields.append(f"Buf:{len(machine.planner.moves)}")
    if mask & 8:
        fields.append(f"RX:{len(machine.uart.ring)}")
    return f"<{','.join(fields)}>\r\n"


def _state(machine: Machine) -> str:
    state, suspend = machine.state, machine.suspend
    if state is FirmwareState.HOLD:
        return f"Hold:{0 if Suspend.HELD in suspend else 1}"
    if state is FirmwareState.DOOR:
        if Suspend.RESTORING in suspend:
            return "Door:3"
        if Suspend.RETRACTED not in suspend:
            return "Door:2"
        return f"Door:{1 if Suspend.DOOR_AJAR in suspend else 0}"
    return str(state.value)


def _pins(machine: Machine) -> str:
    pins = "P" if machine.probe_triggered else ""
    pins += "".join(axis for axis in "XYZ" if axis in machine.engaged_limits())
    controls = {"R": "reset", "H": "hold", "S": "start"}
    return pins + "".join(k for k, name in controls.items() if name in machine.control_pins)


def _occasional(machine: Machine, offset: Sequence[float]) -> list[str]:
    fields = []
    busy = machine.state in _BUSY
    if machine.offset_count > 0:
        machine.offset_count -= 1
    else:
        machine.offset_count = (_BUSY_OFFSET if busy else _IDLE_OFFSET) - 1
        machine.override_count = machine.override_count or 1
        fields.append(f"WCO:{_vector(machine, offset)}")
    if machine.override_count > 0:
        machine.override_count -= 1
        return fields
    machine.override_count = (_BUSY_OVERRIDE if busy else _IDLE_OVERRIDE) - 1
    planner = machine.planner
    fields.append(f"Ov:{planner.feed_override},{planner.rapid_override},{machine.spindle_override}")
    accessories = ""
    if machine.beam.pwm:
        accessories = "S" if machine.clockwise else "C"
    if machine.flood:
        accessories += "F"
    if accessories:
        fields.append(f"A:{accessories}")
    return fields
