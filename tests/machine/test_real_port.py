"""The sender as a process of its own, over a real pseudo-terminal, ended in every way.

Here the process that holds the port is ended; test_job_process has the two that watch each other.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import serial
import serial.rfc2217
from benches import ALONE, Bench

from miurafab.errors import PortError
from miurafab.machine.actions import machine_info
from miurafab.machine.virtual_server import PtyWire

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.wire.close()


def reset_after(bench: Bench, process: subprocess.Popen[str], number: int) -> tuple[float, float]:
    """Send the signal; the real seconds until 0x18 had come, and the virtual time of it."""
    sent = time.monotonic()
    process.send_signal(number)
    bench.run(lambda: b"\x18" in bench.bytes_came)
    at, virtual, _ = bench.came[-1]
    return at - sent, virtual


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_puts_a_reset_on_the_wire_at_once(name: str) -> None:
    """Within 20 ms; the best of three, since the bench shares its processor with others."""
    delays = []
    for _ in range(3):
        bench = Bench()
        with bench.sender() as process:
            delay, at = reset_after(bench, process, getattr(signal, name))
            bench.run(lambda p=process: p.poll() is not None)
            said = process.stdout.read()
        assert process.returncode == 130
        assert "long.nc was stopped by" in said
        assert said.strip().endswith("the controller was reset and reports the beam off.")
        assert bench.bytes_came.replace(b"?", b"").endswith(b"\x18")
        assert not bench.device.beam_on
        assert all(segment.t1 <= at + 0.01 for segment in bench.device.beam_log)
        bench.wire.close()
        delays.append(delay)
        if delay <= 0.02:
            return
    pytest.fail(f"0x18 came after {', '.join(f'{1000 * d:.0f}' for d in delays)} ms")


def test_a_killed_sender_leaves_no_beam_standing(bench: Bench) -> None:
    """Nobody can send a reset then; M4 goes dark when the motion that was sent has ended."""
    with bench.sender() as process:
        process.kill()
        bench.run(lambda: process.poll() is not None)
    killed = bench.device.now
    bench.device.advance(30.0)
    assert not bench.device.beam_on
    assert b"\x18" not in bench.bytes_came
    assert not any(segment.standing for segment in bench.device.beam_log)
    assert bench.device.beam_log[-1].t1 < killed + 15
    # The port can be opened again, and the controller is found at rest.
    code = "import sys; from miurafab.machine.actions import machine_info as m;"
    again = subprocess.Popen(
        [sys.executable, "-c", code + "print(m(sys.argv[1]).state)", bench.wire.address],
        stdout=subprocess.PIPE,
        text=True,
    )
    with again:
        bench._start = time.monotonic() - bench.device.now
        bench.run(lambda: again.poll() is not None)
        assert again.stdout.read() == "Idle\n"


def test_a_port_in_use_is_refused_and_the_job_goes_on(bench: Bench) -> None:
    with bench.sender() as process:
        code = "import sys; from miurafab.machine.actions import machine_info as m; m(sys.argv[1])"
        second = subprocess.run(
            [sys.executable, "-c", code, bench.wire.address], capture_output=True, text=True
        )
        assert f"is in use by another program, process {process.pid} (" in second.stderr
        count = bench.bytes_came.count(b"\n")
        bench.run(lambda: bench.bytes_came.count(b"\n") > count + 5)
        assert process.poll() is None
        reset_after(bench, process, signal.SIGINT)
        bench.run(lambda: process.poll() is not None)


def test_an_unplugged_port_is_told(bench: Bench) -> None:
    with bench.sender() as process:
        bench.wire.close()
        said = process.communicate(timeout=20)[0]
    assert process.returncode == 3
    assert "went away" in said
    assert "switch the laser off at the machine" in said
    bench.wire = PtyWire()  # for the fixture to close


@pytest.mark.parametrize("how", ["pty", "tcp"])
def test_the_virtual_controller_serves_sender_after_sender(how: str, tmp_path: Path) -> None:
    log = tmp_path / "beam.csv"
    where = ["--pty"] if how == "pty" else ["--tcp", "127.0.0.1:0"]
    options = ["--settings", "grbl-laser-400", "--speed", "10", "--beam-log", str(log)]
    server = subprocess.Popen(
        [sys.executable, "-m", "miurafab", "virtual", *where, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with server, contextlib.ExitStack() as at_end:
        at_end.callback(server.kill)
        address = server.stdout.readline().strip()
        for _ in range(3):
            assert machine_info(address).state == "Idle"
        job = "M4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\n"
        done = subprocess.run(
            [sys.executable, "-c", ALONE, address, job], capture_output=True, text=True
        )
        assert (done.returncode, done.stdout) == (0, "")
        server.send_signal(signal.SIGINT)
        _, remarks = server.communicate(timeout=20)
    assert server.returncode == 0
    assert "0 bytes lost" in remarks
    header, *rows = log.read_text().splitlines()
    assert header == "t0,t1,x0,y0,x1,y1,power"
    ways = [[float(value) for value in row.split(",")] for row in rows]
    assert sum(way[4] - way[2] for way in ways) == pytest.approx(10, abs=0.05)


@pytest.mark.parametrize("where", [["--pty"], ["--tcp", "127.0.0.1:0"]], ids=["pty", "tcp"])
def test_a_served_controller_is_unplugged_and_plugged_in_again(where: list[str]) -> None:
    command = [sys.executable, "-m", "miurafab", "virtual", *where, "--quiet"]
    faults = ["--fault", "disconnect=300ms@2", "--settings", "fluidnc-laser-600"]
    with subprocess.Popen([*command, *faults], stdout=subprocess.PIPE, text=True) as server:
        try:
            address = server.stdout.readline().strip()
            with pytest.raises(PortError, match="went away"):
                machine_info(address)
            time.sleep(0.5)
            ready, _, _ = select.select([server.stdout], [], [], 0.1)
            if ready:  # it came back under another name
                address = server.stdout.readline().strip()
            assert machine_info(address).build == "3.7 FluidNC v3.7.8"
        finally:
            server.terminate()


@pytest.mark.filterwarnings("ignore:set\\w+:DeprecationWarning")  # pyserial's own
def test_a_port_behind_an_rfc_2217_server_is_spoken_to() -> None:
    """A serial server as pyserial builds it, before the virtual controller on TCP."""
    command = [sys.executable, "-m", "miurafab", "virtual", "--tcp", "127.0.0.1:0", "--quiet"]
    with contextlib.ExitStack() as at_end:
        server = at_end.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        at_end.callback(server.terminate)
        line = serial.serial_for_url(server.stdout.readline().strip(), timeout=0.01)
        at_end.callback(line.close)
        listener = at_end.enter_context(socket.create_server(("127.0.0.1", 0)))
        thread = threading.Thread(target=_rfc_2217, args=(listener, line), daemon=True)
        thread.start()
        info = machine_info(f"rfc2217://127.0.0.1:{listener.getsockname()[1]}")
        thread.join(5)
    assert (info.version, info.state) == ("1.1h", "Idle")


def _rfc_2217(listener: socket.socket, line: serial.SerialBase) -> None:
    class Reply:
        def write(self, data: bytes) -> None:
            client.sendall(data)

    client, _ = listener.accept()
    manager = serial.rfc2217.PortManager(line, Reply())
    with client:
        while True:
            readable, _, _ = select.select([client], [], [], 0.002)
            if readable:
                data = client.recv(1024)
                if not data:
                    return
                line.write(b"".join(manager.filter(data)))
            if line.in_waiting:
                client.sendall(b"".join(manager.escape(line.read(1))))
