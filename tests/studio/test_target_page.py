"""The target on the page: drawn, dropped, placed by hand, mended, and coloured after its fit."""

import base64
import io
import json
import threading
import time

import numpy as np
import pytest
from axe import AXE, serious_faults
from browser import CHROMIUM, Browser
from PIL import Image
from test_target_view import stl

from miurafab.studio.core import Studio
from miurafab.studio.guard import Guard
from miurafab.studio.server import _Server
from miurafab.studio.session import Bench
from miurafab.studio.worker import Process

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")

PAPER, LEFT_OUT = (242, 230, 207), (169, 178, 187)
KEYS = {"ArrowRight": 39, "ArrowUp": 38, "Delete": 46, "+": 187}


class Looked(Browser):
    """The page with short ways to use it; ``faults`` are errors of its scripts and its console."""

    def __init__(self, profile):
        self.faults = []
        super().__init__(profile)
        self.call("Log.enable")
        self.call("Performance.enable", timeDomain="threadTicks")

    def _next(self):
        message = super()._next()
        method = message.get("method")
        entry = message.get("params", {}).get("entry", {})
        if method == "Runtime.exceptionThrown" or entry.get("level") == "error":
            self.faults.append(json.dumps(message["params"]))
        return message

    def until(self, expression, seconds=60):
        end = time.monotonic() + seconds
        while not self.run(expression):
            assert time.monotonic() < end, expression
            time.sleep(0.05)

    def shown(self, name):
        self.until(f"!document.getElementById('{name}').hidden")

    def text(self, name):
        return self.run(f"document.getElementById('{name}').innerText")

    def value(self, name):
        return self.run(f"document.getElementById('{name}').value")

    def click(self, selector):
        self.run(f"document.querySelector({selector!r}).click()")

    def put(self, name, value):
        tell = "each.dispatchEvent(new Event(kind, {bubbles: true}))"
        self.run(
            f"{{ const each = document.getElementById('{name}'); each.value = {value!r};"
            f"for (const kind of ['input', 'change']) {tell}; }}"
        )

    def press(self, key, shift=False):
        named = {"key": key, "code": key, "windowsVirtualKeyCode": KEYS[key]}
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, modifiers=8 * shift, **named)

    def place(self, selector, x, y):
        """The point of the window at the shares ``x``, ``y`` of an element, scrolled into view."""
        box = self.run(
            f"(() => {{ const e = document.querySelector({selector!r});"
            "e.scrollIntoView({block: 'center'}); const b = e.getBoundingClientRect();"
            "return [b.left, b.top, b.width, b.height]; })()"
        )
        return box[0] + x * box[2], box[1] + y * box[3]

    def drag(self, selector, start, end):
        (x, y), (u, v) = self.place(selector, *start), self.place(selector, *end)
        for kind, at in (
            ("mousePressed", (x, y)),
            ("mouseMoved", (u, v)),
            ("mouseReleased", (u, v)),
        ):
            self.call(
                "Input.dispatchMouseEvent", type=kind, x=at[0], y=at[1], button="left", buttons=1,
                clickCount=1,
            )  # fmt: skip

    def drop(self, name, content):
        """Drop a file onto the page."""
        data = base64.b64encode(content).decode()
        self.run(
            "{ const held = new DataTransfer();"
            f"const bytes = Uint8Array.from(atob('{data}'), (one) => one.charCodeAt(0));"
            f"held.items.add(new File([bytes], '{name}'));"
            "document.body.dispatchEvent(new DragEvent('drop',"
            "{ dataTransfer: held, bubbles: true, cancelable: true })); }"
        )
        self.until(f"document.getElementById('target').selectedOptions[0].text === '{name}'")

    def picture(self, selector):
        """(rows, columns, 3) the pixels of an element."""
        time.sleep(0.3)  # a frame
        self.place(selector, 0, 0)
        box = self.run(
            f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect();"
            "return [b.left + scrollX, b.top + scrollY, b.width, b.height]; })()"
        )
        clip = dict(zip(("x", "y", "width", "height"), box, strict=True), scale=1)
        shot = self.call("Page.captureScreenshot", clip=clip)["data"]
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB"), dtype=int)

    def share(self, selector, colour):
        """The share of the pixels that have the hue of ``colour``, in whatever light."""
        pixels = self.picture(selector)
        light = pixels.sum(axis=2, keepdims=True) / sum(colour)
        near = np.abs(pixels - light * colour).max(axis=2) < 9
        return float((near & (light[..., 0] > 0.4) & (light[..., 0] < 1.03)).mean())

    def busy(self):
        """Seconds of processor time of the page so far."""
        told = {
            each["name"]: each["value"] for each in self.call("Performance.getMetrics")["metrics"]
        }
        return told["TaskDuration"]


