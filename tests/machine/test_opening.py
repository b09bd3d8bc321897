"""What the opening of a port does to a board, with real processes and pseudo-terminals.

The virtual controller behind them models the line DTR: see
:mod:`miurafab.machine.virtual_server`.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from miurafab.errors import ControllerError
from miurafab.gcode.job import Job
from miurafab.machine import transport
from miurafab.machine.actions import home, machine_info, read_settings, talk, unlock
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.sender import stream_plan
from miurafab.machine.transport import SerialTransport
from miurafab.machine.virtual_server import PtyWire
from miurafab.profiles import load_machine

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")

JOB = "G21\nG90\nM4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\n"


def miurafab(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "miurafab", *words], capture_output=True, text=True, timeout=60
    )


@contextlib.contextmanager
def served(*options: str) -> Iterator[str]:
    """The address of a virtual controller."""
    command = [sys.executable, "-m", "miurafab", "virtual", "--pty", "--quiet", "--speed", "20"]
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True) as server:
        try:
            yield server.stdout.readline().strip()
        finally:
            server.terminate()
            server.wait(20)


@pytest.fixture
def homing(tmp_path: Path) -> list[str]:
    """A board with homing: locked after each reset."""
    dump = tmp_path / "board.txt"
    lines = read_settings("virtual").dump().replace("$22=0", "$22=1").replace("$32=0", "$32=1")
    dump.write_text(lines.replace("$24=25.000", "$24=500").replace("$25=500.000", "$25=3000"))
    (tmp_path / "job.nc").write_text(JOB)
    return ["--settings", str(dump)]


def cut(port: str) -> int:
    """The lines sent of a job that is cut in this process."""
    force = frozenset({"settings", "travel"})
    plan = plan_job(Job("job.nc", JOB), load_machine("grbl-laser-400"), SendOptions(force=force))
    return stream_plan(plan, port).lines


def test_unlock_home_and_cut_are_three_commands(homing: list[str], tmp_path: Path) -> None:
    """On a board that an edge of DTR resets: only the first opening makes one."""
    with served(*homing) as port:
        first = miurafab("machine", "unlock", "--port", port)
        assert re.search(r"state +Idle", first.stdout)
        assert "The opening of" in first.stderr
        assert "an unlocking, an origin set with G92" in " ".join(first.stderr.split())
        told: list[int] = []
        assert home(port, on_restart=lambda: told.append(1)).state == "Idle"
        assert told == []
        options = ["--machine", "grbl-laser-400", "--port", port, "--force", "settings,travel"]
        done = miurafab("cut", str(tmp_path / "job.nc"), *options)
        assert done.returncode == 0, done.stderr
        assert "restarted" not in done.stderr


def test_a_board_that_each_opening_resets_is_told_of(homing: list[str]) -> None:
    told: list[str] = []
    with served(*homing, "--reset-on-open", "always") as port:
        for count in (1, 2):
            assert unlock(port, on_restart=lambda: told.append("restarted")).state == "Idle"
            assert len(told) == count
            time.sleep(0.3)  # until the server has seen that the port was closed
        with pytest.raises(ControllerError, match=r"restarted the board, which is locked.*'home'"):
            cut(port)


def test_a_board_that_never_greets_is_known_by_its_answers() -> None:
    with served("--settings", "grbl-laser-400", "--silent-greeting") as port:
        info = machine_info(port)
        assert (info.firmware, info.version, info.state) == ("Grbl", "1.1h", "Idle")
        assert cut(port) == 6


@pytest.mark.parametrize("blocks", [("G20G55", "G91"), ("M8", "G20")])
def test_startup_blocks_change_nothing_that_is_burnt(
    blocks: tuple[str, str], tmp_path: Path
) -> None:
    """Typed at a console, kept by the board, run at the reset of the next command."""
    log = tmp_path / "beam.csv"
    with served("--settings", "grbl-laser-400", "--beam-log", str(log)) as port:
        typed = ("G10L2P2X100Y100", *(f"$N{n}={block}" for n, block in enumerate(blocks)))
        talk(port, typed, lambda line: None)
        job = Job("job.nc", JOB.replace("G21\nG90\n", ""))
        plan = plan_job(job, load_machine("grbl-laser-400"), SendOptions(reset=True))
        (finding,) = stream_plan(plan, port).findings
    assert finding.code == "modes"
    named = [f"$N{n}={block}" for n, block in enumerate(blocks) if block]
    assert f"runs {' and '.join(named)} after each reset" in finding.sentence
    rows = [[float(x) for x in row.split(",")] for row in log.read_text().splitlines()[1:]]
    assert min(row[2] for row in rows) == pytest.approx(5, abs=0.1)
    assert max(row[4] for row in rows) == pytest.approx(15, abs=0.1)
    assert {row[3] for row in rows} == {0.0}


@pytest.fixture
def wire() -> Iterator[PtyWire]:
    wire = PtyWire()
    yield wire
    wire.close()


def settle(wire: PtyWire) -> bool:
    """Let the wire see what happened; whether a sender has opened it."""
    opened = [wire.wait(0.001)[1] for _ in range(5)]
    return any(opened)


def test_only_the_first_opening_makes_an_edge(wire: PtyWire) -> None:
    for edge in (True, False, False):
        line = SerialTransport(wire.address, 115_200)
        assert settle(wire)
        assert wire.edge is edge
        line.close()
        assert not settle(wire)


def test_a_program_that_leaves_hupcl_set_lowers_the_line(wire: PtyWire) -> None:
    import termios

    for _ in range(2):
        line = serial.Serial(wire.address)
        attributes = termios.tcgetattr(line.fileno())
        attributes[2] |= termios.HUPCL
        termios.tcsetattr(line.fileno(), termios.TCSANOW, attributes)
        assert settle(wire)
        assert wire.edge
        line.close()
        settle(wire)


class Windows:
    """pyserial's port on Windows, as far as the transport uses it: the lines and the time."""

    def __init__(self) -> None:
        self.dtr = self.rts = True
        self.in_waiting = 0
        self.said = b""
        self.lines_at_open: tuple[bool, bool] | None = None
        self.time = 0.0

    def open(self) -> None:
        self.lines_at_open = (self.dtr, self.rts)

    def read(self, size: int) -> bytes:
        self.time += 0.1
        said, self.said = self.said, b""
        return said


@pytest.mark.parametrize("speaks", [True, False])
def test_on_windows_the_lines_are_raised_only_for_a_board_that_is_silent(
    speaks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = Windows()
    monkeypatch.setattr(transport, "_LOWERS_LINES", True)
    monkeypatch.setattr(serial, "serial_for_url", lambda *line, **options: port)
    monkeypatch.setattr(SerialTransport, "now", lambda self: port.time)
    line = SerialTransport("COM3", 115_200)
    assert port.lines_at_open == (False, False)
    if speaks:
        port.said = b"<Idle|FS:0,0>\r\n"
        assert line.read(0.5).startswith(b"<Idle")
    line.read(2.0)
    assert (port.dtr, port.rts) == ((False, False) if speaks else (True, True))


def test_on_windows_a_cutter_has_its_lines_from_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its flow control may need them."""
    port = Windows()
    monkeypatch.setattr(transport, "_LOWERS_LINES", True)
    monkeypatch.setattr(serial, "serial_for_url", lambda *line, **options: port)
    SerialTransport("COM3", 9600, "rts-cts")
    assert port.lines_at_open == (True, True)
