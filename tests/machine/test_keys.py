"""Keys while a job runs, proved on the bytes of the wire; the frame; dwells with the beam on."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from wires import FakeWire

from miurafab.errors import GcodeError, InputError, JobStopped
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.machine.actions import talk
from miurafab.machine.keys import NoKeys, terminal_keys
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.sender import StreamResult, deliver
from miurafab.machine.signals import StopSignals
from miurafab.machine.trace_box import frame_job
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
JOB = Job(
    "rows.nc",
    "M4 S0\n" + "".join(f"G0 X5 Y{n}\nG1 X25 S500 F3000\n" for n in range(30)) + "M5\nG0X0Y0\n",
)


class Script:
    """Keys pressed at given times of the controller's clock."""

    def __init__(self, device: VirtualGrbl, keys: list[tuple[float, str]]) -> None:
        self._device = device
        self._keys = keys

    def pressed(self) -> str:
        keys = ""
        while self._keys and self._device.now >= self._keys[0][0]:
            keys += self._keys.pop(0)[1]
        return keys


def run(*keys: tuple[float, str]) -> tuple[FakeWire, StreamResult | str]:
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    plan = plan_job(JOB, MACHINE)
    try:
        return wire, deliver(plan, wire, StopSignals(), keys=Script(wire.device, list(keys)))
    except JobStopped as stopped:
        return wire, str(stopped)


def burnt(wire: FakeWire) -> float:
    return sum(abs(s.x1 - s.x0) for s in wire.device.beam_log)


def test_a_hold_is_dark_and_a_resume_loses_nothing() -> None:
    plain, undisturbed = run()
    wire, held = run((4.0, " "), (24.0, "r"))
    assert isinstance(undisturbed, StreamResult)
    assert isinstance(held, StreamResult)
    assert held.seconds == pytest.approx(undisturbed.seconds + 20, abs=0.6)
    assert burnt(wire) == pytest.approx(burnt(plain), abs=0.1)
    assert not any(segment.standing for segment in wire.device.beam_log)
    hold = next(at for at, data in wire.written if b"!" in data)
    resume = next(at for at, data in wire.written if b"~" in data)
    assert 0 <= hold - 4.0 <= 0.02
    assert not any(hold + 0.2 < s.t1 and s.t0 < resume for s in wire.device.beam_log)


@pytest.mark.parametrize("keys", [[(4.0, "q")], [(4.0, " "), (6.0, "q")]])
def test_an_abort_comes_to_rest_and_resets(keys: list[tuple[float, str]]) -> None:
    wire, said = run(*keys)
    assert isinstance(said, str)
    assert "stopped at the keyboard" in said
    assert said.endswith("reports the beam off.")
    assert wire.commands.endswith(b"\x18")
    assert b"!" in wire.commands
    at = next(at for at, data in wire.written if b"!" in data)
    assert 0 <= at - keys[0][0] <= 0.02
    wire.settle()
    assert not wire.device.beam_on
    assert all(s.t1 <= at + 0.2 for s in wire.device.beam_log)


def test_an_abort_of_an_m3_job_is_dark_at_once() -> None:
    """A feed hold would leave the full power standing for $1."""
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    plan = plan_job(Job("m3.nc", JOB.text.replace("M4", "M3")), MACHINE, SendOptions(allow_m3=True))
    with pytest.raises(JobStopped, match="stopped at the keyboard"):
        deliver(plan, wire, StopSignals(), keys=Script(wire.device, [(4.0, "q")]))
    assert b"!" not in wire.commands
    wire.settle()
    assert not any(segment.standing for segment in wire.device.beam_log)
    assert wire.device.beam_log[-1].t1 <= 4.03


def test_the_feed_follows_the_keys() -> None:
    wire, slow = run((1.0, "-----"), (1.1, "x"))
    _, plain = run()
    assert isinstance(slow, StreamResult)
    assert isinstance(plain, StreamResult)
    assert wire.commands.count(b"\x92") == 5
    assert slow.seconds > 1.3 * plain.seconds


def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with terminal_keys() as keys:
            assert isinstance(keys, NoKeys)


@pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
def test_the_terminal_is_left_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, terminal = os.openpty()
    with os.fdopen(terminal) as stdin, os.fdopen(master, "rb", buffering=0):
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: os.getpgrp())
        before = termios.tcgetattr(terminal)
        with terminal_keys() as keys:
            assert keys.pressed() == ""
            os.write(master, b" r")
            assert keys.pressed() == " r"
            assert termios.tcgetattr(terminal)[3] != before[3]
        assert termios.tcgetattr(terminal) == before


def test_a_dark_frame_never_arms_and_a_pointer_is_weak() -> None:
    bounds = (5.0, 6.0, 80.0, 90.0)
    dark = parse_program(frame_job("a.nc", bounds, MACHINE))
    assert not dark.beam_on.any()
    assert not dark.spindle.any()
    assert dark.end[:, :2].tolist() == [[5, 6], [80, 6], [80, 90], [5, 90], [5, 6], [0, 0]]
    weak = parse_program(frame_job("a.nc", bounds, MACHINE, pointer=0.02, back_to=(3, 4)))
    assert weak.power.max() == 20
    assert weak.end[-1, :2].tolist() == [3, 4]
    assert not weak.beam_on[-1]
    for power in (0.06, -0.01):
        with pytest.raises(InputError, match="could burn"):
            frame_job("a.nc", bounds, MACHINE, pointer=power)


@pytest.mark.parametrize(
    ("text", "burns"),
    [
        ("G1 F600 X1\nM3 S500\nG4 P1\nM5\n", True),
        ("M3\nG1 X5 S500 F600\nG4 P1\nM5\n", True),
        ("M4\nG1 X5 S500 F600\nG4 P1\nM5\n", False),
        ("M3\nG1 X5 S500 F600\nM5\nG4 P1\n", False),
        ("M3\nG1 X5 S500 F600\nG0 X9\nG4 P1\nM5\n", False),
    ],
)
def test_a_dwell_with_the_beam_on_is_refused(text: str, burns: bool) -> None:
    job = Job("dwell.nc", text)
    if not burns:
        plan_job(job, MACHINE, SendOptions(allow_m3=True))
        return
    with pytest.raises(GcodeError, match=r"waits with the beam on at S500.*'force' dwell"):
        plan_job(job, MACHINE, SendOptions(allow_m3=True))
    # The virtual controller agrees: there is a standing beam.
    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    plan = plan_job(job, MACHINE, SendOptions(allow_m3=True, force=frozenset({"dwell"})))
    deliver(plan, wire, StopSignals())
    assert any(segment.standing for segment in wire.device.beam_log)


def test_more_than_the_material_takes_is_refused() -> None:
    job = Job("hot.nc", "M4 S950\nG1 X5 F600\nM5\n")
    plan_job(job, MACHINE)
    with pytest.raises(GcodeError, match=r"S950, more than the S900 .*'force' material"):
        plan_job(job, MACHINE, most_power=0.9)


def test_the_console_tells_what_is_answered_and_goes_on_after_a_refusal() -> None:
    said: list[str] = []
    talk("virtual", ["?\n", "G1 X5\n", "G0 X3 (there)\n", "oh!\n", "M3 S10\n"], said.append)
    assert said[0].startswith("<Idle|")
    assert "error:22" in said
    assert any("refused 'G1X5'" in line for line in said)
    assert any("feed hold" in line for line in said)
    assert any(line.startswith("Grbl 1.1h") for line in said)  # the reset of an armed laser
