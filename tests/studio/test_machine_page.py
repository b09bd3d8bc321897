"""The tab Machine in a browser: arm, burn, hold, go on, abort from anywhere, and take over."""

import os
import signal
import threading
import time

import pytest
import studio_picture
from benches import children
from browser import CHROMIUM
from rigs import ROWS
from test_machine_tab import Itself, command
from test_studio_page import Seen

import miurafab
from miurafab.studio.core import Studio
from miurafab.studio.desk import Desk
from miurafab.studio.guard import Guard
from miurafab.studio.server import _Server
from miurafab.studio.session import Bench
from miurafab.workflow.page import write_page

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


class AtDesk(Seen):
    """The page, with the tab Machine in front."""

    def click(self, name):
        self.run(f"document.getElementById('{name}').click()")

    def ready(self, name):
        """Wait until a button can be pressed, and press it."""
        self.until(f"!document.getElementById('{name}').disabled")
        self.click(name)

    def title(self, words):
        self.until(f"document.getElementById('state-title').textContent === '{words}'", 30)

    def escape(self):
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent",
                type=kind, key="Escape", code="Escape", windowsVirtualKeyCode=27,
            )  # fmt: skip

    def burn(self):
        """Arm, read, and start; until strokes are burnt."""
        self.ready("arm")
        self.until("!document.getElementById('armed').hidden")
        assert self.run("document.activeElement.id") == "disarm"
        self.click("start")
        self.until(
            "document.getElementById('strokes-words').textContent.startsWith('stroke 3')", 30
        )


@pytest.fixture
def studio(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    job = tmp_path / "rows.nc"
    job.write_text(ROWS)
    server = _Server(0, lambda: None)
    guard = Guard(server.server_port, "k" * 32)
    (tmp_path / "bench").mkdir()
    desk = Desk(speed=3.0)
    server.studio = Studio(Bench(tmp_path / "bench", None), guard, desk=desk, own_job=job)
    serving = threading.Thread(target=server.serve_forever, args=(0.05,))
    serving.start()
    yield server.studio
    desk.leave()
    server.shutdown()
    serving.join()
    server.server_close()


def test_a_sheet_is_burnt_held_and_aborted_from_every_screen(studio, tmp_path):
    page_file = tmp_path / "drawing.html"
    write_page(page_file, title="plane", pattern=miurafab.fit("plane", facets="4x4").pattern)
    studio.bench.files["1", "drawing.html"] = page_file
    address = studio.guard.address
    with AtDesk(tmp_path / "profile") as page:
        page.open(address)
        page.until("document.documentElement.dataset.ready === 'yes'")
        assert not page.run("document.getElementById('desk').hidden")  # it began with a job
        assert page.run("document.getElementById('watch').hidden")
        page.click("connect")
        page.title("Ready")
        page.ready("put-on")
        page.until("!document.getElementById('job-work').hidden")
        page.burn()
        page.click("hold")
        page.title("Held")
        page.click("resume")
        page.title("Moving")
        assert not page.run("document.getElementById('abort').disabled")

        page.click("shape-tab")
        assert page.run("document.getElementById('abort').offsetParent !== null")
        page.escape()
        page.title("Alarm")
        assert "press Unlock" in page.run("document.getElementById('state-advice').textContent")
        page.click("desk-tab")
        unlock = "#desk .buttons [data-do=unlock]"
        page.run(f"document.querySelector({unlock!r}).click()")
        page.title("Ready")

        # Within a drawing that has the focus, the key works as well.
        page.burn()
        page.run(
            "{ const frame = document.createElement('iframe'); frame.id = 'drawing';"
            "frame.setAttribute('sandbox', 'allow-scripts'); frame.src = 'files/1/drawing.html';"
            "document.getElementById('desk').prepend(frame);"
            "frame.onload = () => { frame.dataset.there = 'yes'; frame.focus(); }; }"
        )
        page.until("document.getElementById('drawing').dataset.there === 'yes'")
        assert page.run("document.activeElement.id") == "drawing"
        page.escape()
        page.title("Alarm")
        page.run(f"document.querySelector({unlock!r}).click()")
        page.title("Ready")

        # The page dies in mid-job: the one that is opened then watches, and takes over.
        page.burn()
        page.open(address)
        page.until("document.documentElement.dataset.ready === 'yes'")
        page.until("!document.getElementById('watching').hidden")
        assert page.run("document.getElementById('hold').disabled")
        page.click("take")
        page.until("document.getElementById('watching').hidden")
        page.ready("hold")
        page.title("Held")
        for width in (1280, 768, 390):
            page.call(
                "Emulation.setDeviceMetricsOverride",
                width=width, height=844, deviceScaleFactor=1, mobile=width < 600,
            )  # fmt: skip
            assert page.run("document.documentElement.scrollWidth") <= width
        studio_picture.picture(page, tmp_path / "machine.png")
        assert (tmp_path / "machine.png").read_bytes().startswith(b"\x89PNG")
        page.click("leave")
        page.until("!document.getElementById('connect-form').hidden")
        assert all(asked.startswith((address, "data:", "blob:")) for asked in page.requests)


def test_the_pad_rests_when_it_is_released_while_disabled_and_one_loop_asks(studio, tmp_path):
    right = "document.querySelector('#pad .right')"
    with AtDesk(tmp_path / "profile") as page:
        page.open(studio.guard.address)
        page.until("document.documentElement.dataset.ready === 'yes'")
        page.click("connect")
        page.title("Ready")
        page.until(f"!{right}.disabled")
        jogs = "performance.getEntriesByType('resource').filter((e) => /jog$/.test(e.name)).length"
        page.run(f"{right}.dispatchEvent(new PointerEvent('pointerdown', {{button: 0}}))")
        page.until(f"{jogs} >= 2")
        studio.desk.take_over()  # another page
        page.until(f"{right}.disabled")
        time.sleep(0.3)  # it is released, of which a disabled button need not tell
        page.click("take")
        page.until(f"!{right}.disabled")
        time.sleep(0.3)
        before = page.run(jogs)
        time.sleep(0.5)
        assert page.run(jogs) == before

        page.run(
            "for (let k = 0; k < 20; k += 1) document.dispatchEvent(new Event('visibilitychange'))"
        )
        asked = (
            "performance.getEntriesByType('resource').filter((e) => /after=/.test(e.name)).length"
        )
        time.sleep(0.5)
        page.run("performance.clearResourceTimings()")
        time.sleep(1.0)
        assert 1 <= page.run(asked) <= 6


def test_a_session_that_ends_by_itself_says_so_on_every_tab(studio, tmp_path):
    with AtDesk(tmp_path / "profile") as page:
        page.open(studio.guard.address)
        page.until("document.documentElement.dataset.ready === 'yes'")
        page.click("connect")
        page.title("Ready")
        page.click("shape-tab")
        (holder,) = [pid for pid in children(Itself()) if b"session_process" in command(pid)]
        os.kill(holder, signal.SIGKILL)
        page.until("!document.getElementById('connect-form').hidden", 30)
        assert "was killed by signal 9" in page.text("fault")
        page.open(studio.guard.address)  # loaded anew, it still tells
        page.until("document.documentElement.dataset.ready === 'yes'")
        assert "was killed by signal 9" in page.text("desk-ended")
