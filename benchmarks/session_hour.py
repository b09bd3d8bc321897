"""Hours of one session with the virtual controller: random actions, and what must hold after each.

    python benchmarks/session_hour.py [--commands 10000] [--seed 1]

Each action (jog, arrow keys, origin, home, frame, cut, hold, abort, console line, override, reset
button, limit switch, cable out) is followed by a comparison of the session's state with the
controller's own and a look through the beam log; see tests/machine/session_walk.py. At the end the
threads, descriptors and memory are those of the beginning.
"""

from __future__ import annotations

import argparse
import resource
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "machine"))

from session_walk import Walk


def held() -> tuple[int, int, int]:
    """Threads, open descriptors, and the peak of memory in MB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    return threading.active_count(), len(list(Path("/proc/self/fd").iterdir())), peak


def main() -> None:
    """Walk, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--commands", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    walk = Walk(options.seed)
    for _ in range(options.commands // 10):
        walk.step()
    before, begin = held(), time.process_time()
    for _ in range(options.commands - options.commands // 10):
        walk.step()
    after = held()
    print(", ".join(f"{name} {count}" for name, count in sorted(walk.done.items())))
    print(
        f"{options.commands} actions in {walk.device.now / 3600:.1f} h of the controller's time, "
        f"{sum(walk.refused.values())} refused; state true and no beam at rest after each"
    )
    print(
        f"threads {before[0]} -> {after[0]}, descriptors {before[1]} -> {after[1]}, "
        f"peak memory {before[2]} -> {after[2]} MB; {time.process_time() - begin:.0f} s"
    )


if __name__ == "__main__":
    main()
