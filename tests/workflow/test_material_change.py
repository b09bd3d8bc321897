"""No sheet is burnt onto the one before: a person, or the machine, changes the material."""

from __future__ import annotations

import dataclasses
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import pytest
from small_jobs import known_toolpath, write_nc

from miurafab.errors import WAITING, InputError, JobStopped, PersonNeeded
from miurafab.machine.journal import read_journal
from miurafab.machine.keys import NoKeys
from miurafab.machine.planning import SendOptions
from miurafab.machine.sender import session_here
from miurafab.workflow import cut_sheets, multi_machine
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import cut_prepared
from miurafab.workflow.material_change import WAITS, at_pause, needs_person
from miurafab.workflow.multi_machine import share_sheets
from miurafab.workflow.sheet_plans import plan_sheets


@pytest.fixture
def job(tmp_path):
    """Three sheets, all alike, and the folder of their journals."""
    prepared = prepare(str(write_nc(tmp_path, known_toolpath())))
    names = [dataclasses.replace(prepared.jobs[0], name=f"sheet-0{n}.nc") for n in (1, 2, 3)]
    return dataclasses.replace(prepared, jobs=tuple(names), dry_runs=prepared.dry_runs * 3)


def ended(job):
    """How the last run of each sheet ended, as far as one was begun."""
    paths = [(job.folder / name.name).with_suffix(".journal") for name in job.jobs]
    return [read_journal(path)[-1].ended for path in paths if path.exists()]


def test_a_person_is_needed_but_for_machines_that_feed_themselves(job):
    assert needs_person(job, "/dev/ttyUSB0", None)
    assert not needs_person(job, "virtual", None)
    assert not needs_person(job, "/dev/ttyUSB0", False)
    assert needs_person(job, "virtual", True)
    bed = dataclasses.replace(job.machine.bed, roll_fed=True)
    fed = dataclasses.replace(job, machine=dataclasses.replace(job.machine, bed=bed))
    assert not needs_person(fed, "/dev/ttyUSB0", None)
    jobs = [dataclasses.replace(fed.jobs[0], name=f"sheet-01{side}.nc") for side in ("-back", "")]
    assert needs_person(dataclasses.replace(fed, jobs=tuple(jobs)), "/dev/ttyUSB0", None)
    assert at_pause(False, None) == "go on"
    assert at_pause(True, NoKeys()) == at_pause(True, None) == "stop"


def test_where_nobody_is_the_job_ends_after_its_first_sheet_and_says_how_to_go_on(job):
    with pytest.raises(
        PersonNeeded, match=r"Before sheet-02\.nc, put in fresh material; nobody .*'sheet' 2"
    ) as fault:
        cut_prepared(job, port="virtual", pause=True)
    assert fault.value.exit_code == WAITING
    assert ended(job) == ["done"]
    (done,) = cut_prepared(job, port="virtual", sheets=[2], pause=True)
    assert ended(job) == ["done", "done"]
    assert done.result.lines > 0


@pytest.fixture
def both_sides(job):
    """The back and the front of one sheet, and the next."""
    names = ("sheet-01-back.nc", "sheet-01.nc", "sheet-02.nc")
    jobs, seen = (
        tuple(dataclasses.replace(each, name=name) for each, name in zip(of, called, strict=True))
        for of, called in ((job.jobs, names), (job.dry_runs, [name[:-3] for name in names]))
    )
    jobs = tuple(dataclasses.replace(each, text=f"({each.name})\n{each.text}") for each in jobs)
    return dataclasses.replace(job, jobs=jobs, dry_runs=seen)


def test_a_sheet_that_is_worked_from_both_sides_is_turned_over_in_between(both_sides):
    with pytest.raises(PersonNeeded, match=r"Before sheet-01\.nc, turn the sheet over, left to r"):
        cut_prepared(both_sides, port="virtual", pause=True)
    with pytest.raises(PersonNeeded, match=r"Before sheet-02\.nc, put in fresh material"):
        cut_prepared(both_sides, port="virtual", sheets=[2, 3], pause=True)
    with pytest.raises(PersonNeeded, match=r"Before sheet-01\.nc, put in the sheet whose back is"):
        cut_prepared(both_sides, port="virtual", sheets=[3, 2], pause=True)
    plans = dict(plan_sheets(both_sides, None, CutOptions()))
    assert [plan.back for plan in plans.values()] == [None, both_sides.jobs[0].sha256, None]


