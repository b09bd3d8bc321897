"""What each part of the studio does at its edges: nothing there, too much, an end in between."""

import contextlib
import http.client
import io
import json
import os
import sys
import threading
import time
from dataclasses import asdict, replace
from socketserver import BaseServer
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from problems import regular
from small_jobs import known_toolpath, write_nc
from studios import Waiting, saddle_obj, sentence

import miurafab
from miurafab.errors import InputError, MachineError, PortError
from miurafab.fabrication.options import LayoutOptions
from miurafab.machine.session_process import Outcome
from miurafab.profiles import load_machine, load_material
from miurafab.studio import bed_words, held_session, live_worker, server, worker
from miurafab.studio.desk import ArmedSheet, Desk
from miurafab.studio.desk_view import sheet_drawing
from miurafab.studio.glance import Glances
from miurafab.studio.held_session import HeldSession
from miurafab.studio.machine_words import box_words
from miurafab.studio.mends import mends
from miurafab.studio.work import Order, carry_out, failure
from miurafab.workflow.cut import prepare
from miurafab.workflow.report_text import layout_lines

LASER, KNIFE = load_machine("grbl-laser-400"), load_machine("grbl-knife-a3")
CARD = load_material("card-250")
LAYOUT = {"machine": LASER.name, "material": CARD.name, "options": {}}
NONE = {"facets": "4x4", "polish": "off", "timeout": "0.000001"}


# Words


def test_the_words_of_a_plan_on_several_sheets(tmp_path, monkeypatch):
    pattern = regular(5, 5).scaled(20)
    pattern.save(tmp_path / "large.fold")
    glances, asked = Glances(), {"file": str(tmp_path / "large.fold"), "layout": LAYOUT}
    told = glances.answer(asked | {"do": "plan"}, None)["bed"]
    assert told["title"].endswith(" of glue")
    assert " patches; at " in told["remark"]
    assert told["mark"] == "more"
    (tmp_path / "large.fold").unlink()  # it is read once
    report = {"status": "converged", "hausdorff_mm": 4.0, "facets": 16}
    small = glances.answer(asked | {"do": "scale", "size": "100mm", "report": report}, None)
    assert max(small["box_mm"]) == 100.0
    assert small["bed"]["title"] == "One sheet, no glue"
    monkeypatch.setattr(bed_words, "LARGE", 15)
    given = (pattern, LASER, CARD, LayoutOptions())
    assert bed_words.planned(*given) == bed_words.at_once(*given)


@pytest.mark.parametrize("grain", ["none", "x", "y"])
def test_a_pattern_is_drawn_on_its_sheet_however_it_lies(grain):
    """A card with a grain allows only some turns."""
    card = replace(CARD, grain=grain)
    flat = regular(9, 3).vertices_coords
    for turned in (flat, flat @ np.array([[0.0, 1.0], [-1.0, 0.0]])):
        pattern = replace(regular(9, 3), vertices_coords=turned)
        drawn = bed_words.at_once(pattern, KNIFE, card, LayoutOptions())
        border = np.array(drawn["border"]).reshape(-1, 2)
        assert (np.ptp(border, axis=0) <= np.array(drawn["sheet"]) + 0.1).all()


def test_what_is_not_there_is_not_told():
    job = miurafab.sheets(regular(3, 3))
    totals = asdict(job.layout.totals)
    assert [
        line["name"] for line in layout_lines(totals | {"seconds": None, "border_tabs": 0})
    ] == [*("Sheets", "Patches", "Cut", "Creases", "Travel")]
    told = {line["name"]: line["value"] for line in layout_lines(totals | {"border_tabs": 3})}
    assert told["On open borders"] == "3 tabs"
    assert box_words(None) == "nothing"
    assert mends("Give `poles` on the surface.") == [{"option": "poles", "value": None}]


def test_what_a_process_cannot_do_is_one_sentence():
    assert failure(MemoryError()).endswith("not enough memory for that; ask for fewer `facets`.")
    assert failure(OSError(28, "No space left")) == (
        "A file could not be read or written: No space left."
    )
    assert failure(InputError("It is flat.")) == "It is flat."


def test_a_fit_without_a_sheet_is_a_report_without_files(tmp_path):
    told = []
    carry_out(Order("fit", tmp_path, "hypar", target="hypar", options=NONE), told.append)
    (part,) = [news for news in told if "part" in news]
    assert (part["files"], part["report"]["status"]) == ({}, "stalled")
    assert list(tmp_path.iterdir()) == []


# Addresses


def test_an_answer_that_is_an_error_names_fields_by_their_labels(asked):
    asked.studio.live = SimpleNamespace(answer=lambda number: {"error": "Ask for fewer `facets`."})
    said = asked.get("live/3").json()["said"]
    assert said == {"error": "Ask for fewer 'Facets'."}


def test_a_machine_has_no_other_addresses_and_needs_a_job(asked):
    assert "takes no such request" in sentence(asked.post("machine/dance", {}), 404)
    with pytest.raises(InputError, match="job"):
        asked.studio._put_on()


