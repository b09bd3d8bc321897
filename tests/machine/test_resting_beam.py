"""Which lines of a person would light a resting beam, and which are sent as they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from session_walk import HOMING, MACHINE
from wires import FakeWire

from miurafab.errors import GcodeError, MiurafabError
from miurafab.gcode.job import Job
from miurafab.machine.dialects import make_safe
from miurafab.machine.grbl_driver import WAS_RESET
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.resting_beam import resting_power
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


def here(laser_mode: bool, **more: float) -> tuple[MachineSession, FakeWire]:
    values = (
        virtual_settings(MACHINE)
        | {32: float(laser_mode)}
        | {int(n[1:]): v for n, v in more.items()}
    )
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


@pytest.mark.parametrize("line", ["$$", "$X", "$N", "$32=1", "$132=0", "$I", "$C", "$SLP"])
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
    says = r" and the next reset .*S500.*M5, and again after each"
    assert_burns_from_the_next_start(session, wire, last, says, 2.0)


def assert_burns_from_the_next_start(session, wire, line: str, says: str, seconds: float) -> None:
    """``line`` is held back in the words ``says``, and lights the beam at the next start alone."""
    with pytest.raises(GcodeError, match=says):
        session.say(line)
    assert is_sent(session, wire, line)
    assert not wire.device.beam_on
    wire.device.power_cycle()
    wire.device.advance(seconds)
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


# What is no program, and lights the beam


@pytest.mark.parametrize("line", ["$32=0", "/$32=0", "$32.9=0.9", "$3/2=256", "$+32=-0"])
def test_the_end_of_laser_mode_is_held_back_where_a_startup_block_would_burn(line: str) -> None:
    session, wire = here(laser_mode=True)
    assert is_sent(session, wire, "$N0=M3S500")
    with pytest.raises(GcodeError, match=r"and the next reset .* S500, .*\(\$32=0\).* again after"):
        session.say(line)
    assert wire.device.settings[32] == 1
    assert is_sent(session, wire, line)
    assert wire.device.settings[32] == 0
    wire.device.power_cycle()
    wire.device.advance(1.0)
    assert wire.device.beam_on


@pytest.mark.parametrize("before", [["$N0=M5S500"], [], ["$N0=M3S500", "$N1=M5"]])
def test_the_end_of_laser_mode_is_sent_where_no_startup_block_would_burn(before: list[str]) -> None:
    session, wire = here(laser_mode=True)
    assert all(is_sent(session, wire, line) for line in [*before, "$32=0"])
    assert wire.device.settings[32] == 0
    wire.device.power_cycle()
    wire.device.advance(1.0)
    assert not wire.device.beam_on


def test_what_sets_a_laser_mode_that_is_already_off_is_sent() -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "$N0=M3S500")
    assert is_sent(session, wire, "$N0=M3S500")
    assert is_sent(session, wire, "$32=0")


@pytest.mark.parametrize(
    ("laser_mode", "line", "lights"),
    [
        (True, "$RST=$", True),
        (True, "$RST=#", False),
        (True, "$RST=*", False),
        (False, "$RST=#", True),
        (False, "$RST=*", False),
    ],
)
def test_a_line_that_ends_in_a_reset_is_held_back_where_its_startup_blocks_burn(
    laser_mode: bool, line: str, lights: bool
) -> None:
    """GRBL's own laser mode is off, and ``$RST=*`` clears the blocks."""
    session, wire = here(laser_mode)
    assert is_sent(session, wire, "$N0=M3S500") == laser_mode
    if not laser_mode:
        session.say("$N0=M3S500")
        session.say("M5")
    assert is_sent(session, wire, line) != lights
    if lights:
        session.say(line)
    assert session.state.beam_on == wire.device.beam_on == lights
    assert session.close()
    wire.device.advance(5.0)
    assert not wire.device.beam_on


