"""The page in a browser: by keyboard and by file, from a surface to sheets, at any width."""

import base64
import threading
import time

import pytest
from axe import AXE, needs_axe, serious_faults
from browser import CHROMIUM, Browser
from studios import saddle_obj

from miurafab.studio.core import Studio
from miurafab.studio.guard import Guard
from miurafab.studio.server import _Server
from miurafab.studio.session import Bench
from miurafab.studio.worker import Process

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


class Seen(Browser):
    """The studio's page, with short ways to look at it."""

    def until(self, expression, seconds=90):
        """Wait until a JavaScript expression is true."""
        end = time.monotonic() + seconds
        while not self.run(expression):
            assert time.monotonic() < end, expression
            time.sleep(0.05)

    def text(self, name):
        return self.run(f"document.getElementById('{name}').innerText")

    def type(self, name, text):
        """Put ``text`` into a field as somebody would who writes it."""
        self.run(f"document.getElementById('{name}').select()")
        self.call("Input.insertText", text=text)

    def press(self, key):
        codes = {"Enter": 13, "Tab": 9, "ArrowRight": 39, "ArrowLeft": 37, "Space": 32}
        named = {"key": key, "code": key, "windowsVirtualKeyCode": codes[key]}
        text = {"text": "\r"} if key == "Enter" else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", **named, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", **named)

    def idle(self):
        self.until("document.getElementById('task').hidden")


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    server = _Server(0, lambda: None)
    guard = Guard(server.server_port, "k" * 32)
    bench = Bench(tmp_path_factory.mktemp("bench"), Process)
    laid = {"gap": "3mm", "full_facet": True}
    first = {"surface": "hypar", "parameters": {}, "layout": laid}
    server.studio = Studio(bench, guard, first)
    serving = threading.Thread(target=server.serve_forever, args=(0.05,))
    serving.start()
    yield guard.address
    server.shutdown()
    serving.join()
    server.server_close()
    server.studio.live.stop()
    bench.cancel()


@pytest.fixture
def page(tmp_path, address):
    with Seen(tmp_path / "profile") as seen:
        seen.open(address)
        seen.until("document.documentElement.dataset.ready === 'yes'")
        yield seen
        assert all(asked.startswith((address, "data:", "blob:")) for asked in seen.requests)


