"""The process that sends and the one that shows: either dies, and the beam goes off."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from benches import APART, Bench, children

from miurafab.errors import ControllerError, MachineError, PortError
from miurafab.gcode.job import Job
from miurafab.machine.job_process import stream_apart
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.profiles import load_machine

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="needs pseudo-terminals and /proc"
)
SHORT = Job("short.nc", "M4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\n")


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.wire.close()


def test_it_is_the_same_as_in_one_process(tmp_path: Path) -> None:
    machine = load_machine("grbl-laser-400")
    seen: list[float] = []
    plan = plan_job(SHORT, machine, SendOptions(force=frozenset({"beam"})))
    result = stream_apart(
        plan,
        "virtual",
        journal_path=tmp_path / "j",
        transcript_path=tmp_path / "t",
        on_progress=lambda now: seen.append(now.seconds_elapsed),
    )
    assert result.lines == 4
    assert seen
    assert read_journal(tmp_path / "j")[-1].ended == "done"
    assert "G1X15S500F3000" in (tmp_path / "t").read_text()


def test_its_errors_are_those_of_the_other_process() -> None:
    machine = load_machine("grbl-laser-400")
    with pytest.raises(PortError, match=r"/dev/gone does not exist"):
        stream_apart(plan_job(SHORT, machine), "/dev/gone")
    job = Job("bad.nc", "M4 S0\nG1 X5 F600\nG2 X5\nM5\n")
    plan = plan_job(job, machine, SendOptions(force=frozenset({"program"})))
    with pytest.raises(ControllerError, match=r"bad\.nc, line 3 .*reports the beam off\.$"):
        stream_apart(plan, "virtual")


def test_what_the_user_interface_raises_stops_the_machine(bench: Bench) -> None:
    """A fault in showing the progress closes the pipe; the other process does the rest."""
    code = APART.replace("journal_path=journal", "on_progress=lambda now: 1 / now.in_flight * 0")
    code = code.replace("1 / now.in_flight * 0", "(now.line > 30) and 1 / 0")
    process = bench.sender(
        code.replace("except Miur", "except ZeroDivisionError: pass\nexcept Miur")
    )
    bench.finish(process)
    assert process.returncode == 0
    assert bench.commands.endswith(b"\x18")
    bench.assert_dark_from(bench.came[-1][1])


@pytest.mark.parametrize(
    ("number", "why"),
    [
        (signal.SIGKILL, "the end of the program that started it"),
        (signal.SIGSTOP, "the silence of the program that started it"),
    ],
    ids=["killed", "frozen"],
)
def test_the_user_interface_dies(bench: Bench, tmp_path: Path, number: int, why: str) -> None:
    journal = tmp_path / "journal"
    process = bench.sender(APART, str(journal))
    try:
        gone = time.monotonic()
        process.send_signal(number)
        bench.run(lambda: b"\x18" in bench.bytes_came)
        late = time.monotonic() - gone
        assert late < (0.1 if number == signal.SIGKILL else 6.0)
        dark = bench.came[-1][1]
        bench.run(lambda: read_journal(journal)[-1].ended is not None)
        assert read_journal(journal)[-1].ended == "stopped"
        assert f"was stopped by {why};" in str(read_journal(journal)[-1].why)
        bench.assert_dark_from(dark)
    finally:
        process.kill()
        process.communicate()


def test_the_sending_process_dies(bench: Bench, tmp_path: Path) -> None:
    journal = tmp_path / "journal"
    process = bench.sender(APART, str(journal))
    (child,) = children(process)
    killed = time.monotonic()
    os.kill(child, signal.SIGKILL)
    bench.run(lambda: b"\x18" in bench.bytes_came)
    assert time.monotonic() - killed < 0.5
    dark = bench.came[-1][1]
    said = bench.finish(process)
    assert process.returncode == 3
    assert said.startswith("The process that sent long.nc was killed by signal 9; the controller")
    assert said.endswith("was reset and reports the beam off.\n")
    bench.assert_dark_from(dark)
    assert read_journal(journal)[-1].ended is None


def test_a_dead_process_at_a_port_that_is_gone_is_told(bench: Bench) -> None:
    process = bench.sender(APART)
    (child,) = children(process)
    os.kill(child, signal.SIGSTOP)
    bench.wire.unplug()
    os.kill(child, signal.SIGKILL)
    said = process.communicate(timeout=20)[0]
    assert process.returncode == 3
    assert "could not be reset" in said
    assert said.endswith("so switch the laser off at the machine.\n")
    bench.assert_dark()


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_to_the_user_interface_alone_is_passed_on_at_once(name: str) -> None:
    """Within 20 ms; the best of three, since the bench shares its processor with others."""
    delays = []
    for _ in range(3):
        bench = Bench()
        process = bench.sender(APART)
        sent = time.monotonic()
        process.send_signal(getattr(signal, name))
        bench.run(lambda b=bench: b"\x18" in b.bytes_came)
        at, virtual, _ = bench.came[-1]
        said = bench.finish(process)
        assert process.returncode == 130
        assert name in said or "Ctrl-C" in said
        assert said.endswith("the controller was reset and reports the beam off.\n")
        bench.assert_dark_from(virtual)
        bench.wire.close()
        delays.append(at - sent)
        if delays[-1] <= 0.02:
            return
    pytest.fail(f"0x18 came after {', '.join(f'{1000 * d:.0f}' for d in delays)} ms")


def test_a_process_that_cannot_start_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setattr(sys, "path", [])
    with pytest.raises(MachineError, match=r"ended with code 1 \(.*\); it had not opened the port"):
        stream_apart(plan_job(SHORT, load_machine("grbl-laser-400")), "/dev/gone")


def test_on_windows_the_sender_has_no_console_and_a_group_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The platform replaced: the constants of Windows (``winbase.h``)."""
    started: list[int] = []

    def popen(*words: object, creationflags: int, **pipes: object) -> None:
        started.append(creationflags)
        raise OSError("not started")

    monkeypatch.setattr(subprocess, "CREATE_NO_WINDOW", 0x08000000, raising=False)
    monkeypatch.setattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0x00000200, raising=False)
    monkeypatch.setattr(subprocess, "Popen", popen)
    with pytest.raises(OSError, match="not started"):
        stream_apart(plan_job(SHORT, load_machine("grbl-laser-400")), "COM3")
    assert started == [0x08000200]