def test_a_target_that_cannot_be_placed_is_refused_once(asked):
    source = asked.upload("saddle.obj", saddle_obj()).json()["source"]
    shown = asked.post("target", {"target": {"source": source}, "options": {}}).json()
    assert shown["picture"] is not None
    asked.orders[-1].coming = [{"error": "It is too thin."}]
    more = f"target/{shown['more']}"
    assert asked.get(more).json() == {"refused": "It is too thin.", "mends": []}
    assert asked.orders[-1].stopped
    assert asked.get(more).json() == {"refused": "It is too thin.", "mends": []}


# The desk


def test_a_job_is_timed_on_the_machine_that_is_there(tmp_path):
    miurafab.sheets(regular(3, 3)).write(tmp_path / "job")
    other = load_machine("grblhal-laser-600")
    desk = Desk()
    there, meant = (desk._read(tmp_path / "job", machine) for machine in (other, LASER))
    assert (there.machine, meant.machine) == (other, LASER)
    assert there.dry_runs[0].seconds != meant.dry_runs[0].seconds


def test_what_was_armed_long_ago_is_not_started():
    desk = Desk()
    desk._armed = ArmedSheet("code", time.monotonic() - 1.0, [], 0)
    with pytest.raises(InputError, match="arm"):
        desk.start("code")
    with pytest.raises(InputError, match=r"Nothing is armed"):
        desk.start("code")
    with pytest.raises(InputError, match="There is no such sheet"):
        desk.drawing(1)


def test_of_very_many_strokes_the_first_are_drawn(tmp_path, monkeypatch):
    (sheet,) = prepare(write_nc(tmp_path, known_toolpath())).dry_runs
    whole = sheet_drawing(sheet)
    assert len(whole["strokes"]) == whole["all"] == 4
    monkeypatch.setattr("miurafab.studio.desk_view._MOST_POINTS", 5)
    part = sheet_drawing(sheet)
    assert (part["strokes"], part["all"]) == (whole["strokes"][:2], 4)


class Failing:
    """A process whose port cannot be opened."""

    death = "ended with code 0"

    def __init__(self, *given):
        self.resets = self.asked = 0
        self.over, self.state, self.ended = False, None, False
        self._messages = [Outcome("open", error=PortError("The port x does not exist."))]

    def order(self, action, **options):
        pass

    def poll(self):
        return self._messages.pop() if self._messages else None

    def stop(self):
        pass

    def close(self):
        self.ended = True

    end = close


@pytest.fixture
def held(monkeypatch):
    """A session at such a process, and how it ended."""
    monkeypatch.setattr(held_session, "DeskProcess", Failing)
    told = []

    def begin():
        session = HeldSession(LASER, "x", on_look=lambda operator: None, on_end=told.append)
        session._thread.join(20)
        return session, told

    return begin


def test_a_port_that_does_not_open_ends_the_session_with_its_sentence(held):
    session, told = held()
    assert told == ["The port x does not exist."]
    assert session.process.ended
    with pytest.raises(MachineError):
        session.ask(lambda operator: None)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_defect_in_the_thread_of_a_session_ends_it_dark(held, monkeypatch):
    def broken(*given):
        raise RuntimeError("defect")

    monkeypatch.setattr(held_session, "Operator", broken)
    session, told = held()
    assert told == [held_session.FAILED]
    assert session.process.ended


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_defect_in_what_was_asked_is_told_and_ends_it_dark(held, monkeypatch):
    monkeypatch.setattr(Failing, "poll", lambda self: time.sleep(0.001))
    monkeypatch.setattr(threading.Thread, "join", lambda self, seconds=None: None)
    session, told = held()
    monkeypatch.undo()
    with pytest.raises(ZeroDivisionError):
        session.ask(lambda operator: 1 / 0)
    session._thread.join(20)
    assert told == [held_session.FAILED]
    assert session.process.ended


# The processes


@pytest.fixture
def exits(monkeypatch):
    """The exit codes with which a process would have ended itself at once."""
    codes, there = [], threading.Event()

    def leave(code):
        codes.append(code)
        there.set()

    monkeypatch.setattr(os, "_exit", leave)
    return SimpleNamespace(codes=codes, wait=lambda: there.wait(20))


def test_of_several_questions_the_last_is_answered_and_the_end_is_the_end(exits, monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"number": 1}\n{"number": 2}\n'))
    questions = live_worker._Questions()
    assert exits.wait()
    assert exits.codes == [0]
    assert questions.next() == {"number": 2}
    questions.check(0.5, "")
    questions._last = {"number": 3}
    with pytest.raises(live_worker._OvertakenError):
        questions.check(0.6, "")


def test_a_question_is_waited_for(exits, monkeypatch):
    read, write = os.pipe()
    with os.fdopen(read) as stdin, os.fdopen(write, "w") as typed:
        monkeypatch.setattr(sys, "stdin", stdin)
        questions = live_worker._Questions()
        found = []
        asking = threading.Thread(target=lambda: found.append(questions.next()))
        asking.start()
        typed.write('{"number": 4}\n')
        typed.close()
        asking.join(20)
        assert found == [{"number": 4}]
        assert exits.wait()


