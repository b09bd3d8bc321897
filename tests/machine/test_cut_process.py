"""``miurafab cut`` as people run it, on a practice machine in real time, ended in every way.

The command, the process that sends, the pseudo-terminal and the terminal are the real ones.
test_adversarial.py has the same faults, and more, on the controller's clock.
"""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from benches import Bench, Terminal, children
from dashes import STROKES, burnt, dashes

from miurafab.machine.journal import read_journal
from miurafab.machine.resume import resume
from miurafab.profiles import load_machine

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux")
JOB = dashes("absolute")
RESET = "the controller was reset and reports the beam off."


@pytest.fixture
def nc(tmp_path: Path) -> Path:
    path = tmp_path / JOB.name
    path.write_text(JOB.text)
    return path


def words(said: str) -> str:
    """The error sentence, unwrapped."""
    return " ".join(said.partition("miurafab: ")[2].split())


def end(bench: Bench) -> None:
    bench.wire.close()


def resumes(bench: Bench, nc: Path) -> None:
    """The job goes on, and every stroke is burnt, only those stated twice."""
    journal = nc.with_suffix(".journal")
    rest = resume(JOB, load_machine("grbl-laser-400"), read_journal(journal))
    first = list(bench.device.beam_log)
    said = bench.finish(bench.cut(nc, "--resume", "--at", "0,0", "--quiet"), 60)
    assert rest.finding.sentence in " ".join(said.split())
    counts = burnt(JOB, [first, bench.device.beam_log[len(first) :]])
    assert all(counts[index] for index in range(STROKES))
    twice = {index % 1000 for index, count in counts.items() if count > 1 or index >= 1000}
    assert twice <= set(range(rest.stroke, rest.new_stroke))
    assert read_journal(journal)[-1].ended == "done"


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("disconnect=500ms@2000", "went away"),
        pytest.param("reset@5s", "restarted by itself|ALARM:3", marks=pytest.mark.large),
        pytest.param("alarm@5s", "ALARM:1, a limit switch was hit", marks=pytest.mark.large),
        pytest.param("power@2000", "restarted by itself", marks=pytest.mark.large),
        pytest.param("hang=20s@5s", "has said nothing for 3 s", marks=pytest.mark.large),
        pytest.param("drop-reply=90@5s", "has not answered line", marks=pytest.mark.large),
        pytest.param("drop=all@5s", "has said nothing for 3 s", marks=pytest.mark.large),
    ],
)
def test_a_fault_in_mid_job_and_on_again(fault: str, said: str, nc: Path) -> None:
    import re

    bench = Bench(fault, speed=4)
    process = bench.until_burning(bench.cut(nc, "--at", "0,0"))
    shown = words(bench.finish(process, 60))
    assert process.returncode == 3
    assert re.search(said, shown)
    assert shown.endswith((RESET, "switch the laser off at the machine."))
    assert not any(s.standing and s.t1 - s.t0 > 0.026 for s in bench.device.beam_log)
    if "all" in fault:
        bench.assert_dark()
        end(bench)
        return
    bench.run(lambda: bench.device.connected and not bench.device.beam_on)
    resumes(bench, nc)
    end(bench)


def test_ctrl_c_in_the_terminal_is_on_the_wire_within_20_ms(nc: Path) -> None:
    delays = []
    for _ in range(3):
        bench, terminal = Bench(), Terminal()
        process = bench.until_burning(bench.cut(nc, **terminal.options()))
        typed = terminal.type(b"\x03")
        bench.run(lambda b=bench: b"\x18" in b.bytes_came)
        at, virtual, _ = bench.came[-1]
        bench.run(lambda p=process: p.poll() is not None)
        assert process.wait() == 130
        shown = words(terminal.shown)
        assert shown.startswith(f"{JOB.name} was stopped by Ctrl-C; ")
        assert shown.endswith(RESET)
        assert "Traceback" not in terminal.shown
        bench.assert_dark_from(virtual)
        terminal.close()
        end(bench)
        delays.append(at - typed)
        if delays[-1] <= 0.02:
            return
    pytest.fail(f"0x18 came after {', '.join(f'{1000 * d:.0f}' for d in delays)} ms")


def test_the_terminal_is_closed(nc: Path) -> None:
    bench, terminal = Bench(), Terminal()
    process = bench.until_burning(bench.cut(nc, **terminal.options()))
    terminal.close()
    bench.run(lambda: b"\x18" in bench.bytes_came)
    virtual = bench.came[-1][1]
    bench.run(lambda: process.poll() is not None)
    assert process.wait() == 130
    run = read_journal(nc.with_suffix(".journal"))[-1]
    assert run.ended == "stopped"
    assert "was stopped by the closing of the terminal (SIGHUP)" in str(run.why)
    bench.assert_dark_from(virtual)
    end(bench)


def test_keys_in_the_terminal_are_on_the_wire_within_20_ms(nc: Path) -> None:
    bench, terminal = Bench(), Terminal()
    process = bench.until_burning(bench.cut(nc, **terminal.options()))
    delays = []
    for key, byte in ((b" ", b"!"), (b"r", b"~"), (b"+", b"\x91"), (b" ", b"!"), (b"r", b"~")):
        before = len(bench.bytes_came)
        typed = terminal.type(key)
        bench.run(lambda b=byte, n=before: b in bench.bytes_came[n:])
        delays.append(bench.came[-1][0] - typed)
        until = bench.device.now + 0.3
        bench.run(lambda u=until: bench.device.now > u)
    assert sorted(delays)[2] <= 0.02, delays  # others have the processor now and then
    terminal.type(b"q")
    bench.run(lambda: process.poll() is not None)
    assert process.wait() == 130
    assert "was stopped at the keyboard" in words(terminal.shown)
    assert bench.commands.endswith(b"!\x18")
    assert "stroke" in terminal.shown
    bench.device.advance(60)
    assert not bench.device.beam_on
    terminal.close()
    end(bench)