def test_the_end_of_the_check_mode_is_held_back_where_its_reset_would_burn() -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "$N0=M3S500")
    assert is_sent(session, wire, "$N0=M3S500")
    session.say("M5")
    assert is_sent(session, wire, "$C")
    assert not is_sent(session, wire, "$C")
    assert is_sent(session, wire, "$C")
    assert session.state.beam_on
    assert wire.device.beam_on
    assert session.close()
    assert not wire.device.beam_on


def test_homing_is_held_back_where_a_startup_block_burns_with_what_was_typed() -> None:
    session, wire = here(laser_mode=False, **{f"_{n}": value for n, value in HOMING.items()})
    session.unlock()
    assert all(is_sent(session, wire, line) for line in ["$N0=M3", "M5", "S500"])
    with pytest.raises(
        GcodeError, match=r"After \$H the beam would be on, with S500, .* or a reset"
    ):
        session.say("$H")
    assert is_sent(session, wire, "$H")
    assert wire.device.beam_on
    assert session.close()
    assert not wire.device.beam_on


@pytest.mark.parametrize("laser_mode", [False, True])
def test_the_key_of_homing_leaves_no_beam_on(laser_mode: bool) -> None:
    """It asks for nothing twice: what the startup block lights goes out at once."""
    session, wire = here(laser_mode, **{f"_{n}": value for n, value in HOMING.items()})
    session.unlock()
    block = "$N0=G1F100M3" if laser_mode else "$N0=M3"
    assert all(is_sent(session, wire, line) for line in [block, "M5", "S500"])
    assert session.home().idle
    assert not wire.device.beam_on
    assert sum(s.t1 - s.t0 for s in wire.device.beam_log if s.standing) < 0.1
    assert "M5" in session.state.modes


def test_what_homing_runs_is_asked_for_before_the_head_moves_again() -> None:
    """A jog burnt its way from the second homing on, and a job began in inches."""
    session, wire = here(laser_mode=True, **{f"_{n}": value for n, value in HOMING.items()})
    session.unlock()
    session.say("$N0=M3S1000G20")
    for _ in range(2):
        session.home()
        session.jog(x=-9.0, y=-9.0)
    assert wire.device.beam_log == []
    session.set_origin()
    session.home()
    session.cut(plan_job(Job("dark.nc", "G1 X20 F3000\n"), MACHINE))
    assert session.state.position[0] == pytest.approx(20, abs=0.1)
    assert wire.device.beam_log == []


def test_a_job_that_homes_first_begins_in_known_modes() -> None:
    session, wire = here(laser_mode=True, **{f"_{n}": value for n, value in HOMING.items()})
    session.unlock()
    assert all(is_sent(session, wire, line) for line in ["$N0=M3S1000", "M5S0"])
    session.look()
    session.cut(plan_job(Job("dark.nc", "G1 X-20 F3000\n"), MACHINE, SendOptions(home=True)))
    assert wire.device.beam_log == []


@pytest.mark.parametrize("line", ["M4", "M3S0", "$N0=M4", "G1F100M4S1"])
@pytest.mark.parametrize("range_", ["$31=1000", "$30=0"])
def test_what_arms_is_held_back_where_each_s_is_full_power(range_: str, line: str) -> None:
    """S0 too, in laser mode, at rest (``spindle_compute_pwm_value`` of ``spindle_control.c``)."""
    session, wire = here(laser_mode=True)
    assert all(is_sent(session, wire, each) for each in (line, "M5", "$N0=", range_))
    assert not is_sent(session, wire, line)
    assert not wire.device.beam_on
    assert is_sent(session, wire, line)
    assert wire.device.beam_on
    assert session.close()
    assert not wire.device.beam_on


def test_a_beam_at_full_power_that_few_reports_tell_is_put_out_at_the_close() -> None:
    """GRBL tells what is armed in one report of ten, and with ``$30=0`` no S (``report.c``)."""
    session, wire = here(laser_mode=True, _30=0)
    assert not is_sent(session, wire, "M4S0")
    assert is_sent(session, wire, "M4S0")
    session.watch(0.5)
    assert wire.device.beam_on
    assert session.close()
    assert not wire.device.beam_on


