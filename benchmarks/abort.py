"""From a click on Abort to 0x18 on the wire, in the studio, while a job burns.

    python benchmarks/abort.py [--runs 50] [--http] [--live]

The virtual controller is on a pseudo-terminal and notes when each byte came. In a headless
Chromium the page shows the job and is busy: it computes for 40 of every 50 ms. A run is a mouse
click on the button, from the moment in which it is handed to the browser. With ``--http`` a run is
the request alone, while two other pages ask for the state fifty times a second. With ``--live`` a
third page drags a slider all the time, so that one coarse fit follows the other.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "machine"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studio"))

from browser import Browser
from rigs import MACHINE, ROWS, Pumped, until
from test_studio_server import Page

from miurafab.studio.core import Studio
from miurafab.studio.desk import Desk
from miurafab.studio.guard import Guard
from miurafab.studio.server import _Server
from miurafab.studio.session import Bench

BUSY = (
    "setInterval(() => { const end = performance.now() + 40; while (performance.now() < end); }, "
    "50)"
)
BUTTON = (
    "(() => { const box = document.getElementById('abort').getBoundingClientRect();"
    "return [box.x + box.width / 2, box.y + box.height / 2]; })()"
)


class Noting(Desk):
    """A desk that calls ``note`` when it is asked to abort."""

    def __init__(self, note: Callable[[], None]) -> None:
        super().__init__()
        self._note = note

    def abort(self) -> None:
        """As the base."""
        self._note()
        super().abort()


class Rig:
    """A studio that is served, at a machine with a job; ``with Rig(folder) as rig``."""

    def __init__(self, folder: Path) -> None:
        self._at_end = contextlib.ExitStack()
        self.bench = self._at_end.enter_context(Pumped(limit=3600.0))
        job = folder / "rows.nc"
        job.write_text(ROWS)
        server = _Server(0, lambda: None)
        self.guard = Guard(server.server_port, "k" * 32)
        self.asked_at = 0.0
        self.answers = 0
        desk = Noting(lambda: setattr(self, "asked_at", time.monotonic()))
        server.studio = Studio(Bench(folder, None), self.guard, desk=desk, own_job=job)
        serving = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
        serving.start()
        self._at_end.callback(server.server_close)
        self._at_end.callback(server.shutdown)
        self._at_end.callback(server.studio.live.stop)
        self._at_end.callback(server.studio.desk.leave)
        self.page = Page(self.guard.address)
        port = self.bench.wire.address
        self.control = self.ask("connect", port=port, machine=MACHINE)["control"]
        until(lambda: self.idle("Idle"))
        self.ask("job")

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self._at_end.close()

    def ask(self, route: str, **order: object) -> dict[str, object]:
        """A request of the page that controls."""
        control = getattr(self, "control", "")
        return self.page.post(f"machine/{route}", {"control": control, **order})

    def idle(self, state: str) -> bool:
        """Whether the machine is in ``state`` and nothing is under way."""
        seen = json.loads(self.page.get("machine"))
        return seen.get("state") == state and not seen["busy"]

    def is_fresh(self) -> bool:
        """Whether new material lies there, and nothing is under way."""
        seen = json.loads(self.page.get("machine"))
        return not seen["loaded"] and not seen["busy"]

    def run(self, abort: Callable[[], float]) -> tuple[float, float]:
        """The seconds from ``abort``, which says when it began, to the byte, and of these the
        seconds behind the studio's server; a job burns.
        """
        if self.idle("Alarm"):
            self.ask("do", action="unlock")
            until(lambda: self.idle("Idle"))
        self.ask("do", action="fresh")
        until(self.is_fresh)
        self.ask("start", code=self.ask("arm")["armed"]["code"])
        until(lambda: self.bench.device.beam_on)
        time.sleep(0.3)
        before = len(self.bench.came)
        begun = abort()
        came = until(lambda: [at for at, _, data in self.bench.came[before:] if b"\x18" in data])
        until(lambda: self.idle("Alarm") or self.idle("Idle"))
        return came[0] - begun, came[0] - self.asked_at

    def by_http(self) -> float:
        """Abort by the request alone."""
        begun = time.monotonic()
        self.ask("abort")
        return begun

    @contextlib.contextmanager
    def asked(self) -> Iterator[None]:
        """Two pages that ask for the state fifty times a second."""
        over = threading.Event()

        def follow() -> None:
            page = Page(self.guard.address)
            while not over.wait(0.02):
                page.get("machine")

        threads = [threading.Thread(target=follow) for _ in range(2)]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            over.set()
            for thread in threads:
                thread.join()

    @contextlib.contextmanager
    def dragged(self) -> Iterator[None]:
        """A page that asks for one coarse fit after the other."""
        over = threading.Event()
        layout = {"machine": MACHINE, "material": "card-250", "options": {}}

        def drag() -> None:
            page, size = Page(self.guard.address), 100
            while not over.is_set():
                options = {"facets": "20x20", "size": f"{size}mm"}
                form = {"target": {"surface": "hypar"}, "options": options, "layout": layout}
                said = page.post("live", form)
                while "wait" in said["said"] and not over.is_set():
                    said = json.loads(page.get(f"live/{said['number']}"))
                self.answers += 1
                size = 100 + (size - 99) % 200

        thread = threading.Thread(target=drag)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


def in_browser(rig: Rig, folder: Path, runs: int) -> list[tuple[float, float]]:
    """Clicks on the button of a busy page."""
    with Browser(folder / "profile") as page:
        page.open(rig.guard.address)
        page.run("document.getElementById('desk-tab').click()")
        until(lambda: not page.run("document.getElementById('watch').hidden"))
        page.run(BUSY)
        x, y = page.run(BUTTON)
        mouse = {"x": x, "y": y, "button": "left", "clickCount": 1}

        def click() -> float:
            begun = time.monotonic()
            for kind in ("mousePressed", "mouseReleased"):
                page.call("Input.dispatchMouseEvent", type=kind, **mouse)
            return begun

        return [rig.run(click) for _ in range(runs)]


def over_http(rig: Rig, runs: int) -> list[tuple[float, float]]:
    """Requests alone."""
    with rig.asked():
        return [rig.run(rig.by_http) for _ in range(runs)]


def main() -> None:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--http", action="store_true", help="the request alone, without a browser")
    parser.add_argument("--live", action="store_true", help="while a slider is dragged")
    options = parser.parse_args()
    with contextlib.ExitStack() as stack:
        name = stack.enter_context(tempfile.TemporaryDirectory())
        rig = stack.enter_context(Rig(Path(name)))
        if options.live:
            stack.enter_context(rig.dragged())
        found = (
            over_http(rig, options.runs)
            if options.http
            else in_browser(rig, Path(name), options.runs)
        )
    if options.live:
        print(f"{rig.answers} coarse fits were answered meanwhile")
    for what, at in (("click to 0x18", 0), ("of that from the server on", 1)):
        taken = sorted(1000 * each[at] for each in found)
        print(
            f"{len(taken)} runs, {what}: median {statistics.median(taken):.0f} ms, "
            f"90 % {taken[int(0.9 * (len(taken) - 1))]:.0f} ms, worst {taken[-1]:.0f} ms"
        )


if __name__ == "__main__":
    main()
