"""A practice machine on a real pseudo-terminal, and the commands that are tried on it.

The wire is recorded between the pty and the virtual controller, byte by byte, with the time. Only
tests that use this take real seconds.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from miurafab.machine.virtual_server import PtyWire
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = "grbl-laser-400"
LONG = "M4 S0\n" + "".join(f"G0 X5 Y{n % 300}\nG1 X15 S500 F2000\n" for n in range(400)) + "M5\n"

SENDER = """
import sys
from pathlib import Path
from miurafab.errors import MiurafabError
from miurafab.gcode.job import Job
from miurafab.machine.{module} import {function}
from miurafab.machine.planning import plan_job
from miurafab.profiles import load_machine
try:
    plan = plan_job(Job("long.nc", sys.argv[2]), load_machine("grbl-laser-400"))
    journal = Path(sys.argv[3]) if sys.argv[3:] else None
    {function}(plan, sys.argv[1], journal_path=journal)
except MiurafabError as error:
    print(error)
    sys.exit(error.exit_code)
"""
ALONE = SENDER.format(module="sender", function="stream_plan")
APART = SENDER.format(module="job_process", function="stream_apart")


class Bench:
    """A virtual controller on a pty, and a record of what came down to it.

    ``speed`` is virtual seconds a real second.
    """

    def __init__(self, *faults: str, speed: float = 1.0) -> None:
        self._speed = speed
        self.device = VirtualGrbl(
            virtual_settings(load_machine(MACHINE)), baud=115_200, faults=parse_faults(faults)
        )
        self.wire = PtyWire()
        self.came: list[tuple[float, float, bytes]] = []  # real time, virtual time, bytes
        self._plugged = True
        self._start = time.monotonic()

    @property
    def bytes_came(self) -> bytes:
        return b"".join(data for _, _, data in self.came)

    @property
    def commands(self) -> bytes:
        """All that came, without the status queries."""
        return self.bytes_came.replace(b"?", b"")

    def run(self, until: Callable[[], bool], limit: float = 20.0) -> None:
        end = time.monotonic() + limit
        while not until():
            assert time.monotonic() < end, "the bench waited too long"
            data, opened = self.wire.wait(0.002)
            now = (time.monotonic() - self._start) * self._speed
            self.device.advance(max(0.0, now - self.device.now))
            if opened:
                self.device.power_cycle()
            if data:
                self.came.append((time.monotonic(), self.device.now, data))
                self.device.receive(data)
            self.wire.write(self.device.take_output())
            if self._plugged != self.device.connected:
                self._plugged = self.device.connected
                (self.wire.plug if self._plugged else self.wire.unplug)()

    def start(self, code: str, *arguments: str) -> subprocess.Popen[str]:
        """Python ``code`` with the port as its first argument, without waiting for it."""
        command = [sys.executable, "-c", code, self.wire.address, *arguments]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def sender(self, code: str = ALONE, *arguments: str) -> subprocess.Popen[str]:
        """A sender in mid-job, with the beam on."""
        return self.until_burning(self.start(code, LONG, *arguments))

    def cut(self, job: Path, *options: str, **more: object) -> subprocess.Popen[str]:
        """``miurafab cut`` of ``job``, without waiting for it."""
        command = [sys.executable, "-m", "miurafab", "cut", str(job), "--machine", MACHINE]
        return subprocess.Popen(
            [*command, "--port", self.wire.address, *options],
            **({"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True} | more),
        )

    def until_burning(self, process: subprocess.Popen[str]) -> subprocess.Popen[str]:
        """Wait until ``process`` is in mid-job, with the beam on."""
        try:
            self.run(lambda: self.bytes_came.count(b"\n") > 30 and self.device.beam_on, 40)
        except BaseException:
            process.kill()
            process.wait()
            raise
        return process

    def finish(self, process: subprocess.Popen[str], limit: float = 30.0) -> str:
        """Let ``process`` come to its end; what it said."""
        with process:
            self.run(lambda: process.poll() is not None, limit)
            return process.stdout.read()

    def assert_dark(self) -> None:
        """The beam is off, stays off when all that is held has run, and never stood still."""
        self.device.advance(60.0)
        assert not self.device.beam_on
        assert standing_seconds(self.device.beam_log) == 0.0

    def assert_dark_from(self, virtual: float) -> None:
        """As :meth:`assert_dark`, and nothing burnt after ``virtual`` on the controller's clock."""
        self.assert_dark()
        assert all(segment.t1 <= virtual + 0.01 for segment in self.device.beam_log)


class Terminal:
    """A terminal for one command: what is typed there, and what it shows."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        os.set_blocking(self._master, False)
        self._shown = b""

    def options(self) -> dict[str, object]:
        """For ``Popen``: the command is the terminal's session, as a shell starts it."""
        import fcntl
        import termios

        return {
            "stdin": self._slave,
            "stdout": self._slave,
            "stderr": self._slave,
            "start_new_session": True,
            "preexec_fn": lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            "env": os.environ | {"TERM": "xterm", "COLUMNS": "120"},
        }

    def type(self, data: bytes) -> float:
        """Press keys; when."""
        at = time.monotonic()
        os.write(self._master, data)
        return at

    @property
    def shown(self) -> str:
        """All that the command has shown up to now."""
        with contextlib.suppress(OSError):
            while data := os.read(self._master, 65_536):
                self._shown += data
        return self._shown.decode("utf-8", "replace")

    def close(self) -> None:
        """Close the window."""
        for descriptor in (self._slave, self._master):
            with contextlib.suppress(OSError):
                os.close(descriptor)


def children(process: subprocess.Popen[str]) -> list[int]:
    """The processes that ``process`` has started (Linux)."""
    task = Path(f"/proc/{process.pid}/task")
    pids: list[str] = []
    for thread in task.iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # it ended meanwhile
            pids += (thread / "children").read_text().split()
    return [int(pid) for pid in pids]
