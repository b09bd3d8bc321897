"""Time the sender over a real pseudo-terminal against ``miurafab virtual``, beside other senders.

    python benchmarks/stream.py [--speed 1] [--seconds 8] [--lines 1000000] [--rivals PYTHON]

The controller paces its wire at 115200 baud. *wire*: bytes of the job a second in check mode, where
nothing moves, as a fraction of the 11520 that the wire carries. *micro*: 1500 dashes of 0.3 mm with
0.2 mm gaps at F6000, behind a relay that hands the controller's answers on every 1 or 16 ms, as USB
bridges do; the time between the first and the last beam by the controller's own beam log, against
that of an ideal sender in the controller's own clock on that link. *memory*: what streaming a long
job in check mode adds to the sender's memory, after the job was read and checked.

On a busy computer let the controller's time pass more slowly than real time (``--speed 0.25``): all
figures are in its time, and the latency is stretched with it.

``--rivals`` is a Python in which ``pip install grbl-streamer pygrbl-streamer`` was done: both send
the micro job too. A sender that burns fewer dashes than the job has lost lines on the way.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import serial

from miurafab.gcode.job import Job
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.sender import stream_plan
from miurafab.machine.virtual_server import PtyWire
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = "grbl-laser-400"
DASHES = 1500
WIRE_BYTES_S = 11_520

STREAMER = """
import os, sys, time
from grbl_streamer import GrblStreamer
done, booted = [], []
def tell(event, *data):
    if event == "on_job_completed": done.append(1)
    if event == "on_boot": booted.append(1)
