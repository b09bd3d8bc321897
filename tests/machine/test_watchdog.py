"""A sender in a process of its own ends with the beam off when the program above it is gone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from test_real_port import LONG, SENDER, Bench

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")

CHILD = SENDER.replace(
    "    stream_job(", "    with watched_by_parent(1.0):\n        stream_job("
).replace(
    "import sys\n", "import sys\nfrom miurafab.machine.watchdog import watched_by_parent\n", 1
)
PARENT = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", *sys.argv[1:]], stdin=subprocess.PIPE)
print(child.pid, flush=True)
while True:
    child.stdin.write(b".")
    child.stdin.flush()
    time.sleep(0.1)
"""


@pytest.mark.parametrize("how", ["killed", "frozen"])
def test_the_user_interface_dies_and_the_beam_goes_off(how: str) -> None:
    bench = Bench()
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, CHILD, bench.wire.address, LONG], stdout=subprocess.PIPE
    )
    try:
        bench.run(lambda: bench.bytes_came.count(b"\n") > 30 and bench.device.beam_on, 40)
        assert b"\x18" not in bench.bytes_came
        gone = time.monotonic()
        parent.send_signal(signal.SIGKILL if how == "killed" else signal.SIGSTOP)
        bench.run(lambda: b"\x18" in bench.bytes_came)
        assert time.monotonic() - gone < 5
        bench.run(lambda: not bench.device.beam_on)
        at = bench.device.now
        until = at + 1.0
        bench.run(lambda: bench.device.now > until)
        assert all(segment.t0 <= at for segment in bench.device.beam_log)
        assert not any(segment.standing for segment in bench.device.beam_log)
    finally:
        parent.kill()
        parent.wait()
        assert parent.stdout is not None
        parent.stdout.close()
        bench.wire.close()