@pytest.mark.parametrize("range_", ["$31=1000", "$30=0", "$3/1.2=1000", "$30=0.5"])
def test_what_makes_each_s_full_power_is_held_back_where_a_startup_block_would_burn(
    range_: str,
) -> None:
    """A setting of either puts the beam out at first (gnea/grbl 1.1, ``settings.c``)."""
    session, wire = here(laser_mode=True)
    assert all(
        is_sent(session, wire, line) for line in ("$N0=M4", "$31=1", "$30=500", "$32=1", "$130=0")
    )
    says = r"and the next reset .*\(\$32=1\).* again after each"
    assert_burns_from_the_next_start(session, wire, range_, says, 1.0)


def test_what_leaves_each_s_full_power_is_sent() -> None:
    session, wire = here(laser_mode=True)
    assert all(is_sent(session, wire, line) for line in ("$31=1000", "$N1=M5S0", "$31=2000"))
    session, wire = here(laser_mode=True, _31=1000)
    assert not is_sent(session, wire, "$N0=M4")
    assert is_sent(session, wire, "$N0=M4")
    assert is_sent(session, wire, "$31=2000")
    assert is_sent(session, wire, "$31=0")
    wire.device.power_cycle()
    wire.device.advance(1.0)
    assert not wire.device.beam_on


@pytest.mark.parametrize(
    ("laser_mode", "armed", "lights"),
    [(True, "M3S500", True), (True, "M4S500", False), (False, "", False), (True, "M5S500", False)],
)
def test_a_jog_with_an_armed_beam_that_stays_on_behind_it_is_held_back(
    laser_mode: bool, armed: str, lights: bool
) -> None:
    session, wire = here(laser_mode)
    if armed:
        session.say(armed)
    assert is_sent(session, wire, "$J=G91X5F600") != lights
    if lights:
        session.say("$J=G91X5F600")
    wire.device.advance(3.0)
    assert wire.device.beam_on == lights
    assert session.close()
    assert not wire.device.beam_on


@pytest.mark.parametrize("order", [b"\x99", b"\x9a", b"\x9b", b"\x9c", b"\x9d"])
@pytest.mark.parametrize(("laser_mode", "armed"), [(True, "M3S500"), (False, "M4S500")])
def test_a_power_override_lights_no_armed_beam_at_rest(
    laser_mode: bool, armed: str, order: bytes
) -> None:
    """GRBL then sets the beam by spindle and S alone, whatever keeps it dark (``protocol.c``)."""
    session, wire = here(laser_mode=True)
    session.say("$J=G91X9F600")
    session.realtime(b"\x9a")  # it moves
    session.settle()
    assert session.state.overrides.power == 110
    said: list[str] = []
    session.lines.on_line = said.append
    session.realtime(b"\x9b")  # nothing is armed
    session.realtime(b"\x9a")
    session.watch(0.3)
    assert said == []
    session.say(armed)
    if not laser_mode:
        session.say("$32=0")
    said.clear()
    sent = wire.commands
    session.realtime(order)
    session.watch(0.3)
    assert said == ["At rest a change of the power would light the armed beam."]
    assert wire.commands == sent
    assert not wire.device.beam_on


def test_a_job_begins_dark_whatever_override_was_left_with_an_armed_beam() -> None:
    session, wire = here(laser_mode=True)
    session.say("$J=G91X9F600")
    session.realtime(b"\x9a")
    session.settle()
    session.say("M3S500")
    plan = plan_job(Job("a.nc", "M4 S0\nG1 X20 S500 F3000\nM5\n"), MACHINE)
    assert session.cut(plan).lines == 3
    assert standing_seconds(wire.device.beam_log) == 0.0