@pytest.fixture
def page(tmp_path):
    server = _Server(0, lambda: None)
    guard = Guard(server.server_port, "k" * 32)
    (tmp_path / "bench").mkdir()
    bench = Bench(tmp_path / "bench", Process)
    server.studio = Studio(bench, guard)
    serving = threading.Thread(target=server.serve_forever, args=(0.05,))
    serving.start()
    try:
        with Looked(tmp_path / "profile") as seen:
            seen.open(guard.address)
            seen.until("document.documentElement.dataset.ready === 'yes'")
            seen.click("#follow")  # no fit before it is asked for
            yield seen
            assert seen.faults == []
            local = (guard.address, "data:", "blob:")
            assert all(asked.startswith(local) for asked in seen.requests)
    finally:
        server.shutdown()
        serving.join()
        server.server_close()
        server.studio.live.stop()
        server.studio.sight.stop()
        bench.cancel()


def test_a_target_is_drawn_dropped_placed_mended_and_compared(page):
    page.shown("target-panel")
    assert page.share("#target-canvas", PAPER) > 0.1  # the hypar, before anything is asked for
    begin = page.busy()
    page.put("target", "surface:vase")
    page.until("document.getElementById('parameter-neck') !== null")
    page.share("#target-canvas", PAPER)
    assert page.busy() - begin < 0.3

    page.put("target", "surface:formula")
    page.put("parameter-z", "0.2*sin(pi*x)*y")
    page.until("document.getElementById('target-refused').hidden")
    page.put("parameter-z", "0.2*sin(pi*x")
    page.shown("target-refused")
    assert "a bracket is not closed" in page.text("target-refused-words")
    assert page.run("document.getElementById('target-canvas').classList.contains('old')")
    page.put("parameter-z", "0.2*sin(pi*x)")
    page.until("document.getElementById('target-refused').hidden")
    assert page.share("#target-canvas", PAPER) > 0.1

    _draw(page)

    page.drop("cap-40.stl", stl("cap-40"))
    page.shown("target-place")
    whole = page.share("#target-canvas", PAPER)
    assert page.share("#target-canvas", LEFT_OUT) < 0.01
    _place(page, whole)

    page.drop("hole.stl", stl("hole"))
    page.until("document.querySelectorAll('#target-mends button').length === 2")
    assert page.value("region") == ""  # it was that of the other mesh
    assert page.text("target-mends").split("\n") == ["Keep the hole as a window", "Fill the hole"]
    page.click("#target-mends button:last-child")
    page.until("document.getElementById('target-findings').innerText.includes('was filled')")
    assert page.value("holes") == "all"
    assert "fills a hole" in page.text("target-key")

    if AXE.is_file():
        assert serious_faults(page) == []

    page.drop("egg.stl", stl("egg"))
    page.shown("target-open")
    assert "5 pieces or more" in page.text("target-key")
    page.click("#target-open")
    # what was found for the poles that were taken unasked says nothing of those that are picked
    page.run("document.getElementById('target-findings').replaceChildren()")
    for spot in ((0.5, 0.13), (0.5, 0.86)):
        page.drag("#target-canvas", spot, spot)
    page.until("document.getElementById('poles').value.split(',').length === 6")
    page.until("document.getElementById('target-findings').innerText.includes('leaves holes')")

    page.put("target", "surface:hypar")
    page.put("facets", "6x6")
    page.click("#fit")
    page.shown("target-colours")
    assert "not covered" in page.text("target-key")
    assert page.share("#target-canvas", PAPER) < 0.02  # all is coloured by its deviation
    page.put("facets", "8x8")  # the colours are those of another sheet
    page.until("document.getElementById('target-colours').hidden")
    assert page.share("#target-canvas", PAPER) > 0.1
    page.put("facets", "6x6")
    page.shown("target-colours")
    page.put("target-colours", "charts")
    assert page.share("#target-canvas", PAPER) > 0.1
    page.put("parameter-height", "0.7")  # the colours belong to another target
    page.until("document.getElementById('target-colours').hidden")
    page.until("document.getElementById('task').hidden")

    for width in (1400, 820, 390):
        page.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1,
            mobile=width < 600,
        )  # fmt: skip
        assert page.run("document.documentElement.scrollWidth") <= width


