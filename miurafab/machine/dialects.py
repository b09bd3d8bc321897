"""What differs between machines by what they speak: the wire, the delivery, and the way to stop.

GRBL and its kin are reset, Marlin is halted, a cutter is told to lift its tool. Whoever needs one
of these asks here by the machine's profile.
"""

from __future__ import annotations

from miurafab.grbl.connection import Connection
from miurafab.machine.delivery import Delivery, Errand
from miurafab.machine.grbl_delivery import NOT_CONFIRMED, WAS_RESET, GrblDelivery
from miurafab.machine.marlin_delivery import NOT_CONFIRMED as NOT_HALTED
from miurafab.machine.marlin_delivery import WAS_HALTED, MarlinDelivery, MarlinWire
from miurafab.machine.plotter_delivery import NOT_TOLD, PEN_SENT_UP, PlotterDelivery, send_up
from miurafab.machine.session import Session
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


def delivery_of(errand: Errand) -> Delivery:
    """How the errand's plan is delivered to its machine."""
    return _DELIVERIES.get(errand.plan.machine.dialect, GrblDelivery)(errand)


_DELIVERIES: dict[str, type[Delivery]] = {"marlin": MarlinDelivery, "hpgl": PlotterDelivery}


def make_safe(machine: MachineProfile, transport: FlowTransport) -> str:
    """Stop a machine of which nothing is known; what became of that, as a clause."""
    if machine.dialect == "marlin":
        return WAS_HALTED if MarlinWire(transport).kill() else NOT_HALTED
    if machine.dialect == "hpgl":
        told = send_up(transport, b";PU;" + DROP_ALL + PEN_UP)
        return PEN_SENT_UP if told else NOT_TOLD
    return WAS_RESET if Session(transport, Connection()).stop() else NOT_CONFIRMED