def test_from_a_surface_to_sheets_by_keyboard(page, address):
    assert page.run("document.getElementById('pattern').hidden")
    laid = page.run("import('./choices.js').then((all) => all.layoutOrder().options)")
    assert laid == {"gap": "3mm", "full_facet": True}  # of the design that was named
    page.run("document.getElementById('target').focus()")
    page.run(
        "{ const target = document.getElementById('target'); target.value = 'surface:vase';"
        "target.dispatchEvent(new Event('change')); }"
    )
    assert page.run("document.getElementById('parameter-angle').value") == "120deg"
    page.type("parameter-angle", "100")
    page.type("facets", "8x")
    page.press("Enter")
    page.until("!document.getElementById('fault').hidden")
    assert "'Facets' is '8x'" in page.text("fault")
    page.type("facets", "8x8")
    assert page.run("document.getElementById('fault').hidden")
    page.press("Enter")
    page.until("!document.getElementById('pattern').hidden")
    page.idle()
    assert "folds from flat paper" in page.text("headline")
    command = "miurafab fit vase:angle=100 --facets 8x8 --size 200mm -o vase.fold"
    assert page.text("pattern-command") == command
    assert "Flat facets" in page.text("figures")
    folding = page.run("document.getElementById('space').getAttribute('src')")
    assert folding.endswith("folding.html"), page.text("findings")
    page.until("document.getElementById('flat').naturalWidth > 0")

    page.run("document.getElementById('shape-tab').focus()")
    page.press("ArrowRight")
    assert page.run("document.activeElement.id") == "fold-tab"
    page.until("document.getElementById('folding').clientHeight > 600")
    assert page.run("document.getElementById('folding').getAttribute('src')") == f"{folding}#whole"
    page.press("ArrowRight")
    assert page.run("document.activeElement.id") == "layout-tab"
    assert page.run("document.getElementById('shape').hidden")
    page.type("gap", "4mm")
    page.press("Enter")
    page.until("!document.getElementById('job').hidden")
    page.idle()
    assert "Machine time" in page.text("totals")
    assert page.text("cut-command") == "miurafab cut vase-job --port /dev/ttyUSB0"
    assert page.text("job-command").endswith("--gap 4mm --full-facet")
    links = "[...document.querySelectorAll('#job-downloads a')].map((a) => a.href)"
    for link in page.run(links):
        assert page.run(f"fetch({link!r}).then((answer) => answer.status)") == 200
    shown = page.run("document.getElementById('dry-run').getAttribute('src')")
    assert shown.endswith("preview.html")

    for width, height in ((1400, 900), (390, 844)):
        page.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=width < 600,
        )  # fmt: skip
        for tab in ("shape", "fold", "layout"):
            page.run(f"document.getElementById('{tab}-tab').click()")
            assert page.run("document.documentElement.scrollWidth") <= width

    # the last result cannot be laid out for a form that asks for something else
    can = "!document.getElementById('lay-out').disabled"
    assert page.run(can)
    page.run("document.getElementById('follow').click()")
    page.run("document.getElementById('shape-tab').click()")
    page.type("size", "150mm")
    assert not page.run(can)
    for tab in ("fold", "layout"):
        said = page.run(f"document.getElementById('{tab}-of').textContent")
        assert "Size 200mm. The tab Shape asks for something else" in said
    page.run("document.getElementById('back-to').click()")
    assert page.run(can)
    page.run("document.getElementById('follow').click()")

    # what is refused has no refit on the way
    page.type("facets", "14x14")
    page.until("!document.getElementById('coarse').hidden")
    page.type("facets", "14x")
    page.until("document.getElementById('coming').textContent.includes('cannot be made')")

    # a page that is loaded again in the middle of a fit has the values of that fit
    page.type("facets", "40x40")
    page.press("Enter")
    page.until("!document.getElementById('task').hidden")
    page.open(address)
    page.until("document.documentElement.dataset.ready === 'yes'")
    assert page.run("document.getElementById('facets').value") == "40x40"
    page.run("document.getElementById('cancel').click()")
    page.idle()


@needs_axe
def test_the_tabs_of_a_pattern_have_no_serious_fault(page):
    if page.run("document.getElementById('pattern').hidden"):  # none is there from the test above
        page.run("document.getElementById('fit').click()")
    page.until("!document.getElementById('pattern').hidden")
    page.until("!document.querySelector('.old')")
    for tab in ("shape", "fold", "layout"):
        page.run(f"document.getElementById('{tab}-tab').click()")
        assert serious_faults(page) == [], tab


def test_what_is_shown_within_draws_and_can_ask_for_nothing(page, address):
    """The embedded page has no origin: it folds, and the server does not talk to it."""
    page.run("document.getElementById('shape-tab').click()")
    page.run("document.getElementById('fit').click()")
    page.until("!document.getElementById('pattern').hidden")
    page.idle()
    source = page.run("document.getElementById('space').src")
    page.open(source)
    assert page.run("document.documentElement.dataset.ready") == "fold"
    assert page.run("origin") == "null"
    assert page.run(f"fetch({address + 'state'!r}).then(() => 'in', () => 'out')") == "out"
    page.open(address)
    page.until("document.documentElement.dataset.ready === 'yes'")
    page.until("!document.getElementById('pattern').hidden")  # a page that is loaded again goes on


def choose_file(page, name, content):
    text = base64.b64encode(content).decode()
    page.run(
        "{ const held = new DataTransfer(); const bytes = atob('" + text + "');"
        f"held.items.add(new File([bytes], '{name}'));"
        "const field = document.getElementById('file'); field.files = held.files;"
        "field.dispatchEvent(new Event('change')); }"
    )


