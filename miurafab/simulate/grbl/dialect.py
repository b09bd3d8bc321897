"""The differences between the firmwares that speak GRBL, as values.

All simulated firmwares share the planner, motion, timing and states of GRBL 1.1h. A dialect holds
the differences that a sender can see: texts, sizes, command bytes, missing features. Sources are
the firmwares' code and output:

``grbl-1.1``
    gnea/grbl 1.1h: ``serial.h``, ``protocol.h``, ``planner.h``, ``report.c``, ``config.h``.
``grbl-0.9``
    grbl/grbl 0.9j: ``report.c`` (words instead of numbers, commas in the status report, settings
    with remarks), ``serial.c`` (a ring of 128 with one place free; five command bytes, all other
    bytes go into the line), ``planner.h`` (18 blocks, one free). No jog, no overrides, no laser
    mode, no sleep.
``grblhal``
    grblHAL/core: ``grbl.h`` (more command bytes; its stop, 0x19, is a hold here), a receive buffer
    of 1024 and lines of 256; ``$I`` as boards print it. Settings go to flash or FRAM, so no bytes
    are lost meanwhile.
``fluidnc``
    bdring/FluidNC 3.7: ``Report.cpp`` (banner, ``[OPT:`` without sizes), a UART queue of 256,
    bdring/FluidNC#1036 (``$$`` lists ``$10`` alone; ``config.yaml`` holds the rest).

Not modelled: the speed of 32-bit processors (all have GRBL's timing), the additional commands and
reports of grblHAL and FluidNC, the waiting states of 0.9.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from miurafab.gcode.dialect_words import FLUIDNC, GRBLHAL

_1_1_BYTES = {
    0x18: "reset",
    ord("?"): "status",
    ord("~"): "start",
    ord("!"): "hold",
    0x84: "door",
    0x85: "cancel jog",
    **dict.fromkeys(range(0x90, 0x98), "motion override"),
    **dict.fromkeys((*range(0x99, 0x9F), 0xA0), "accessory override"),
}


@dataclass(frozen=True)
class Dialect:
    """One firmware, as a sender sees it.

    ``banner`` may be empty: nothing is said at a start. ``build_info`` are the lines of ``$I``;
    ``{}`` stands for the owner's note. ``rx_bytes``, ``line_chars`` and ``planner_blocks`` are the
    usable sizes. ``realtime`` maps the command bytes to commands; other bytes from 0x80 up are
    dropped or, with ``keeps_high_bytes``, go into the line. ``errors`` and ``alarms`` map codes to
    words; None: plain numbers. ``settings`` maps the settings that ``$$`` lists to their remarks;
    None: all settings of GRBL 1.1, without remarks. ``report_mask`` is the default of $10. With
    ``deaf_writes``, bytes that arrive while a setting is stored are lost. With ``program_flow``,
    ``$G`` reports M0 and writes rates with a point.
    """

    banner: str
    build_info: tuple[str, ...]
    name: str = "grbl-1.1"
    message: str = "[MSG:{}]\r\n"
    modes: str = "[GC:{}]\r\n"
    error: str = "error:{}\r\n"
    alarm: str = "ALARM:{}\r\n"
    errors: Mapping[int, str] | None = None
    alarms: Mapping[int, str] | None = None
    settings: Mapping[int, str] | None = None
    rx_bytes: int = 128
    tx_bytes: int = 104
    line_chars: int = 79
    planner_blocks: int = 15
    realtime: Mapping[int, str] = field(default_factory=lambda: MappingProxyType(_1_1_BYTES))
    keeps_high_bytes: bool = False
    commas: bool = False
    program_flow: bool = False
    report_mask: int = 1
    jogs: bool = True
    sleeps: bool = True
    deaf_writes: bool = True

    def error_text(self, code: int) -> str:
        """The answer ``error:``, with a number or in words."""
        words = (
            str(code) if self.errors is None else self.errors.get(code, f"Invalid gcode ID:{code}")
        )
        return self.error.format(words)

    def alarm_text(self, code: int) -> str:
        """The line ``ALARM:``, with a number or in words."""
        return self.alarm.format(code if self.alarms is None else self.alarms[code])


_ERRORS_0_9 = {
    1: "Expected command letter",
    2: "Bad number format",
    3: "Invalid statement",
    4: "Value < 0",
    5: "Setting disabled",
    6: "Value < 3 usec",
    7: "EEPROM read fail. Using defaults",
    8: "Not idle",
    9: "Alarm lock",
    10: "Homing not enabled",
    11: "Line overflow",
    12: "Step rate > 30kHz",
    13: "Check Door",
    20: "Unsupported command",
    21: "Modal group violation",
    22: "Undefined feed rate",
}
_ALARMS_0_9 = {
    1: "Hard limit",
    2: "Soft limit",
    3: "Abort during cycle",
    4: "Probe fail",
    5: "Probe fail",
    **dict.fromkeys((6, 7, 8, 9), "Homing fail"),
}
_SETTINGS_0_9 = {
    0: "step pulse, usec",
    1: "step idle delay, msec",
    2: "step port invert mask:{:08b}",
    3: "dir port invert mask:{:08b}",
    4: "step enable invert, bool",
    5: "limit pins invert, bool",
    6: "probe pin invert, bool",
    10: "status report mask:{:08b}",
    11: "junction deviation, mm",
    12: "arc tolerance, mm",
    13: "report inches, bool",
    20: "soft limits, bool",
    21: "hard limits, bool",
    22: "homing cycle, bool",
    23: "homing dir invert mask:{:08b}",
    24: "homing feed, mm/min",
    25: "homing seek, mm/min",
    26: "homing debounce, msec",
    27: "homing pull-off, mm",
    **{
        100 + 10 * kind + axis: f"{name}{words}"
        for kind, words in enumerate(
            (", step/mm", " max rate, mm/min", " accel, mm/sec^2", " max travel, mm")
        )
        for axis, name in enumerate("xyz")
    },
}

DIALECTS: Mapping[str, Dialect] = MappingProxyType(
    {
        "grbl-1.1": Dialect(
            banner="Grbl 1.1h ['$' for help]",
            build_info=("[VER:1.1h.20190830:{}]", "[OPT:V,15,128]"),
        ),
        "grbl-0.9": Dialect(
            banner="Grbl 0.9j ['$' for help]",
            build_info=("[0.9j.20160303:{}]",),
            message="[{}]\r\n",
            modes="[{}]\r\n",
            error="error: {}\r\n",
            alarm="ALARM: {}\r\n",
            errors=MappingProxyType(_ERRORS_0_9),
            alarms=MappingProxyType(_ALARMS_0_9),
            settings=MappingProxyType(_SETTINGS_0_9),
            rx_bytes=127,
            tx_bytes=63,
            planner_blocks=17,
            realtime=MappingProxyType(
                {
                    0x18: "reset",
                    ord("?"): "status",
                    ord("~"): "start",
                    ord("!"): "hold",
                    ord("@"): "door",
                }
            ),
            keeps_high_bytes=True,
            commas=True,
            program_flow=True,
            report_mask=3,
            jogs=False,
            sleeps=False,
        ),
        "grblhal": Dialect(
            name=GRBLHAL,
            banner="GrblHAL 1.1f ['$' or '$HELP' for help]",
            build_info=(
                "[VER:1.1f.20240417:{}]",
                "[OPT:VNMSL,35,1024,3,0]",
                "[AXS:3:XYZ]",
                "[NEWOPT:ENUMS,RT+,SED]",
                "[FIRMWARE:grblHAL]",
            ),
            rx_bytes=1024,
            tx_bytes=512,
            line_chars=256,
            planner_blocks=35,
            realtime=MappingProxyType(
                _1_1_BYTES
                | {0x80: "status", 0x81: "start", 0x82: "hold", 0x87: "status", 0x19: "hold"}
            ),
            deaf_writes=False,
        ),
        "fluidnc": Dialect(
            name=FLUIDNC,
            banner="Grbl 3.7 [FluidNC v3.7.8 (noradio) '$' for help]",
            build_info=("[VER:3.7 FluidNC v3.7.8:{}]", "[OPT:PHSW]"),
            settings=MappingProxyType({10: ""}),
            rx_bytes=256,
            tx_bytes=128,
            line_chars=255,
            planner_blocks=16,
            deaf_writes=False,
        ),
    }
)
"""The dialects, by their names in machine profiles."""
