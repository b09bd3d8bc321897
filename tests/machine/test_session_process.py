"""A session in real processes, with a terminal and a serial port that are pseudo-terminals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from benches import LONG, MACHINE, Bench, Terminal, children

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="needs pseudo-terminals and /proc"
)
COMMAND = [sys.executable, "-m", "miurafab", "machine"]
ARROWS = b"\x1b[A\x1b[B\x1b[C\x1b[D\x1bOP\x1b[20~\x1b[1;5C"


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.wire.close()


def burning(bench: Bench, screen: Terminal, folder: Path) -> subprocess.Popen[bytes]:
    """A session in a terminal, in the midst of a job that was armed and started there."""
    job = folder / "long.nc"
    job.write_text(LONG)
    process = subprocess.Popen(
        [*COMMAND, "open", bench.wire.address, str(job), "--machine", MACHINE], **screen.options()
    )
    try:
        bench.run(lambda: "waits for a key" in screen.shown, 60)
        sent = bench.commands
        screen.type(b"s")
        bench.run(lambda: "Nothing is armed" in screen.shown, 20)
        assert bench.commands == sent
        screen.type(b"a")
        bench.run(lambda: "Armed. To burn: long.nc: 400 strokes" in screen.shown, 20)
        screen.type(b"s")
        bench.until_burning(process)
    except BaseException:
        process.kill()
        process.wait()
        raise
    return process


def ended(bench: Bench, process: subprocess.Popen[bytes]) -> int:
    """The exit code of a session that comes to its end."""
    bench.run(lambda: process.poll() is not None, 40)
    return process.wait()


def test_ctrl_c_ends_it_dark_after_a_storm_and_a_refused_second_command(
    bench: Bench, screen: Terminal, tmp_path: Path
) -> None:
    process = burning(bench, screen, tmp_path)
    second = subprocess.Popen(
        [*COMMAND, "jog", "--x", "1", "--port", bench.wire.address],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said = bench.finish(second)
    assert second.returncode == 3
    assert f"in use by another program, process {process.pid} (miurafab machine open " in said
    assert "; jog it in that session with the arrow keys, or close" in said
    count, lines = bench.bytes_came.count(b"\n"), bench.commands
    screen.type(20 * ARROWS)
    bench.run(lambda: bench.bytes_came.count(b"\n") > count + 10)
    assert not set(bench.commands[len(lines) :]) & set(range(0x80, 0x100))
    assert b"$J" not in bench.commands
    at = screen.type(b"\x03")
    bench.run(lambda: b"\x18" in bench.bytes_came)
    came, dark, _ = bench.came[-1]
    assert ended(bench, process) == 130
    bench.assert_dark_from(dark)
    # 20 ms on a machine that is not busy; the bench shares its processor with others.
    assert came - at < 0.25


def test_the_screen_is_killed(bench: Bench, screen: Terminal, tmp_path: Path) -> None:
    process = burning(bench, screen, tmp_path)
    process.kill()
    bench.run(lambda: b"\x18" in bench.bytes_came)
    dark = bench.came[-1][1]
    process.wait()
    bench.assert_dark_from(dark)


def test_leaving_in_mid_job_stops_it(bench: Bench, screen: Terminal, tmp_path: Path) -> None:
    process = burning(bench, screen, tmp_path)
    screen.type(b"x")
    bench.run(lambda: b"\x18" in bench.bytes_came)
    dark = bench.came[-1][1]
    assert ended(bench, process) == 0
    bench.assert_dark_from(dark)


def test_the_process_that_holds_the_port_is_killed(
    bench: Bench, screen: Terminal, tmp_path: Path
) -> None:
    process = burning(bench, screen, tmp_path)
    (child,) = children(process)
    os.kill(child, signal.SIGKILL)
    bench.run(lambda: b"\x18" in bench.bytes_came)
    dark = bench.came[-1][1]
    assert ended(bench, process) == 3
    assert "was killed by signal 9; the controller was reset and reports the" in screen.shown
    bench.assert_dark_from(dark)


def test_words_are_carried_out_one_after_another_and_the_end_is_dark(
    bench: Bench, tmp_path: Path
) -> None:
    job = tmp_path / "line.nc"
    job.write_text("M4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\nG0X0Y0\n")
    process = subprocess.Popen(
        [*COMMAND, "open", bench.wire.address, str(job), "--machine", MACHINE, "--json"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdin.write("jog x10 y5 f6000\norigin\nframe\nstart\ngo\nstart\n")
    process.stdin.close()
    bench.run(lambda: process.poll() is not None, 60)
    said, *failure = process.stdout.read().partition("{\n")
    answers = [json.loads(line) for line in said.splitlines()]
    process.wait()
    process.stdout.close()
    process.stderr.close()
    states = {each["line"]: each["state"] for each in answers if "line" in each}
    assert list(states) == ["jog x10 y5 f6000", "origin", "frame", "start", "go"]
    assert states["origin"]["machine_position"][:2] == [10.0, 5.0]
    assert states["start"]["loaded"] == "line.nc"
    assert process.returncode == 5
    assert "put in fresh material" in json.loads("".join(failure))["error"]
    burnt = bench.device.beam_log
    assert {round(segment.y0, 1) for segment in burnt} == {5.0}
    assert sum(s.x1 - s.x0 for s in burnt) == pytest.approx(10, abs=0.1)
    bench.assert_dark()
