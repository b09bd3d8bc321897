"""The whole way on the page, from a mesh that is dropped to a sheet that burns, and back again.

``MIURAFAB_SHOTS=FOLDER`` writes a picture of each step, at three widths and in both themes.
"""

import base64
import json
import os
import threading
from pathlib import Path

import pytest
from axe import AXE, dress, serious_faults
from browser import CHROMIUM
from rigs import until
from studios import saddle_obj
from test_machine_page import AtDesk

from miurafab.studio.core import PARTS, Studio
from miurafab.studio.desk import Desk
from miurafab.studio.guard import Guard
from miurafab.studio.messages import HttpRequest
from miurafab.studio.server import _Server
from miurafab.studio.session import Bench
from miurafab.studio.worker import Process
from miurafab.workflow.page import page_text

WIDTHS = (1280, 768, 390)
SHOTS = os.environ.get("MIURAFAB_SHOTS")


class OnTour(AtDesk):
    """The page, looked at after each step."""

    def look(self, name):
        """No step may make the page wider than the screen, or unfit for a reader of screens."""
        if SHOTS:
            self.pictures(name)
        for width in (1280, 390):
            self.width(width)
            assert self.run("document.documentElement.scrollWidth") <= width, name
            if AXE.is_file():
                assert serious_faults(self) == [], (name, width)
        self.width(1280)

    def width(self, width, height=900):
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip

    def pictures(self, name):
        for theme in ("light", "dark"):
            dress(self, theme)
            for width in WIDTHS:
                self.width(width)
                shot = self.still()
                file = Path(SHOTS) / f"{name}-{width}-{theme}.png"
                file.write_bytes(base64.b64decode(shot))

    def still(self):
        """A picture of the page at rest. A frame is laid out and drawn after the page around it,
        and cannot be asked whether it is: so the picture has to stay the same for a while.
        """
        last, same = "", 0
        for _ in range(30):
            self.run("new Promise((done) => setTimeout(done, 400))")
            shot = self.call("Page.captureScreenshot", format="png")["data"]
            last, same = shot, same + 1 if shot == last else 0
            if same == 3:
                break
        return last

    def drop(self, name, content):
        """Drop a file onto the page, as a person drags it out of a folder."""
        text = base64.b64encode(content).decode()
        self.run(
            "{ const held = new DataTransfer(); const bytes = Uint8Array.from(atob('" + text + "'),"
            " (letter) => letter.charCodeAt(0));"
            f"held.items.add(new File([bytes], '{name}'));"
            "for (const kind of ['dragover', 'drop']) document.body.dispatchEvent(new DragEvent("
            "kind, { dataTransfer: held, bubbles: true, cancelable: true })); }"
        )

    def rest(self, bench):
        """Wait until nothing is being done, neither in the studio nor on the page."""
        until(lambda: bench.task.running is None, 90)
        self.idle()

    def shown(self, name):
        self.until(f"!document.getElementById('{name}').hidden")

    def text_until(self, name, words):
        self.until(f"document.getElementById('{name}').textContent.includes({words!r})")


@pytest.fixture
def studio(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "configuration"))
    server = _Server(0, lambda: None)
    (tmp_path / "bench").mkdir()
    bench = Bench(tmp_path / "bench", Process)
    server.studio = Studio(bench, Guard(server.server_port, "k" * 32), desk=Desk(speed=6.0))
    serving = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    serving.start()
    yield server.studio
    server.studio.desk.leave()
    server.studio.live.stop()
    server.shutdown()
    serving.join()
    server.server_close()
    bench.cancel()


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_from_a_mesh_that_is_dropped_to_a_sheet_that_burns(studio, tmp_path):
    address = studio.guard.address
    with OnTour(tmp_path / "profile") as page:
        page.width(1280)
        page.open(address)
        page.until("document.documentElement.dataset.ready === 'yes'")

        # a mesh is dropped, placed, and fitted; then its size is dragged
        page.drop("my saddle.obj", saddle_obj())
        page.until("document.getElementById('target').value.startsWith('source:')")
        page.run("document.getElementById('mesh-options').open = true")
        page.type("rotate", "20")
        page.type("facets", "6x6")
        page.shown("pattern")
        page.idle()
        assert "Rotate 20" in page.text("subject")
        assert "folds from flat paper" in page.text("headline")
        page.run(
            "{ const slider = document.querySelector('#size-row .slider'); slider.value = 90;"
            "slider.dispatchEvent(new Event('input', { bubbles: true }));"
            "slider.dispatchEvent(new Event('change', { bubbles: true })); }"
        )
        page.text_until("subject", "Size 90mm")
        page.rest(studio.bench)
        page.shown("pattern")
        page.look("shape")

        page.click("fold-tab")
        page.shown("folding")
        page.look("fold")

        page.click("shape-tab")
        page.ready("go-on")
        page.run(
            "{ const frame = document.getElementById('dry-run');"
            "frame.addEventListener('load', () => { frame.dataset.there = 'yes'; }); }"
        )
        for words in ("Facets 6x6", "Size 90mm", "Rotate 20"):
            assert words in studio.bench.pattern["subject"]
        page.ready("lay-out")
        page.rest(studio.bench)
        assert page.text("fault") == ""
        page.shown("job")
        page.until("document.getElementById('dry-run').dataset.there === 'yes'")
        laid = json.loads((studio.bench.job_folder() / "layout.json").read_text())
        fitted = json.loads(studio.bench.pattern_file().read_text())
        facets = sum(len(patch["faces"]) for patch in laid["patches"])
        assert facets == len(fitted["faces_vertices"]) < 60, studio.bench.pattern["subject"]
        page.look("sheets")

        # the practice machine: arm, burn, hold, resume, abort, the alarm, and out of it
        page.click("to-machine")
        page.click("connect")
        page.title("Ready")
        page.ready("put-on")
        page.shown("job-work")
        page.ready("arm")
        page.shown("armed")
        assert "card" in page.text("armed-facts").lower()
        page.look("armed")
        page.click("disarm")
        page.until("document.getElementById('armed').hidden")
        page.burn()
        page.click("hold")
        page.title("Held")
        page.look("held")
        page.click("resume")
        page.title("Moving")
        page.run(
            "document.getElementById('abort').dispatchEvent("
            "new PointerEvent('pointerdown', { bubbles: true }))"
        )
        page.title("Alarm")
        page.look("alarm")
        page.run("document.querySelector('#desk .buttons [data-do=unlock]').click()")
        page.title("Ready")
        page.burn()  # and once more, to its end
        page.until("document.getElementById('lines').textContent.includes(' is done: ')", 90)
        page.title("Ready")
        page.click("leave")
        page.shown("connect-form")
        assert page.faults == []
        assert all(asked.startswith((address, "data:", "blob:")) for asked in page.requests)


def test_all_that_the_page_loads_is_less_than_a_megabyte(studio):
    """Its own parts, and both pages that are shown in frames, without their data."""
    key = studio.guard.key
    headers = {"host": f"127.0.0.1:{studio.guard.port}"}
    parts = [ask(studio, f"/{key}/{name}", headers) for name in ("", *PARTS)]
    assert all(status == 200 for status, _ in parts)
    framed = 2 * len(page_text("a page").encode())
    assert sum(len(content) for _, content in parts) + framed <= 1_000_000


def ask(studio, path, headers):

    answered = studio.handle(HttpRequest("GET", path, headers))
    return answered.status, answered.body
