"""The picture of the studio's tab Machine in docs/studio.md: a sheet in the middle of its cut.

    python benchmarks/studio_picture.py [docs/studio/machine.png]

A hypar is laid out and cut on the practice machine, in a headless Chromium.
"""

from __future__ import annotations

import base64
import contextlib
import os
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "machine"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studio"))

from browser import Browser
from rigs import until

import miurafab
from miurafab.files import write_bytes
from miurafab.studio.core import Studio
from miurafab.studio.desk import Desk
from miurafab.studio.guard import Guard
from miurafab.studio.server import _Server
from miurafab.studio.session import Bench

WIDTH, HEIGHT = 1280, 940


def picture(page: Browser, path: Path) -> None:
    """Write what ``page`` shows, in the light theme."""
    page.call(
        "Emulation.setDeviceMetricsOverride",
        width=WIDTH,
        height=HEIGHT,
        deviceScaleFactor=1,
        mobile=False,
    )
    light = [{"name": "prefers-color-scheme", "value": "light"}]
    page.call("Emulation.setEmulatedMedia", features=light)
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    shot = page.call("Page.captureScreenshot", format="png")["data"]
    write_bytes(path, base64.b64decode(shot))


def cut(page: Browser, folder: Path) -> None:
    """Cut the hypar for a third of its time."""
    job = folder / "hypar-job"
    miurafab.sheets(miurafab.fit("hypar", facets="12x12", size="220mm")).write(job)
    server = _Server(0, lambda: None)
    guard, desk = Guard(server.server_port, "k" * 32), Desk(speed=12.0)
    server.studio = Studio(Bench(folder, None), guard, desk=desk, own_job=job)
    threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
    page.open(guard.address)
    seen = "document.documentElement.dataset.ready === 'yes'"
    named = "document.getElementById('{}').{}".format
    for wait, press in (
        (seen, "connect"),
        (f"{named('state-title', 'textContent')} === 'Ready'", "put-on"),
        (f"{named('job-name', 'textContent')} && !{named('arm', 'disabled')}", "arm"),
        (f"!{named('armed', 'hidden')}", "start"),
    ):
        until(lambda wait=wait: page.run(wait), 60)
        page.run(named(press, "click()"))
    until(lambda: page.run(f"{named('strokes-bar', 'value')} > 0.3"), 240)


def main() -> None:
    """Make the picture."""
    path = Path(sys.argv[1] if sys.argv[1:] else "docs/studio/machine.png")
    with contextlib.ExitStack() as at_end:
        folder = Path(at_end.enter_context(tempfile.TemporaryDirectory()))
        os.environ["XDG_STATE_HOME"] = str(folder / "state")
        page = at_end.enter_context(Browser(folder / "profile"))
        begun = time.monotonic()
        cut(page, folder)
        path.parent.mkdir(parents=True, exist_ok=True)
        picture(page, path)
        print(f"{path}: {path.stat().st_size // 1024} kB, {time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    main()
