"""The machine from the studio, without a browser, proved on the bytes at the controller."""

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benches import children
from rigs import LINE, MACHINE, ROWS, AtMachine, Pumped, until
from small_jobs import write_job
from studios import request, sentence

from miurafab.errors import InputError
from miurafab.machine.owner import Owner, owner_of
from miurafab.machine.watchdog import SILENCE_S
from miurafab.studio import kept_jobs
from miurafab.studio.core import Studio
from miurafab.studio.desk import Desk
from miurafab.studio.kept_jobs import keep_job
from miurafab.studio.machine_orders import ACTIONS, KEYS, ROUTES
from miurafab.studio.machine_words import alarm_of, plain, state_words
from miurafab.workflow.manifest import MANIFEST

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="needs pseudo-terminals and /proc"
)


@pytest.fixture(autouse=True)
def own_folders(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def at(tmp_path, request):
    """A studio with a job of rows at a bench, whose speed may be a parameter."""
    job = tmp_path / "rows.nc"
    job.write_text(ROWS)
    (tmp_path / "bench").mkdir()
    pumped = Pumped(speed=getattr(request, "param", 1.0))
    with pumped as bench:
        studio = AtMachine(tmp_path / "bench", job, bench.wire.address)
        studio.bench, studio.stop = bench, pumped.stop
        yield studio
        studio.desk.leave()


def burning(at):
    at.start()
    until(lambda: at.bench.device.beam_on and at.bench.bytes_came.count(b"\n") > 20)


def test_a_sheet_is_armed_started_changed_and_nothing_burns_by_one_step(tmp_path):
    (tmp_path / "bench").mkdir()
    pumped = Pumped(speed=40.0)
    with pumped as bench:
        at = AtMachine(tmp_path / "bench", write_job(tmp_path / "job", 2), bench.wire.address)
        before = bench.commands
        assert sentence(at.ask("start", code="x")).startswith("Nothing is armed")
        armed = at.ok("arm")["armed"]
        facts = dict(armed["facts"])
        assert facts["Sheet"] == "sheet-01.nc (sheet 1 of 2)"
        assert facts["Material"] == "card-250"
        assert facts["Most power"] == "80 % of full power, 8.0 W"
        assert facts["Bounds"].startswith("X 5 to ")
        assert facts["Machine, port"].endswith(bench.wire.address)
        assert sentence(at.ask("start", code=armed["code"][:-1])).startswith("Nothing is armed")
        assert sentence(at.ask("start", code=armed["code"])).startswith("Nothing is armed")
        code = at.ok("arm")["armed"]["code"]
        at.ok("jog", x=1, y=0, step=10.0)  # whatever is asked disarms
        assert at.seen()["armed"] is None
        assert sentence(at.ask("start", code=code)).startswith("Nothing is armed")
        until(lambda: at.seen()["work"][0] == 10.0)
        assert bench.commands.removeprefix(before).startswith(b"$J=G21G91X10.000F")
        assert b"M4" not in bench.commands
        at.until(state="Idle", busy="")
        at.ok("do", action="set_origin")
        at.until(busy="")
        at.start()
        state = at.until(sheet=2, busy="")
        assert state["words"]["title"] == "Waiting for you"
        assert bench.device.beam_log[0].x0 >= 10.0
        assert "put in fresh material" in sentence(at.ask("arm"))
        at.ok("do", action="fresh")
        at.until(loaded=False, busy="")
        at.start()
        at.until(loaded=True, busy="")
        kept = Path(at.seen()["job"]["folder"])
        assert (kept / "sheet-02.journal").is_file()
        at.ok("leave")
        assert not at.seen()["open"]
        pumped.stop().assert_dark()


def test_hold_is_dark_resume_goes_on_and_abort_leaves_the_session(at):
    burning(at)
    at.ok("key", key="hold")
    state = until(lambda: (s := at.seen())["state"] == "Hold:0" and s)
    assert state["words"]["title"] == "Held"
    assert not at.bench.device.beam_on
    done = state["progress"]["stroke"]
    at.ok("key", key="resume")
    until(lambda: at.seen()["progress"]["stroke"] > done)
    at.ok("key", key="power-")
    until(lambda: at.seen()["facts"]["power-percent"] == "90 %")
    before = at.bench.bytes_came
    at.ok("abort")
    until(lambda: b"\x18" in at.bench.bytes_came)
    dark = next(moment for _, moment, data in at.bench.came if b"\x18" in data)
    assert b"!" not in at.bench.bytes_came[len(before) :]
    state = at.until(busy="", state="Alarm")
    assert "ALARM:3" in state["words"]["advice"]
    assert "press Unlock" in state["words"]["advice"]
    assert "reports the beam off" in state["trouble"]
    assert "idle" in sentence(at.ask("arm"))
    at.ok("do", action="unlock")
    assert at.until(busy="", state="Idle")["words"]["title"] == "Waiting for you"
    burnt = at.stop().device.beam_log  # a hold may leave a trace (docs/cutting.md), an abort none
    assert all(segment.t1 <= dark + 0.01 for segment in burnt)


def test_a_start_that_is_aborted_at_once_burns_nothing(at):
    for _ in range(3):
        code = at.ok("arm")["armed"]["code"]
        at.ok("start", code=code)
        at.ok("abort")
        at.until(busy="", state="Idle")
    assert at.bench.commands.count(b"\x18") >= 1
    assert b"M4" not in at.bench.commands
    assert at.bench.device.beam_log == []


def test_one_page_controls_the_others_watch_and_any_aborts(at):
    first = at.control
    other = at.post("machine/take", {}).json()
    assert other["taken"] == 2
    before = at.bench.commands
    for route, order in (("arm", {}), ("key", {"key": "hold"}), ("do", {"action": "home"})):
        assert "press 'Take over'" in sentence(at.ask(route, **order))
    assert "press 'Take over'" in sentence(at.post("machine/leave", {}))
    assert at.bench.commands == before
    at.control = other["control"]
    at.ok("arm")
    assert at.post("machine/take", {}).json()["armed"] is None
    at.control = first
    at.ok("abort")
    until(lambda: b"\x18" in at.bench.bytes_came[len(before) :])


@pytest.mark.parametrize("at", [4.0], indirect=True)
def test_a_page_that_dies_in_mid_job_stops_nothing(at):
    burning(at)
    lines = at.bench.bytes_came.count(b"\n")
    time.sleep(SILENCE_S + 0.7)  # nobody asks for anything
    assert at.bench.bytes_came.count(b"\n") > lines + 20
    assert b"\x18" not in at.bench.bytes_came
    assert at.seen()["progress"]["stroke"] > 10


def test_a_machine_that_says_nothing_is_not_shown_as_well(at):
    assert at.seen()["words"]["title"] == "Ready"
    at.bench.device.freeze(math.inf)
    state = until(lambda: (s := at.seen())["words"]["title"] == "No answer" and s)
    assert "what stands here is old" in state["words"]["advice"]


def test_the_process_that_holds_the_port_is_killed(at):
    burning(at)
    (holder,) = [pid for pid in children(Itself()) if b"session_process" in command(pid)]
    os.kill(holder, signal.SIGKILL)
    until(lambda: not at.seen()["open"])
    assert "was killed by signal 9; the controller was reset" in at.seen()["ended"]
    assert b"\x18" in at.bench.bytes_came
    assert "No machine is connected" in sentence(at.ask("arm"))
    at.connect()
    at.stop().assert_dark()


class Itself:
    pid = os.getpid()


def command(pid):
    return Path(f"/proc/{pid}/cmdline").read_bytes()


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_the_studio_is_killed_or_suspended_and_its_port_was_named_as_held(tmp_path, how):
    """A second command is told who has the port; then the whole studio dies in mid-job, or stands
    still as after Ctrl-Z, whose own signal a process group without a terminal is spared (POSIX).
    """
    job = tmp_path / "rows.nc"
    job.write_text(ROWS)
    pumped = Pumped()
    with pumped as bench:
        server = subprocess.Popen(
            [sys.executable, "-m", "miurafab", "studio", str(job), "--no-browser", "--json"],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            said = ""
            while not said.rstrip().endswith("}"):
                said += server.stdout.readline()
            page = Over(json.loads(said)["address"])
            control = page.ask("connect", port=bench.wire.address, machine=MACHINE)["control"]
            until(lambda: page.state().get("state") == "Idle" and not page.state()["busy"])
            page.ask("job", control=control)
            second = subprocess.run(
                [sys.executable, "-m", "miurafab", "machine", "jog", "--x", "1", "--port",
                 bench.wire.address], stderr=subprocess.PIPE, text=True, check=False,
            )  # fmt: skip
            assert second.returncode == 3
            assert f"process {server.pid} (miurafab studio " in second.stderr
            assert "do it there, on the tab Machine" in second.stderr
            assert str(server.pid) in owner_named(bench.wire.address)
            code = page.ask("arm", control=control)["armed"]["code"]
            page.ask("start", control=control, code=code)
            until(lambda: bench.device.beam_on and bench.bytes_came.count(b"\n") > 20)
            server.send_signal(getattr(signal, how))
            until(lambda: b"\x18" in bench.bytes_came)
            dark = next(moment for _, moment, data in bench.came if b"\x18" in data)
            pumped.stop().assert_dark_from(dark)
        finally:
            server.kill()
            server.wait()
            server.stdout.close()


def owner_named(port):
    owner = owner_of(port)
    return "" if owner is None else str(owner)


class Over:
    """A page over HTTP."""

    def __init__(self, address):
        from test_studio_server import Page

        self._page = Page(address)

    def ask(self, route, **order):
        return self._page.post(f"machine/{route}", order)

    def state(self):
        return json.loads(self._page.get("machine"))


def test_a_setting_that_is_not_the_profile_s_is_shown_and_stops_the_start(at):
    at.ok("say", text="$30=255")
    state = until(lambda: (s := at.seen())["settings"]["differ"] == 1 and s)
    assert state["settings"]["rows"][0] == {
        "name": "$30 (largest S value)", "here": "255", "wanted": "1000", "same": False,
    }  # fmt: skip
    assert "instead of 1000" in state["settings"]["refused"]
    at.until(busy="", state="Idle")
    at.start()
    trouble = until(lambda: not (s := at.seen())["busy"] and s["trouble"])
    assert "$30 (largest S value) is 255 instead of 1000" in trouble
    assert "the option force of 'miurafab cut'" in trouble
    assert b"M4" not in at.bench.commands


NOT_OFFERED = (
    ("do", {"action": "close"}),
    ("key", {"key": "\x18"}),
    ("jog", {"x": 5, "y": 0, "step": 10.0}),
    ("jog", {"x": 1, "y": 0, "step": 1000.0}),
    ("jog", {"x": "1", "y": [], "step": 1.0}),
    ("jog", {"x": 0, "y": 0, "step": 1.0}),
    ("jog", {}),
    ("start", {"code": "ключ"}),
    ("leave", {"control": "ключ"}),
    ("sheet", {"number": "2"}),
    ("sheet", {"number": 2}),
    ("sheet", {"number": True}),
    ("say", {"text": "$X\n$H"}),
    ("start", {}),
    ("arm", {"force": "bounds"}),
    ("connect", {"port": "virtual", "machine": MACHINE}),
    ("leave", {}),
    ("connect", {"port": "/etc/passwd", "machine": MACHINE}),
    ("connect", {"port": "virtual", "machine": "../secret"}),
    ("connect", {"port": "virtual", "machine": "marlin-laser"}),
    ("connect", {"port": "virtual"}),
)


def test_what_the_page_does_not_offer_is_refused(tmp_path):
    job = tmp_path / "line.nc"
    job.write_text(LINE)
    (tmp_path / "bench").mkdir()
    at = AtMachine(tmp_path / "bench", job, "virtual")
    try:
        for route, order in NOT_OFFERED:
            answered = at.ask(route, **order)
            if (route, order) == ("leave", {}):
                assert answered.status == 200
            else:
                sentence(answered)
    finally:
        at.desk.leave()


@pytest.mark.parametrize("route", ROUTES)
def test_every_request_of_the_machine_needs_key_and_origin(tmp_path, route):
    """A page of another site changes nothing, whatever it asks for."""

    class Untouched:
        def __getattr__(self, name):
            raise AssertionError(f"the desk was asked for {name}")

    from studios import GUARD

    from miurafab.studio.session import Bench

    studio = Studio(Bench(tmp_path, None), GUARD, desk=Untouched())
    for change in (
        {"origin": "https://evil.example"},
        {"origin": ""},
        {"x_studio_key": ""},
        {"host": "evil.example"},
    ):
        refused = studio.handle(request("POST", f"machine/{route}", {}, **change))
        assert refused.status in (403, 421)
    assert studio.handle(request("GET", f"machine/{route}")).status == 404


def test_words_for_each_state():
    said = {"silent_s": 0.0, "alarm": None, "homes": True, "waits": "", "homing": False}
    said["material_wanted"] = ""
    titles = {
        word: state_words(word, **said).title
        for word in ("", "Idle", "Run", "Jog", "Hold:0", "Hold:1", "Door:1", "Door:3", "Alarm")
    }
    assert titles == {
        "": "Connecting", "Idle": "Ready", "Run": "Moving", "Jog": "Jogging", "Hold:0": "Held",
        "Hold:1": "Braking", "Door:1": "Lid open", "Door:3": "Going on", "Alarm": "Alarm",
    }  # fmt: skip
    limit = state_words("Alarm", **(said | {"alarm": alarm_of("ALARM:1")})).advice
    assert "a limit switch was hit" in limit
    assert limit.endswith("Abort resets the controller; then press Home.")
    soft = state_words("Alarm", **(said | {"alarm": 2, "homes": False})).advice
    assert soft.endswith("then press Unlock: the position is still right.")
    assert state_words("Home", **(said | {"homing": True, "silent_s": 60.0})).title == "Homing"
    assert (
        state_words("Hold:0", **(said | {"waits": "waiting at x.nc, line 4 (M0)"})).look == "held"
    )
    turned = said | {"material_wanted": "turn the sheet over, left to right"}
    assert state_words("Idle", **turned).advice == (
        "A sheet that is burnt lies in the machine. Turn the sheet over, left to right; then press "
        "'The sheet is in'."
    )
    assert state_words("Run", **turned).title == "Moving"
    assert plain("Give `home`, or `at`.") == "Give 'Home', or 'Set origin here'."


def test_the_job_of_a_layout_is_kept_where_its_journal_stays(tmp_path):
    job = write_job(tmp_path / "hypar-job", 1)
    kept = keep_job(job)
    assert kept.parent == tmp_path / "state" / "miurafab" / "studio"
    (kept / "sheet-01.journal").write_text("begun")
    names = {path.name: path.read_bytes() for path in job.iterdir()}
    assert {path.name for path in kept.iterdir()} == {*names, "sheet-01.journal"}
    assert all((kept / name).read_bytes() == content for name, content in names.items())
    assert keep_job(job) == kept
    assert (kept / "sheet-01.journal").read_text() == "begun"
    shutil.rmtree(kept)
    kept.write_text("a file")
    with pytest.raises(InputError, match=r"The job cannot be kept in .*: Not a directory"):
        keep_job(job)
    shutil.rmtree(kept.parent)
    kept.parent.write_text("a file")
    with pytest.raises(InputError, match="which is a file; give a folder"):
        keep_job(job)


def test_a_job_that_another_studio_holds_outlives_twenty_more(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_jobs, "_KEPT", 2)
    jobs = [write_job(tmp_path / f"job-{number}", 1) for number in range(5)]
    kept = []
    for number, job in enumerate(jobs):
        (job / MANIFEST).write_text(str(number))  # no two alike
        kept.append(keep_job(job))
        os.utime(kept[-1], (number, number))
        if number == 0:  # the mark of a studio that lives, and of one that is gone
            mark = kept[0].parent / f".held-{kept[0].name}-{os.getppid()}"
            mark.touch()
        if number == 1:
            (kept[1].parent / f".held-{kept[1].name}-{2**22 + 1}").touch()
    assert [folder.is_dir() for folder in kept] == [True, False, False, True, True]
    marks = {path.name for path in kept[0].parent.glob(".held-*")}
    assert marks == {mark.name, f".held-{kept[4].name}-{os.getpid()}"}  # one of each studio


def test_a_port_that_somebody_holds_says_so(tmp_path, monkeypatch):
    from miurafab.machine.owner import claim
    from miurafab.profiles.own import OwnDefaults, write_defaults

    port = tmp_path / "ttyUSB0"
    port.touch()
    write_defaults(OwnDefaults(port=str(port)))
    claim(str(port), Owner("miurafab cut job", os.getpid(), time.time(), os.getpid()))
    (listed,) = [each for each in Desk.ports() if each["name"] == str(port)]
    assert listed["held"].startswith(f"held by process {os.getpid()} (miurafab cut job), since")
    assert Desk.ports()[-1]["name"] == "virtual"


def test_the_page_offers_what_the_desk_takes():
    page = Path(sys.modules[Studio.__module__].__file__).parent / "page"
    text = (page / "studio.html").read_text()
    for name in ACTIONS:
        assert f'data-do="{name}"' in text
    for name in KEYS:
        assert f'data-key="{name}"' in text