g = GrblStreamer(tell)
g.setup_logging()
g.cnect(sys.argv[1], 115200)
while not booted: time.sleep(0.01)
time.sleep(1)
done.clear()  # it says so of nothing, too
g.incremental_streaming = False
g.load_file(sys.argv[2])
g.job_run()
end = time.time() + 300
while not done and time.time() < end: time.sleep(0.05)
time.sleep(1)
os._exit(0)  # its threads end for nothing else
"""
PYGRBL = """
import sys
from pygrbl_streamer import GrblStreamer
g = GrblStreamer(sys.argv[1], 115200)
g.connect()
g.send_file(sys.argv[2])
g.disconnect()
"""
OURS = """
import sys
from pathlib import Path
from miurafab.gcode.job import Job
from miurafab.machine.planning import plan_job
from miurafab.machine.sender import stream_plan
from miurafab.profiles import load_machine
job = Job("micro.nc", Path(sys.argv[2]).read_text())
stream_plan(plan_job(job, load_machine("grbl-laser-400")), sys.argv[1])
"""


def micro_job() -> Job:
    """Rows of dashes 0.3 mm long, 0.2 mm apart."""
    lines = ["G21", "G90", "M4S0", "F6000"]
    for n in range(DASHES):
        x, y = 10 + 0.5 * (n % 300), 10 + 2 * (n // 300)
        lines += [f"G0X{x:g}Y{y}", f"G1X{x + 0.3:g}S500"]
    return Job("micro.nc", "\n".join([*lines, "M5", "G0X0Y0", ""]))


@contextlib.contextmanager
def controller(beam_log: Path | None = None, speed: float = 1.0) -> Iterator[str]:
    """``miurafab virtual`` on a pty; its address."""
    command = [sys.executable, "-m", "miurafab", "virtual", "--pty", "--settings", MACHINE]
    command += ["--speed", f"{speed:g}", "--quiet"]
    command += ["--beam-log", str(beam_log)] if beam_log else []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def relay(address: str, latency: float) -> None:
    """Hand bytes on to ``address`` at once, and back every ``latency`` seconds; forever."""
    here = PtyWire()
    print(here.address, flush=True)
    while not here.wait(0.01)[1]:
        pass
    there = serial.Serial(address, 115_200, timeout=0)
    due, held = time.monotonic(), b""
    while True:
        left = max(0.0, due - time.monotonic())
        select.select([here._master, there.fileno()] if not held else [here._master], [], [], left)
        data, _ = here.wait(0.0)
        if data:
            there.write(data)
        held += there.read(4096)
        if time.monotonic() >= due:
            due = time.monotonic() + latency
            if held:
                here.write(held)
                held = b""


@contextlib.contextmanager
def relayed(address: str, latency: float) -> Iterator[str]:
    command = [sys.executable, __file__, "--relay", address, str(latency)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


def micro(python: str, sender: str, latency: float, speed: float) -> tuple[float, int]:
    """Seconds from the first beam to the last, and the dashes burnt."""
    with tempfile.TemporaryDirectory() as folder:
        file, log = Path(folder) / "micro.nc", Path(folder) / "beam.csv"
        file.write_text(micro_job().text)
        with controller(log, speed) as address, relayed(address, latency / speed) as port:
            # Whatever a rival prints on its way is no part of the benchmark.
            subprocess.run(
                [python, "-c", sender, port, str(file)],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=400,
                check=False,
                start_new_session=True,
            )
        burnt = np.loadtxt(log, delimiter=",", skiprows=1, ndmin=2)
    if not len(burnt):
        return float("nan"), 0
    cells = np.stack([np.floor((burnt[:, [2, 4]].mean(axis=1) - 9.9) / 0.5), burnt[:, 3]], axis=1)
    return float(burnt[-1, 1] - burnt[0, 0]), len(np.unique(cells.round().astype(int), axis=0))


def ideal(latency: float) -> float:
    """The same time of an ideal sender: the receive buffer always full, not one query.

    It sits in the controller's own clock, and sees the answers every ``latency`` seconds.
    """
    machine = load_machine(MACHINE)
    device = VirtualGrbl(virtual_settings(machine), baud=machine.controller.baud)
    device.advance(1.0)
    device.take_output()
    lines, unanswered, room = (
        deque(micro_job().send_lines()),
        deque[int](),
        machine.controller.rx_bytes,
    )
    look_at, said = device.now, b""
    while lines or unanswered:
        while lines and len(lines[0].data) < room:
            data = lines.popleft().data + b"\n"
            device.receive(data)
            unanswered.append(len(data))
            room -= len(data)
        look_at += latency
        device.advance(look_at - device.now)
        said += device.take_output()
        for _ in range(said.count(b"ok\r\n")):
            room += unanswered.popleft()
        said = said[said.rfind(b"\n") + 1 :]
    device.advance(3.0)
    return device.beam_log[-1].t1 - device.beam_log[0].t0


def check_mode(lines: int, speed: float) -> tuple[float, float]:
    """The share of the wire that is used, and the MB that streaming adds."""
    text = "G1F3000\n" + "".join(f"X{n % 300}.{n % 997:03d}Y{n % 211}.5\n" for n in range(lines))
    job = Job("wire.nc", text)
    size = sum(len(line.data) + 1 for line in job.send_lines())
    peaks: list[int] = []

    def note(progress: Progress) -> None:
        peaks.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)

    with controller(speed=speed) as address:
        plan = plan_job(job, load_machine(MACHINE), SendOptions(check_mode=True))
        result = stream_plan(plan, address, on_progress=note)
    return size / result.seconds / (WIRE_BYTES_S * speed), (peaks[-1] - peaks[0]) / 1024


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=8, help="length of the wire test")
    options.add_argument("--lines", type=int, default=0, help="length of the memory test")
    options.add_argument("--speed", type=float, default=1, help="of the controller's time")
    options.add_argument("--memory-speed", type=float, default=20)
    options.add_argument("--rivals", metavar="PYTHON")
    options.add_argument("--relay", nargs=2, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.relay:
        relay(given.relay[0], float(given.relay[1]))
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    if given.seconds:
        share, _ = check_mode(int(given.seconds * WIRE_BYTES_S / 14), given.speed)
        print(f"wire: {share:.4f} of {WIRE_BYTES_S} bytes a second in check mode")
    senders = [("miurafab", sys.executable, OURS)]
    if given.rivals:
        senders += [
            ("grbl-streamer", given.rivals, STREAMER),
            ("pygrbl-streamer", given.rivals, PYGRBL),
        ]
    for latency in (0.001, 0.016):
        best = ideal(latency)
        print(f"micro, {1000 * latency:g} ms: an ideal sender {best:.2f} s", flush=True)
        for name, python, sender in senders:
            seconds, dashes = micro(python, sender, latency, given.speed)
            share = f"{seconds:7.2f} s  {seconds / best:.3f} of ideal"
            print(f"  {name:15} {share}  {dashes} of {DASHES} dashes", flush=True)
    if given.lines:
        share, added = check_mode(given.lines, given.memory_speed)
        print(f"memory: {given.lines} lines, streaming added {added:.1f} MB ({share:.2f} of wire)")


if __name__ == "__main__":
    main()
