"""The differences between dialects: the wire, the driver, and the way to stop a machine.

GRBL and its relatives are reset, Marlin is halted, a cutter is told to lift its tool. Other modules
ask here with the profile of the machine.
"""

from __future__ import annotations

from miurafab.grbl.connection import Connection
from miurafab.machine.grbl_driver import NOT_CONFIRMED, WAS_RESET, GrblDriver
from miurafab.machine.known_controller import runs_unseen
from miurafab.machine.marlin_driver import NOT_CONFIRMED as NOT_HALTED
from miurafab.machine.marlin_driver import WAS_HALTED, MarlinDriver, MarlinWire
from miurafab.machine.plotter_driver import NOT_TOLD, PEN_SENT_UP, PlotterDriver, send_up
from miurafab.machine.session import Session
from miurafab.machine.stream_driver import JobContext, StreamDriver
from miurafab.machine.transport import (
    VIRTUAL,
    Device,
    FlowTransport,
    SerialTransport,
    VirtualTransport,
)
from miurafab.motion.parameters import MotionParameters
from miurafab.plotter.stream import DROP_ALL, PEN_UP
from miurafab.profiles import MachineProfile
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.simulate.marlin.controller import VirtualMarlin
from miurafab.simulate.plotter import VirtualPlotter


def open_machine(machine: MachineProfile, port: str, speed: float | None = None) -> FlowTransport:
    """The wire to ``machine`` at ``port``: a device, a pyserial URL, or ``virtual``.

    The machine in memory is set up as the profile says and runs as fast as the computer allows, or
    at ``speed`` times real time. Raises :class:`~miurafab.errors.PortError` saying why a port
    cannot be opened.
    """
    controller = machine.controller
    if port != VIRTUAL:
        return SerialTransport(port, controller.baud, controller.flow_control)
    return VirtualTransport(virtual_machine(machine), speed, forgets=True)


def virtual_machine(machine: MachineProfile) -> Device:
    """A machine in memory, set up as the profile says."""
    controller = machine.controller
    if machine.dialect == "marlin":
        return VirtualMarlin(MotionParameters.from_profile(machine), baud=controller.baud)
    if machine.dialect == "hpgl":
        return VirtualPlotter(baud=controller.baud, rx_bytes=controller.rx_bytes)
    return VirtualGrbl(virtual_settings(machine), baud=controller.baud, dialect=machine.dialect)


def driver_of(context: JobContext) -> StreamDriver:
    """The driver for the machine of the plan."""
    return _DRIVERS.get(context.plan.machine.dialect, GrblDriver)(context)


_DRIVERS: dict[str, type[StreamDriver]] = {"marlin": MarlinDriver, "hpgl": PlotterDriver}


def make_safe(machine: MachineProfile, transport: FlowTransport) -> str:
    """Stop a machine in an unknown state; returns the outcome as a clause."""
    if machine.dialect == "marlin":
        return WAS_HALTED if MarlinWire(transport).kill() else NOT_HALTED
    if machine.dialect == "hpgl":
        told = send_up(transport, b";PU;" + DROP_ALL + PEN_UP)
        return PEN_SENT_UP if told else NOT_TOLD
    session = Session(transport, Connection())
    session.runs_at_start = runs_unseen(machine.dialect)
    return WAS_RESET if session.stop() else NOT_CONFIRMED