def test_a_file_is_chosen_and_a_fit_is_cancelled(page):
    choose_file(page, "bad.fold", b'{"vertices_coords": [[0, 0]]}')
    page.until("!document.getElementById('fault').hidden")
    assert "bad.fold" in page.text("fault")
    page.run("document.getElementById('fold-tab').click()")
    page.run("document.getElementById('shape-tab').click()")
    # the error of a task is told once, and not again when somebody comes back to the page
    state = (
        "performance.getEntriesByType('resource')"
        ".filter(({ name }) => name.endsWith('state')).length"
    )
    asked = page.run(state)
    page.run("document.dispatchEvent(new Event('visibilitychange'))")
    page.until(f"{state} > {asked}")
    page.run("new Promise((done) => setTimeout(done, 300))")
    assert page.run("document.getElementById('fault').hidden")

    choose_file(page, "my saddle.obj", saddle_obj())
    page.until("document.getElementById('target').selectedOptions[0].text === 'my-saddle.obj'")
    assert page.run("document.getElementById('size').value") == ""
    page.type("facets", "200x200")
    page.press("Enter")
    page.until("!document.getElementById('task').hidden")
    page.run("document.getElementById('cancel').click()")
    page.idle()
    assert page.run("document.getElementById('fault').hidden")


DRAG = """{
  const slider = document.querySelector('#%s-row .slider'); slider.focus(); slider.value = %s;
  slider.dispatchEvent(new Event('input', { bubbles: true }));
}"""


def test_a_slider_refits_coarsely_then_wholly_and_is_undone(page):
    shown = "!document.getElementById('{}').hidden".format
    page.run("document.getElementById('target').value = 'surface:plane'")
    page.run("document.getElementById('target').dispatchEvent(new Event('change'))")
    page.type("facets", "6x6")
    page.until(shown("coarse"))
    page.run(DRAG % ("size", 90))
    page.until("document.getElementById('coarse-subject').textContent.endsWith('Size 90mm')")
    assert page.run("document.getElementById('size').value") == "90mm"
    assert "× 90 ×" in page.text("coarse-size") or "90 ×" in page.text("coarse-size")
    assert "One sheet, no glue" in page.text("coarse-bed")
    assert "coarse fit of 6 × 6" in page.text("coarse-note")
    drawn = (
        "[...document.getElementById('sketch').getContext('2d')"
        ".getImageData(0, 0, 2000, 2000).data].some((value) => value > 0)"
    )
    page.until(drawn)

    page.until(shown("pattern"))  # the whole fit came by itself
    page.idle()
    assert not page.run(shown("coarse"))
    assert page.text("subject") == "plane · Facets 6x6 · Size 90mm"
    page.until(shown("bed"))
    assert "One sheet, no glue" in page.text("bed")

    # a larger size: the same sheet, scaled, and no download of the old one within reach
    page.run(DRAG % ("size", 120))
    page.until("document.getElementById('coarse-subject').textContent.endsWith('Size 120mm')")
    assert "linear" in page.text("coarse-note")
    assert not AXE.is_file() or serious_faults(page) == []
    assert not page.run(shown("pattern"))
    page.run("document.activeElement.dispatchEvent(new KeyboardEvent('keydown', "
             "{ key: 'z', ctrlKey: true, bubbles: true, cancelable: true }))")  # fmt: skip
    assert page.run("document.getElementById('size').value") == "90mm"
    assert page.run("document.querySelector('#size-row .slider').value") == "90"
    page.run("document.getElementById('redo').click()")
    assert page.run("document.getElementById('size').value") == "120mm"
    page.until("document.getElementById('subject').textContent.endsWith('Size 120mm')")
    page.idle()
    page.until(shown("pattern"))

    # without the refit the old result stays, greyed, and says what it is
    page.run("document.getElementById('follow').click()")
    page.type("facets", "9x6")
    assert page.run("document.getElementById('pattern').classList.contains('old')")
    assert "Facets 6x6 · Size 120mm" in page.text("stale-words")
    assert page.run("document.getElementById('go-on').disabled")
    assert not AXE.is_file() or serious_faults(page) == []
    page.run("document.getElementById('back-to').click()")
    assert page.run("document.getElementById('facets').value") == "6x6"
    assert not page.run("document.getElementById('pattern').classList.contains('old')")
    page.run("document.getElementById('follow').click()")

    # something wrong has no result, and says why beside the form
    page.type("facets", "6x")
    page.until(shown("refused"))
    assert "'Facets' is '6x'" in page.text("refused")
    page.type("facets", "6x6")
    assert not page.run(shown("refused"))
    page.idle()


def test_a_studio_that_has_ended_is_told(page):
    still = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
    page.call("Network.emulateNetworkConditions", offline=True, **still)
    page.run("document.getElementById('fit').click()")
    page.until("!document.getElementById('fault').hidden")
    assert "does not answer" in page.text("fault")