def test_a_line_that_was_held_back_before_a_job_is_held_back_after_it() -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "M3S500")
    session.cut(
        plan_job(Job("a.nc", "G0 X9\n"), MACHINE, SendOptions(force=frozenset({"laser-mode"})))
    )
    with pytest.raises(GcodeError, match="Send the same line again"):
        session.say("M3S500")
    assert not wire.device.beam_on


@pytest.mark.parametrize("action", ["jog", "nudge", "unlock", "set_origin", "load", "abort"])
def test_a_line_that_was_held_back_before_another_action_is_held_back_after_it(action: str) -> None:
    session, wire = here(laser_mode=False)
    ways = {"jog": {"x": 5.0}, "nudge": {"dx": 1.0, "dy": 0.0}}
    assert not is_sent(session, wire, "M3S500")
    getattr(session, action)(**ways.get(action, {}))
    session.watch(1.0)
    assert not is_sent(session, wire, "M3S500")
    assert not wire.device.beam_on


def test_a_look_between_two_equal_lines_is_no_action() -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "M3S500")
    session.say("?")
    session.look()
    assert is_sent(session, wire, "M3S500")
    assert session.close()


@pytest.mark.parametrize("text", ["M4 S0\nG0 X9\nM5\n", "G0 X500\n"])
def test_a_beam_that_rests_before_a_job_goes_out_with_the_refusal(text: str) -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "M3S500")
    assert is_sent(session, wire, "M3S500")
    plan = plan_job(Job("a.nc", text), MACHINE, SendOptions(force=frozenset({"bounds"})))
    with pytest.raises(MiurafabError, match=r"beam on before .* and reports the beam off\."):
        session.cut(plan)
    assert not wire.device.beam_on
    assert session.close()


def test_a_beam_that_rests_while_a_job_cannot_begin_goes_out_at_the_close(tmp_path: Path) -> None:
    session, wire = here(laser_mode=False)
    assert not is_sent(session, wire, "M3S500")
    assert is_sent(session, wire, "M3S500")
    plan = plan_job(Job("a.nc", "G0 X9\n"), MACHINE)
    with pytest.raises(MiurafabError, match="journal"):
        session.cut(plan, journal_path=tmp_path)
    assert wire.device.beam_on
    assert session.close()
    assert not wire.device.beam_on


@pytest.mark.parametrize("block", ["M3S500", "G4P2M3S500"])
def test_a_beam_that_a_start_lights_is_put_out_when_the_port_is_left(block: str) -> None:
    """The opening of the port resets most boards; a block may wait before it burns."""
    session, wire = here(laser_mode=False)
    session.say("$N0=G4P2" if "G4" in block else "$N0=")
    for _ in range(2):
        is_sent(session, wire, "$N1=M3S500")
    assert session.close()
    assert not wire.device.beam_on
    wire.device.advance(5.0)
    assert not wire.device.beam_on
    wire.device.power_cycle()
    again = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    again.open()
    assert again.close()
    wire.device.advance(5.0)
    assert not wire.device.beam_on


def test_what_a_start_lights_behind_a_wait_is_known_when_the_line_is_done() -> None:
    """So that a session that is closed then puts it out."""
    session, wire = here(laser_mode=False)
    assert is_sent(session, wire, "$N0=G4P2")
    for line in ("$N1=M3S500", "$N1=M3S500", "M5", "$RST=#", "$RST=#"):
        is_sent(session, wire, line)
    assert b"$RST=#\n$G\n" in wire.commands  # which is answered behind the blocks
    assert session.state.beam_on
    assert session.close()
    wire.device.advance(5.0)
    assert not wire.device.beam_on


def test_a_locked_controller_runs_no_startup_block_and_is_known_dark() -> None:
    session, wire = here(laser_mode=True, **{f"_{n}": value for n, value in HOMING.items()})
    session.unlock()
    session.say("$N0=M3S500")
    wire.device.power_cycle()
    again = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    assert again.open().state == "Alarm"
    assert again.abort()


