"""A job read back in the dialect of its machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.gcode.hpgl_reader import parse_hpgl
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.profiles import MachineProfile

_ARC_TOLERANCE = 12
_STOCK_ARC_TOLERANCE = 0.002  # mm (``defaults.h``)


def read_program(job: Job, machine: MachineProfile) -> Program:
    """``job`` as ``machine`` would run it.

    The moves of a raised pen or knife get power 0, whatever S holds it up. Raises
    :class:`~miurafab.errors.GcodeError`, naming the line, if the machine would refuse a line.
    """
    if machine.dialect == "hpgl":
        return parse_hpgl(job)
    program = parse_program(
        job,
        laser=has_laser_mode(machine),
        arc_tolerance_mm=machine.settings.get(_ARC_TOLERANCE, _STOCK_ARC_TOLERANCE),
        inline=machine.dialect == "marlin",
        dialect=machine.dialect,
    )
    if machine.tool.kind == "laser":
        return program
    return replace(program, power=np.where(program.power == machine.tool.s_up, 0.0, program.power))


def has_laser_mode(machine: MachineProfile) -> bool:
    """Whether the controller turns the beam off in ``G0`` (GRBL 1.1 and later with ``$32=1``)."""
    return (
        machine.tool.kind == "laser"
        and machine.dialect != "grbl-0.9"
        and machine.settings.get(32, 1) == 1
    )