@pytest.mark.parametrize("whom", ["sender", pytest.param("both", marks=pytest.mark.large)])
def test_kill_9_and_on_again(whom: str, nc: Path) -> None:
    bench = Bench(speed=4)
    process = bench.until_burning(bench.cut(nc, "--at", "0,0"))
    (sender,) = children(process)
    if whom == "both":
        process.kill()
    os.kill(sender, signal.SIGKILL)
    said = words(bench.finish(process))
    if whom == "sender":
        assert process.returncode == 3
        assert said.startswith(f"The process that sent {JOB.name} was killed by signal 9; ")
        assert said.endswith(RESET)
        assert b"\x18" in bench.bytes_came
    bench.run(lambda: bench.device.state in ("Idle", "Alarm"))
    assert not bench.device.beam_on
    assert not any(segment.standing for segment in bench.device.beam_log)
    assert read_journal(nc.with_suffix(".journal"))[-1].ended is None
    resumes(bench, nc)
    end(bench)


def test_a_disk_that_fills_up(nc: Path) -> None:
    """The limit on the size of files stands for the disk: a write beyond it fails."""
    bench = Bench()

    import resource

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))

    more = {"preexec_fn": limit, "env": os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}}
    process = bench.cut(nc, "--at", "0,0", **more)
    said = " ".join(bench.finish(process, 60).split())
    # The journal is short. The transcript, which holds every byte, is told and costs no sheet.
    assert process.returncode == 0
    assert "warning (records): The transcript" in said
    assert "can no longer be written: File too large" in said
    assert bench.commands.count(b"\x18") == 0
    bench.assert_dark_from(bench.came[-1][1])
    end(bench)


@pytest.mark.large
def test_a_journal_that_cannot_be_written_stops_before_the_port_is_used(nc: Path) -> None:
    nc.with_suffix(".journal").mkdir()
    bench = Bench()
    process = bench.cut(nc)
    said = words(bench.finish(process))
    assert process.returncode == 2
    assert "journal" in said
    assert "cannot be written: Is a directory" in said
    assert bench.bytes_came == b""
    end(bench)


@pytest.mark.large
def test_a_second_command_on_the_same_port_is_refused(nc: Path, tmp_path: Path) -> None:
    bench = Bench()
    process = bench.until_burning(bench.cut(nc))
    other = tmp_path / "other.nc"
    other.write_text(JOB.text)
    second = bench.cut(other)
    count = len(bench.bytes_came)
    said = words(bench.finish(second))
    assert second.returncode == 3
    assert said.startswith(f"The port {bench.wire.address} is in use by another program, process ")
    assert len(bench.bytes_came) > count
    assert b"\x18" not in bench.bytes_came
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    bench.finish(process)
    assert process.returncode == 130
    bench.assert_dark()
    end(bench)


@pytest.mark.large
def test_nothing_is_left_running(nc: Path) -> None:
    bench = Bench(speed=20)
    process = bench.cut(nc, "--json")
    seen: set[int] = set()

    def ended() -> bool:
        if process.poll() is None:
            seen.update(children(process))
        return process.poll() is not None

    with process:
        bench.run(ended, 60)
        assert '"status": "done"' in process.stdout.read()
    assert len(seen) == 1
    assert not any(Path(f"/proc/{pid}").exists() for pid in seen)
    end(bench)


def test_an_odd_file_is_cut_like_a_plain_one(nc: Path) -> None:
    lines = JOB.text.splitlines()
    for index in range(6, len(lines), 80):
        lines.insert(index, "G10 L2 P2 X1 Y1")  # stored while other lines are on their way
    for index, line in enumerate(lines):
        bare = line.replace(" ", "")
        if line.startswith("G1 X") and "." not in bare and index % 3 == 0:
            lines[index] = line.replace(" S", "." + "0" * (78 - len(bare)) + " S")
    assert 79 in {len(line.replace(" ", "")) for line in lines}
    nc.write_text("".join(f"{line} ; careful! schön? ~\r\n" for line in lines), newline="")
    bench = Bench(speed=4)
    process = bench.cut(nc, "--at", "0,0", "--quiet")
    assert "miurafab:" not in bench.finish(process, 60)
    assert process.returncode == 0
    assert bench.device.lost_bytes == 0
    counts = burnt(JOB, [bench.device.beam_log])
    assert all(counts[index] + counts[1000 + index] == 1 for index in range(STROKES))


@pytest.mark.parametrize("length", [80, 100, 200])
def test_a_line_too_long_is_refused_and_nothing_sent(length: int, nc: Path) -> None:
    nc.write_text(JOB.text + "G1 X5." + "0" * (length - 5) + "\n")
    bench = Bench()
    process = bench.cut(nc, "--at", "0,0", "--quiet")
    assert f"{length} " in words(bench.finish(process, 60))
    assert process.returncode == 2
    assert not bench.device.beam_log
    assert bench.device.state == "Idle"