def test_each_question_has_its_answer_or_its_error(monkeypatch):
    class Over(Exception):
        pass

    class Asking:
        check = None

        def __init__(self):
            self.left = [4, 3, 2, 1]

        def next(self):
            if not self.left:
                raise Over
            return {"number": self.left.pop()}

    class Answering:
        def answer(self, asked, check):
            if asked["number"] == 1:
                return {"it": 1}
            faults = (live_worker._OvertakenError(), InputError("It is flat."), MemoryError())
            raise faults[asked["number"] - 2]

    told = []
    monkeypatch.setattr(live_worker, "_Questions", Asking)
    monkeypatch.setattr(live_worker, "Glances", Answering)
    monkeypatch.setattr(live_worker, "answering", lambda: contextlib.nullcontext(told.append))
    with pytest.raises(Over):
        live_worker.main()
    assert told[:2] == [
        {"number": 1, "answer": {"it": 1}},
        {"number": 3, "error": "It is flat."},
    ]
    assert told[2]["error"].startswith("This computer has not enough memory")


@pytest.mark.parametrize(
    ("code", "lines", "why"),
    [
        ("import sys; print('{\"a\": 1}'); sys.exit('a\\n\\nboom.')", [{"a": 1}], "boom"),
        ("print('{\"a\": ')", [], "status 0"),
        ("raise SystemExit(3)", [], "status 3"),
    ],
)
def test_a_process_that_ends_by_itself_is_told_by_its_last_words(monkeypatch, code, lines, why):
    command = [sys.executable, "-S", "-c", code]
    monkeypatch.setattr(worker, "python_command", lambda module: command)
    came, ended = [], []
    piped = worker.Piped("x", came.append, ended.append)
    piped._answers.join(20)
    piped.stop()
    assert came == lines
    assert ended == [f"The computation ended unexpectedly ({why})."]
    assert worker._unexpected(-9, "") == (
        "The system ended the computation, probably because memory ran out."
    )


def test_a_worker_ends_with_the_studio(exits, monkeypatch):
    coming = [b"order\n", b"more", b""]
    monkeypatch.setattr(os, "read", lambda descriptor, size: coming.pop(0))
    worker._end_with_studio()
    assert (coming, exits.codes) == ([], [1])


# The server


def test_a_pattern_of_the_command_line_is_opened_the_door_opens_and_the_room_is_bounded(
    tmp_path, monkeypatch, capsys
):
    """One server, in this process: its loop runs in a thread while it is asked."""
    regular(3, 3).save(tmp_path / "own.fold")
    orders, told, loop = [], [], BaseServer.serve_forever

    def start(order):
        orders.append(Waiting(order))
        return orders[-1]

    def ask(running, method, path, body=None, **headers):
        wire = http.client.HTTPConnection("127.0.0.1", running.server_port, timeout=20)
        with contextlib.closing(wire):
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            wire.request(method, path, body, named)
            answer = wire.getresponse()
            return answer.status, answer.headers.get("Location", ""), answer.read()

    def serving(running, poll_interval):
        thread = threading.Thread(target=loop, args=(running, 0.01))
        thread.start()
        try:
            door = running.door.file.read_text()
            path = door.partition("http://")[2].partition('"')[0].partition("/")[2]
            told.append(ask(running, "GET", f"/{path}"))
            key = urlsplit(told[0][1]).path.strip("/")
            origin = f"http://127.0.0.1:{running.server_port}"
            with running.room.kept(0):
                monkeypatch.setattr("miurafab.studio.guard.BODY_BYTES", 0)
                body = b"x" * 100_000
                named = {"Origin": origin, "X_Studio_Key": key, "X_File_Name": "a.obj"}
                told.append(ask(running, "POST", f"/{key}/upload", body, **named))
        finally:
            running.shutdown()
            thread.join()

    monkeypatch.setattr(server, "Process", start)
    monkeypatch.setattr(server.webbrowser, "open", lambda page: None)
    monkeypatch.setattr(server._Server, "serve_forever", serving)
    server.serve(str(tmp_path / "own.fold"), announce=lambda address, known: None)
    assert [(each.order.do, each.order.name) for each in orders] == [("open", "own")]
    (status, place, _), (full, _, why) = told
    assert (status, full) == (303, 503)
    assert place
    assert json.loads(why) == {"error": "Too much is being sent at once; try again in a moment."}
    assert capsys.readouterr().err == ""


def test_other_faults_of_a_request_are_one_line(capsys):
    for fault in (ConnectionResetError(), TimeoutError(), ValueError("odd")):
        try:
            raise fault
        except (OSError, ValueError):
            server._Server.handle_error(None, None, None)
    assert capsys.readouterr().err == "miurafab: a request failed (ValueError: odd).\n"