def test_a_machine_of_which_nothing_was_told_is_reset_behind_a_key(tmp_path: Path) -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    session.realtime(b"~")
    with pytest.raises(MiurafabError, match="journal"):
        session.cut(plan_job(Job("a.nc", "G0 X9\n"), MACHINE), journal_path=tmp_path)
    session.close()
    assert b"\x18" in wire.commands


def test_a_move_goes_on_after_no_job_that_could_not_begin(tmp_path: Path) -> None:
    session, wire = here(laser_mode=True)
    session.say("G1 X90 F300")
    with pytest.raises(MiurafabError, match="journal"):
        session.cut(plan_job(Job("a.nc", "G0 X9\n"), MACHINE), journal_path=tmp_path)
    assert session.close()
    at = wire.device.position
    wire.device.advance(5.0)
    assert wire.device.position == at


class Macros(FakeWire):
    """FluidNC that runs a macro of two lines behind each reset and each ``$X``."""

    unlocks, unanswered, dwell = False, 0, b"0.3"

    def write(self, data: bytes) -> None:
        self.unlocks = self.unlocks or data in (b"$X\n", b"$H\n")
        super().write(data)

    def read(self, timeout: float) -> bytes:
        said = super().read(timeout)
        if self.unanswered and b"ok\r\n" in said:  # a macro is not answered
            self.unanswered -= 1
            said = said.replace(b"ok\r\n", b"", 1)
        elif b"Grbl" in said or (self.unlocks and b"ok" in said):
            self.device.receive(b"G4P" + self.dwell + b"\nG1F100M3S500\n")
            self.unlocks, self.unanswered = False, 2
        return said


def with_macros(homing: bool = False) -> Macros:
    settings = virtual_settings(load_machine("fluidnc-laser-600")) | (HOMING if homing else {})
    return Macros(VirtualGrbl(settings, baud=115_200, dialect="fluidnc"))


@pytest.mark.parametrize("action", ["unlock", "home"])
@pytest.mark.parametrize("dwell", [b"0.3", b"5"])
def test_what_a_macro_of_fluidnc_lights_behind_an_action_is_put_out(
    dwell: bytes, action: str
) -> None:
    """However long it takes; a reset, which runs the other macro, is not needed."""
    wire = with_macros(action == "home")
    session = MachineSession(wire, StopSignals(), PortSetup("fluidnc"))
    session.open()
    wire.dwell = dwell
    assert getattr(session, action)().beam_off
    assert session.close()
    wire.device.advance(9.0)
    assert not wire.device.beam_on
    assert b"\x18" not in wire.commands


def test_what_a_macro_of_fluidnc_lights_behind_a_typed_line_is_put_out_at_the_close() -> None:
    wire = with_macros()
    session = MachineSession(wire, StopSignals(), PortSetup("fluidnc"))
    session.command("M5")
    session.say("$X")
    assert session.state.beam_on
    assert session.close()
    wire.device.advance(9.0)
    assert not wire.device.beam_on


def test_a_signal_while_a_macro_runs_behind_an_unlocking_resets() -> None:
    wire, signals = with_macros(), StopSignals()
    session = MachineSession(wire, signals, PortSetup("fluidnc"))
    assert session.command("M5").beam_off

    def press(call: int) -> None:
        if b"$X" in wire.commands and signals.caught is None:
            signals.caught = "SIGINT"

    wire.before_call = press
    with pytest.raises(KeyboardInterrupt):
        session.unlock()
    session.close()
    wire.device.advance(9.0)
    assert b"\x18" in wire.commands
    assert not wire.device.beam_on


def test_what_a_macro_of_fluidnc_lights_behind_a_reset_is_put_out() -> None:
    wire = with_macros()
    session = MachineSession(wire, StopSignals(), PortSetup("fluidnc"))
    session.open()
    assert session.abort()
    wire.device.advance(5.0)
    assert not wire.device.beam_on
    wire.device.receive(b"M3S500G1F100\n")
    assert make_safe(load_machine("fluidnc-laser-600"), wire) == WAS_RESET
    wire.device.advance(5.0)
    assert not wire.device.beam_on