def test_a_machine_that_feeds_itself_asks_for_the_other_side_alone(both_sides, monkeypatch):
    def apart(machine, port, name, *, keys, virtual_speed):
        return session_here(machine, "virtual", name, keys=keys)

    monkeypatch.setattr(cut_sheets, "session_apart", apart)
    bed = dataclasses.replace(both_sides.machine.bed, roll_fed=True)
    machine = dataclasses.replace(both_sides.machine, bed=bed)
    fed = dataclasses.replace(both_sides, machine=machine)
    for pause, wanted in ((None, [2]), (True, [2, 3])):
        asked = []
        cut_prepared(
            fed,
            port="/dev/ttyUSB0",
            pause=pause,
            before_sheet=lambda number, _, asked=asked: asked.append(number),
        )
        assert asked == wanted


def test_the_two_sides_of_a_sheet_are_not_shared_out(both_sides, job):
    whole = SimpleNamespace(most_power=1.0, edits=())
    for ports, prepared, why in (
        (["A", "B"], dataclasses.replace(both_sides, directory=whole), "from both sides"),
        (["A", "B", "A"], dataclasses.replace(job, directory=whole), "port A is named twice"),
        (["A", "B"], job, "is no job directory, so machines cannot share it"),
    ):
        with pytest.raises(InputError, match=why):
            share_sheets(prepared, ports, None, CutOptions(), on_progress=lambda *a: None)


def test_the_person_is_asked_before_each_further_sheet(job):
    asked = []
    cut_prepared(
        job,
        port="virtual",
        pause=True,
        before_sheet=lambda *which: asked.append((which, ended(job))),
    )
    assert asked == [((2, 3), ["done"]), ((3, 3), ["done", "done"])]


