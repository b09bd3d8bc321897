"""One session with the machine, from the first frame of a job to its last sheet."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from benches import MACHINE, Bench, Terminal, children
from small_jobs import write_job
from wires import FakeWire

from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import JobPlan, SendOptions
from miurafab.machine.progress import StreamResult
from miurafab.machine.signals import StopSignals
from miurafab.machine.watchdog import SILENCE_S
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import cut_prepared

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="needs pseudo-terminals and /proc"
)
FAST = 30.0
"""Virtual seconds a real second."""
ASKED = "press Enter"
IDLE_S = 0.0255
"""The step idle delay ($1) of the bench, for which a hold may leave the last power on."""
BEGIN, STROKE = "G21 G90 G94\nM4 S0\n", "G0 X5 Y5\nG1 X15 S500 F2000\n"
LARGE = (
    "holder killed",
    "command killed",
    "Ctrl-C in sheet 2",
    "holder killed in sheet 2",
    "error in sheet 2",
)


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench(speed=FAST)
    yield bench
    bench.wire.close()


def asked(bench: Bench, screen: Terminal, folder: Path) -> subprocess.Popen[bytes]:
    """A command in a terminal that has cut the first of two sheets and asks for Enter."""
    job = write_job(folder / "job", 2)
    command = [sys.executable, "-m", "miurafab", "cut", str(job), "--machine", MACHINE]
    process = subprocess.Popen(
        [*command, "--port", bench.wire.address, "--at", "0,0"], **screen.options()
    )
    try:
        bench.run(lambda: ASKED in screen.shown, 25)
    except BaseException:
        process.kill()
        process.wait()
        raise
    return process


def ended(bench: Bench, process: subprocess.Popen[bytes]) -> int:
    """Its exit code."""
    bench.run(lambda: process.poll() is not None, 40)
    return process.wait()


def sent(transcript: Path) -> list[str]:
    """The lines that were sent, by a transcript, without the status queries."""
    said = [line.split(" ", 2)[2] for line in transcript.read_text().splitlines() if " > " in line]
    return [line for line in "".join(said).replace("?", "").split("\\n") if line]


def test_the_session_lives_while_a_person_is_waited_for_and_greets_once(
    bench: Bench, screen: Terminal, tmp_path: Path
) -> None:
    process = asked(bench, screen, tmp_path)
    (holder,) = children(process)
    late = bench.device.now + (SILENCE_S + 0.7) * FAST
    bench.run(lambda: bench.device.now > late)
    assert children(process) == [holder]
    screen.type(b"\n")
    assert ended(bench, process) == 0
    bench.assert_dark()
    assert b"\x18" not in bench.commands
    folder = tmp_path / "job"
    text = (folder / "sheet-01.nc").read_text()
    job = [line.data.decode() for line in Job("sheet-01.nc", text).send_lines()]
    first, second = (sent(folder / f"sheet-0{n}.transcript") for n in (1, 2))
    # From first to last line the same bytes. The greeting and its five questions are gone; what
    # the last job may have left is set back, as on any board that was not reset.
    assert first[-len(job) :] == second[-len(job) :] == job
    assert first[: -len(job)] == [
        *("$I", "$$", "$#", "$G", "$N"),
        "\\x90\\x95\\x99G21G90G17G94G54",
        *("G92X0.000Y0.000", "$#"),
    ]
    assert second[: -len(job)] == [
        "\\x90\\x95\\x99G21G90G17G94G54G0F0S0",
        *("G92X0.000Y0.000", "$#"),
    ]


@pytest.mark.parametrize(
    "fault", ["Ctrl-C", "cable", *(pytest.param(n, marks=pytest.mark.large) for n in LARGE)]
)
def test_a_fault_while_a_person_is_waited_for_or_later_ends_dark(
    fault: str, bench: Bench, screen: Terminal, tmp_path: Path
) -> None:
    process = asked(bench, screen, tmp_path)
    (holder,) = children(process)
    lines, burnt = bench.commands.count(b"\n"), len(bench.device.beam_log)
    if fault == "Ctrl-C":
        screen.type(b"\x03")
        assert ended(bench, process) == 130
        assert "was stopped by Ctrl-C" in " ".join(screen.shown.split())
    elif fault == "holder killed":
        os.kill(holder, signal.SIGKILL)  # told at once, without a key
        assert ended(bench, process) == 3
        assert "was killed by signal 9; the controller was reset" in " ".join(screen.shown.split())
    elif fault == "command killed":
        process.kill()
        process.wait()
    elif fault == "cable":
        bench.wire.unplug()
        assert ended(bench, process) == 3
        assert "went away" in screen.shown
    else:
        screen.type(b"\n")
        bench.run(lambda: bench.device.beam_on)
        burnt = len(bench.device.beam_log) + 1
        if fault == "Ctrl-C in sheet 2":
            screen.type(b"\x03")
        elif fault == "holder killed in sheet 2":
            os.kill(holder, signal.SIGKILL)
        else:
            bench.device.receive(b"$\n")  # answers with an ok that was not asked for
            bench.device.receive(b"G1X\n")  # and an error
        assert ended(bench, process) == (130 if "Ctrl-C" in fault else 3)
        assert b"\x18" in bench.commands
        assert read_journal(tmp_path / "job" / "sheet-01.journal")[-1].ended == "done"
    bench.run(lambda: not Path(f"/proc/{holder}").exists())
    bench.assert_dark()
    if "sheet 2" not in fault:
        assert len(bench.device.beam_log) == burnt
        assert bench.commands.count(b"\n") <= lines + 2  # what it asked meanwhile


def stopped(process: subprocess.Popen[bytes]) -> bool:
    """Whether it is suspended, as a shell would see it."""
    return Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"


@pytest.mark.parametrize(
    "then", ["r", *(pytest.param(n, marks=pytest.mark.large) for n in ("kill", "Ctrl-C"))]
)
def test_ctrl_z_holds_the_machine_dark_until_a_person_is_back(
    then: str, screen: Terminal, tmp_path: Path
) -> None:
    """Longer than a silent program counts as hung. The process with the port goes on working."""
    bench = Bench(speed=4.0)
    job = tmp_path / "strokes.nc"
    job.write_text(BEGIN + STROKE * 45 + "M5\n")
    process = bench.cut(job, "--at", "0,0", **screen.options() | {"text": False})
    bench.until_burning(process)
    (holder,) = children(process)
    at = screen.type(b"\x1a")
    bench.run(lambda: stopped(process))
    bench.run(lambda: bench.device.state.startswith("Hold") and not bench.device.beam_on)
    (hold,) = [when for when, _, data in bench.came if b"!" in data]
    assert hold - at < 0.5
    assert not bench.device.beam_on
    burnt = len(bench.device.beam_log)
    late = bench.device.now + (SILENCE_S + 0.7) * 4.0
    bench.run(lambda: bench.device.now > late)
    assert stopped(process)
    assert Path(f"/proc/{holder}").exists()
    assert len(bench.device.beam_log) == burnt
    assert b"\x18" not in bench.commands
    if then == "kill":
        process.kill()
        bench.run(lambda: b"\x18" in bench.commands)
        process.wait()
    else:
        process.send_signal(signal.SIGCONT)
        bench.run(lambda: not stopped(process))
        screen.type(b"\x03" if then == "Ctrl-C" else b"r")
        bench.run(lambda: bool(screen.shown) and process.poll() is not None, 60)
        assert process.wait() == (130 if then == "Ctrl-C" else 0)
    bench.run(lambda: not Path(f"/proc/{holder}").exists())
    bench.device.advance(60.0)
    assert not bench.device.beam_on
    assert standing_seconds(bench.device.beam_log) <= IDLE_S
    assert (b"\x18" in bench.commands) == (then != "r")
    if then == "r":
        burnt_mm = sum(abs(each.x1 - each.x0) for each in bench.device.beam_log)
        assert burnt_mm == pytest.approx(45 * 10.0, abs=1.0)  # in steps
    bench.wire.close()


def test_ctrl_z_while_a_person_is_waited_for_changes_nothing(
    bench: Bench, screen: Terminal, tmp_path: Path
) -> None:
    process = asked(bench, screen, tmp_path)
    screen.type(b"\x1a")
    bench.run(lambda: stopped(process))
    process.send_signal(signal.SIGCONT)
    bench.run(lambda: not stopped(process))
    assert b"!" not in bench.commands
    screen.type(b"\n")
    assert ended(bench, process) == 0
    bench.assert_dark()


def test_a_machine_is_homed_once_a_sheet_and_the_head_keeps_its_place(tmp_path: Path) -> None:
    """With a frame: that of each sheet homes, and its cut goes on from there."""
    prepared = prepare(write_job(tmp_path / "job", 2))
    places: list[tuple[float, float] | None] = []
    homed: list[bool] = []

    class Seen(MachineSession):
        """One that notes the orders, and does not home: its machine has no switches."""

        def frame(self, plan: JobPlan, **more: object) -> StreamResult:
            return super().frame(self._noted(plan), **more)

        def cut(self, plan: JobPlan, **more: object) -> StreamResult:
            return super().cut(self._noted(plan), **more)

        def _noted(self, plan: JobPlan) -> JobPlan:
            places.append(plan.at)
            homed.append(plan.options.home)
            return replace(plan, options=replace(plan.options, home=False))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("miurafab.machine.sender.MachineSession", Seen)
        send = SendOptions(home=True, at=(5.0, 6.0), force=frozenset({"travel"}))
        options = CutOptions(send=send, frame=True)
        cut_prepared(prepared, port="virtual", options=options)
    assert homed == [True, False, True, False]
    assert places == 4 * [(5.0, 6.0)]


def test_a_lid_that_was_opened_to_change_the_material_is_no_end() -> None:
    wire = FakeWire(VirtualGrbl(virtual_settings(load_machine(MACHINE))))
    session = MachineSession(wire, StopSignals())
    session.open()
    wire.device.receive(b"\x84")
    session.watch(0.5)
    assert session.state.state == "Door:0"
    assert session.load().state == "Idle"
    assert session.close()