def _draw(page):
    """A profile, by mouse and by keys."""
    page.put("target", "surface:revolution")
    page.click("#draw-profile")
    page.until("document.querySelectorAll('#profile-svg circle').length === 5")
    before = page.run("document.getElementById('profile-curve').getAttribute('d')")
    page.run("document.querySelector('#profile-svg circle').focus()")
    label = page.run("document.activeElement.getAttribute('aria-label')")
    page.press("ArrowRight", shift=True)
    moved = page.run("document.activeElement.getAttribute('aria-label')")
    assert float(moved.split("r ")[1].split(",")[0]) == pytest.approx(
        float(label.split("r ")[1].split(",")[0]) + 0.2, abs=0.01
    )
    page.until(f"document.getElementById('profile-curve').getAttribute('d') !== {before!r}")
    page.press("+")
    page.until("document.querySelectorAll('#profile-svg circle').length === 6")
    page.press("Delete")
    page.until("document.querySelectorAll('#profile-svg circle').length === 5")
    page.drag("#profile-svg circle:last-of-type", (0.5, 0.5), (4, 0.5))
    assert page.run("document.querySelector('circle:last-of-type').ariaLabel") != label
    page.click("#profile-symmetric")
    asked = "import('./choices.js').then((all) => all.fitOrder()[1].target.profile)"
    profile = np.array(page.run(asked))
    assert np.allclose(profile[:, 0], profile[::-1, 0])
    assert np.allclose(profile[:, 1], -profile[::-1, 1])
    page.until("document.getElementById('target-refused').hidden")
    page.click("#draw-profile")
    assert page.run(asked) is None


def _place(page, whole):
    """The part of a mesh, by keys and by mouse; what reaches beyond it is mended by its button."""
    page.click("#target-part")
    u0, u1, v0, v1 = map(float, page.value("region").split(","))
    assert page.share("#target-canvas", PAPER) < 0.95 * whole
    assert page.share("#target-canvas", LEFT_OUT) > 0.02
    page.press("ArrowRight")
    page.press("ArrowUp", shift=True)
    moved = list(map(float, page.value("region").split(",")))
    assert moved == pytest.approx([u0 + 0.01, u1 + 0.01, v0, v1 + 0.01], abs=2e-4)
    page.drag("#target-map", (0.5, 0.5), (0.6, 0.5))
    after = list(map(float, page.value("region").split(",")))
    assert after[0] - moved[0] == pytest.approx(after[1] - moved[1], abs=2e-4)
    assert after[0] > moved[0] + 0.05
    assert after[2:] == moved[2:]
    page.put("target-turn", "30")
    assert page.value("rotate") == "30.0"
    page.until("document.querySelectorAll('#target-mends button').length === 1")
    assert "reaches beyond" in page.text("target-place-note")
    page.click("#target-mends button")
    page.until("!document.getElementById('target-place-note').innerText.includes('beyond')")
    page.click("#target-whole")
    assert page.value("region") == ""
    assert page.share("#target-canvas", LEFT_OUT) < 0.01