def test_a_resumed_job_asks_too(job):
    """Sheet 1 goes on where it is; sheets 2 and 3 need other material."""
    cut_prepared(job, port="virtual", sheets=[1])
    journal = job.folder / "sheet-01.journal"
    lines = journal.read_text().splitlines(keepends=True)
    journal.write_text("".join(lines[: len(lines) // 2]))
    options = CutOptions(send=SendOptions(at=(0.0, 0.0)), resume=True)
    with pytest.raises(PersonNeeded, match=r"Before sheet-02\.nc, put in fresh material"):
        cut_prepared(job, port="virtual", options=options, pause=True)
    asked = []
    cut_prepared(
        job,
        port="virtual",
        options=options,
        pause=True,
        before_sheet=lambda number, count: asked.append(number),
    )
    assert asked == [2, 3]
    assert ended(job) == ["done"] * 3


def test_whoever_resumes_at_a_sheet_that_was_not_begun_has_put_it_in(job):
    cut_prepared(job, port="virtual", sheets=[1])
    options = CutOptions(send=SendOptions(at=(0.0, 0.0)), resume=True)
    with pytest.raises(PersonNeeded, match=r"Before sheet-03\.nc, put in fresh material"):
        cut_prepared(job, port="virtual", options=options, pause=True)
    assert ended(job) == ["done", "done"]


def test_where_nobody_looks_at_a_frame_nothing_is_cut(job):
    options = CutOptions(send=SendOptions(at=(0.0, 0.0)), frame=True)
    with pytest.raises(PersonNeeded, match=r"frame of sheet-01\.nc is traced, and nobody") as fault:
        cut_prepared(job, port="virtual", options=options, pause=True)
    assert fault.value.exit_code == WAITING
    assert ended(job) == []
    looked = []
    cut_prepared(
        job, port="virtual", sheets=[1], options=options, pause=True, after_frame=looked.append
    )
    assert (looked, ended(job)) == ([1], ["done"])
    cut_prepared(job, port="virtual", sheets=[2], options=options, pause=False)
    assert ended(job) == ["done", "done"]


@pytest.mark.parametrize("ready", [{"A", "B"}, {"B"}, set()])
def test_machines_that_share_a_job_wait_each_for_its_material(job, monkeypatch, ready):
    opened = []

    def apart(machine, port, name, *, signals, virtual_speed):
        opened.append(port)
        return session_here(machine, "virtual", name, signals=signals)

    monkeypatch.setattr(multi_machine, "session_apart", apart)
    monkeypatch.setattr(multi_machine, "StopSignals", lambda: NoSignals())
    job = dataclasses.replace(job, directory=SimpleNamespace(most_power=1.0, edits=()))
    asked = []

    def before(number, port, signals):
        asked.append((number, port))
        return port in ready

    outcome = share_sheets(
        job, ["A", "B"], None, CutOptions(), before_sheet=before, on_progress=lambda *a: None
    )
    cut = [each for each in outcome if each.done]
    ports = [each.port for each in cut]
    firsts = set(ports)
    assert len(cut) == (3 if ready & firsts or ready == {"A", "B"} else len(firsts))
    assert all(each.why == WAITS for each in outcome if not each.done)
    # Each machine cut one sheet unasked; for each other sheet somebody said that it is in.
    assert len([a for a in asked if a[1] in ready]) == len(cut) - len(firsts)
    assert sorted(opened) == ["A", "B"]


def test_a_machine_that_resumes_a_shared_job_asks_before_a_sheet_that_was_not_begun(
    job, monkeypatch
):
    """The sheet of before may lie in it, burnt."""
    cut_prepared(job, port="virtual", sheets=[1])

    def apart(machine, port, name, *, signals, virtual_speed):
        return session_here(machine, "virtual", name, signals=signals)

    monkeypatch.setattr(multi_machine, "session_apart", apart)
    monkeypatch.setattr(multi_machine, "suspending_signals", NoSignals)
    job = dataclasses.replace(job, directory=SimpleNamespace(most_power=1.0, edits=()))
    options = CutOptions(send=SendOptions(at=(0.0, 0.0)), resume=True)
    asked = []

    def before(number, port, signals):
        asked.append(number)
        return False

    outcome = share_sheets(
        job, ["A"], None, options, before_sheet=before, on_progress=lambda *a: None
    )
    assert (asked, [each.why for each in outcome]) == ([2], [WAITS, WAITS])
    assert ended(job) == ["done"]
    share_sheets(job, ["A"], None, options, on_progress=lambda *a: None)
    assert ended(job) == ["done", "done"]  # nobody to ask: who began it has put it in


class NoSignals:
    """Signals that never come; threads of a test cannot catch any."""

    caught = None
    at_once = False

    def __enter__(self):
        return self

    def __exit__(self, *why):
        pass

    def raising(self):
        return nullcontext()

    def check(self):
        pass

    def hold(self):
        pass


def test_after_ctrl_c_no_machine_takes_another_sheet(job, monkeypatch):
    class Interrupted(NoSignals):
        reason = "Ctrl-C"

        @property
        def caught(self):
            return "SIGINT" if ended(job) else None

    def apart(machine, port, name, *, signals, virtual_speed):
        return session_here(machine, "virtual", name, signals=NoSignals())

    monkeypatch.setattr(multi_machine, "session_apart", apart)
    monkeypatch.setattr(multi_machine, "suspending_signals", Interrupted)
    job = dataclasses.replace(job, directory=SimpleNamespace(most_power=1.0, edits=()))
    with pytest.raises(JobStopped, match="Ctrl-C"):
        share_sheets(job, ["A"], None, CutOptions(), pause=False, on_progress=lambda *a: None)
    assert ended(job) == ["done"]


@pytest.mark.parametrize("name", ["align", "from_stroke"])
def test_what_is_said_of_one_sheet_is_not_said_to_several_machines(job, name):
    job = dataclasses.replace(job, directory=SimpleNamespace(most_power=1.0, edits=()))
    marks = (((0.0, 0.0), (1.0, 1.0)), ((200.0, 200.0), (201.0, 201.0)))
    options = CutOptions(**{name: {"align": marks, "from_stroke": 2}[name]})
    with pytest.raises(InputError, match=f"'{name}' is said of a sheet .* name its 'port' alone"):
        share_sheets(job, ["A", "B"], None, options, on_progress=lambda *a: None)


def test_each_of_several_machines_begins_where_its_head_stands(job, monkeypatch):
    seen, told = {}, []

    class Recorded:
        def __init__(self, session, port):
            self.waits, self.load, self._session, self._port = (
                session.waits,
                session.load,
                session,
                port,
            )

        def cut(self, plan, **files):
            seen.setdefault(self._port, []).append(plan.at)
            return self._session.cut(plan, **files)

    @contextmanager
    def apart(machine, port, name, *, signals, virtual_speed):
        with session_here(machine, "virtual", name, signals=signals) as session:
            yield Recorded(session, port)

    monkeypatch.setattr(multi_machine, "session_apart", apart)
    monkeypatch.setattr(multi_machine, "StopSignals", lambda: NoSignals())
    job = dataclasses.replace(job, directory=SimpleNamespace(most_power=1.0, edits=()))
    share_sheets(
        job,
        ["A", "B"],
        None,
        CutOptions(send=SendOptions(at="front-left")),
        pause=False,
        on_start=lambda port, finding: told.append((port, finding.code)),
        on_progress=lambda *a: None,
    )
    # The box begins at 3,4; the program ends at its origin.
    assert {places[0] for places in seen.values()} == {(3.0, 4.0)}
    assert {place for places in seen.values() for place in places[1:]} == {(0.0, 0.0)}
    assert sorted(told) == [(port, "head") for port in sorted(seen)]
