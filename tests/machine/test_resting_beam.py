"""Which lines of a person would light a resting beam, and which are sent as they are."""

from __future__ import annotations

import pytest
from session_walk import MACHINE
from wires import FakeWire

from miurafab.errors import GcodeError
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.resting_beam import resting_power
from miurafab.machine.signals import StopSignals
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


def here(laser_mode: bool) -> tuple[MachineSession, FakeWire]:
    values = virtual_settings(MACHINE) | {32: float(laser_mode)}
    wire = FakeWire(VirtualGrbl(values, baud=115_200))
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    session.open()
    return session, wire


def is_sent(session: MachineSession, wire: FakeWire, line: str) -> bool:
    """Whether ``line`` is sent at once; held back, nothing of it is."""
    before = len(wire.commands)
    try:
        session.say(line)
    except GcodeError:
        assert wire.commands[before:].replace(b"$G\n", b"") == b""
        return False
    return True


@pytest.mark.parametrize(
    ("words", "laser_mode", "power"),
    [
        ([("M", 3)], False, 0.0),
        ([("S", 500)], False, 0.0),
        ([("G", 1), ("S", 500)], True, 0.0),
        ([("G", 1), ("M", 3), ("S", 500), ("X", 0)], True, 500.0),
        ([("M", 3), ("S", 500), ("X", 1)], True, 0.0),
    ],
)
def test_nothing_but_modes_lights_a_beam(
    words: list[tuple[str, float]], laser_mode: bool, power: float
) -> None:
    assert resting_power(words, laser_mode=laser_mode) == power


def test_a_burning_beam_may_be_turned_down_and_not_up() -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "M3 S500")
    assert is_sent(session, wire, "M3 S500")
    assert is_sent(session, wire, "S300")
    assert is_sent(session, wire, "S300")
    assert is_sent(session, wire, "M3 S200")
    assert not is_sent(session, wire, "S201")
    assert wire.device.beam_on
    assert session.close()
    assert not wire.device.beam_on


def test_the_weakest_beam_is_asked_for_twice_with_what_ends_it() -> None:
    session, wire = here(laser_mode=False)
    with pytest.raises(GcodeError, match=r"S0\.5, .*\(\$32=0\).* until M5 or a reset\. Send"):
        session.say("M3 S0.5")
    assert not wire.device.beam_on


@pytest.mark.parametrize("line", ["$$", "$X", "$N"])
def test_what_is_no_program_is_sent_whatever_is_armed(line: str) -> None:
    """The laser mode is left with the beam armed, dark until the next line of a program."""
    session, wire = here(laser_mode=True)
    session.say("M3 S900")
    session.say("$32=0")
    assert is_sent(session, wire, line)
    assert line.encode() + b"\n" in wire.commands


@pytest.mark.parametrize(
    "line",
    [
        *("m3 s500", "M3 s500", "/M3 S500", "$n0=m3 s500", "$N0=m3S500", "$ n 0 = M3 / S500"),
        *("$N00=M3S500", "$N0.0=M3S500", "$N+1.7=M3S500", "$N.5=M3S500"),
    ],
)
def test_a_line_is_held_back_as_the_firmware_reads_it(line: str) -> None:
    """In capitals, without blanks and the sign of block delete (gnea/grbl 1.1, ``protocol.c``), the
    number of a startup block as any other (``system.c``).
    """
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, line)
    assert not wire.device.beam_on
    assert is_sent(session, wire, line)
    assert wire.device.beam_on
    assert session.close()
    assert not wire.device.beam_on


def test_a_startup_block_that_lights_each_start_is_held_back_under_a_burning_beam() -> None:
    """It lights nothing now that does not burn, but a reset would end nothing any more."""
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "M3 S500")
    assert is_sent(session, wire, "M3 S500")
    assert not is_sent(session, wire, "$N0=M3S500")
    assert session.abort()
    assert not wire.device.beam_on


@pytest.mark.parametrize(
    ("laser_mode", "lines", "last"),
    [
        (False, ["$N0=M3", "M5"], "$N1=S500"),
        (False, ["$N1=S500", "S0"], "$N0=M3"),
        (True, ["$N0=G1F100", "G0"], "$N1=M3S500"),
    ],
)
def test_startup_blocks_that_light_each_start_together_are_held_back(
    laser_mode: bool, lines: list[str], last: str
) -> None:
    session, wire = here(laser_mode)
    assert all(is_sent(session, wire, line) for line in lines)
    with pytest.raises(GcodeError, match=r" and the next reset .*S500.*M5, and again after each"):
        session.say(last)
    assert is_sent(session, wire, last)
    assert not wire.device.beam_on
    wire.device.power_cycle()
    wire.device.advance(2.0)
    assert wire.device.beam_on


@pytest.mark.parametrize("line", ["$N0=", "$N1=M5", "$N1=S0", "$N0=G21"])
def test_a_startup_block_that_ends_what_each_start_lights_is_sent(line: str) -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "$N0=M3S500")
    assert is_sent(session, wire, "$N0=M3S500")
    session.abort()
    assert is_sent(session, wire, line)
    wire.device.power_cycle()
    wire.device.advance(2.0)
    assert not wire.device.beam_on


@pytest.mark.parametrize("number", ["0", "00.9", ".5"])
def test_a_startup_block_that_another_ends_is_ended_by_a_reset(number: str) -> None:
    session, _ = here(laser_mode=False)
    session.say("$N1=M5")
    with pytest.raises(GcodeError, match=r"=M3S500 the beam would be on, .* until M5 or a reset\."):
        session.say(f"$N{number}=M3S500")


def test_a_startup_block_has_run_when_it_is_answered() -> None:
    """Its modes are told by then, as the storing waits for its motion."""
    session, wire = here(laser_mode=True)
    assert is_sent(session, wire, "$N0=G1X30F600M3")
    assert wire.device.position[0] == pytest.approx(30.0)
    assert not is_sent(session, wire, "S900")
    assert not wire.device.beam_on
