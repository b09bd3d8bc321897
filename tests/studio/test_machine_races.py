"""The machine from the studio where two things meet: an abort, a late answer, a second page."""

import time
from pathlib import Path

import pytest
from rigs import MACHINE, ROWS, AtMachine, Pumped, until
from studios import sentence

from miurafab.errors import InputError, JobStopped, MachineError
from miurafab.studio import desk, held_session
from miurafab.workflow.cut import prepare

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="needs pseudo-terminals and /proc"
)


@pytest.fixture
def at(tmp_path, monkeypatch):
    """A studio with a job of rows at a bench; its computer has slept ``slept`` seconds."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    job = tmp_path / "rows.nc"
    job.write_text(ROWS)
    (tmp_path / "bench").mkdir()
    slept = [0.0]
    with Pumped() as bench:
        studio = AtMachine(tmp_path / "bench", job, bench.wire.address, asleep=lambda: slept[0])
        studio.bench, studio.slept = bench, slept
        yield studio
        studio.desk.leave()


def session_of(at):
    return at.desk._session


def test_a_start_that_an_abort_overtakes_burns_nothing(at, monkeypatch):
    """The abort falls between the look at the code and the order, before it has disarmed."""
    code = at.ok("arm")["armed"]["code"]
    process = session_of(at).process

    def overtaken(given, wanted):
        process.reset()
        return given == wanted

    with monkeypatch.context() as patch:
        patch.setattr(desk, "same_key", overtaken)
        with pytest.raises(JobStopped, match="aborted before it was begun"):
            at.desk.start(code)
    until(lambda: b"\x18" in at.bench.bytes_came)
    at.until(busy="", state="Idle")
    assert b"M4" not in at.bench.commands
    assert at.seen()["armed"] is None


def test_a_job_that_is_being_read_tells_how_far_it_has_come(at, monkeypatch):
    told = []

    def seen(job, machine=None, on_progress=None):
        on_progress(0.25, "timing rows.nc")
        told.append(at.seen()["reading"])
        return prepare(job, machine=machine, on_progress=on_progress)

    monkeypatch.setattr(desk, "prepare", seen)
    at.ok("job")
    assert told == [{"share": 0.25, "words": "timing rows.nc"}]  # a file is timed once
    assert at.seen()["reading"] is None
    monkeypatch.setattr(desk, "prepare", lambda *_, **__: (_ for _ in ()).throw(InputError("No.")))
    assert sentence(at.ask("job")) == "No."
    assert at.seen()["reading"] is None


def test_what_got_no_answer_is_not_done_later(at, monkeypatch):
    def slow(operator):
        time.sleep(0.8)
        operator.do("say", text="G0X3")

    with monkeypatch.context() as patch:
        patch.setattr(held_session, "_ANSWER_S", 0.2)
        with pytest.raises(MachineError, match="does not answer"):
            at.desk.do(slow)
        assert "does not answer" in sentence(at.ask("jog", x=1, y=0, step=10.0))
    at.ok("say", text="G0X2")
    at.until(busy="", state="Idle")
    assert b"G0X3" not in at.bench.commands
    assert b"$J" not in at.bench.commands
    assert at.bench.commands.count(b"G0X2") == 1


def test_a_page_that_takes_over_while_another_arms_finds_nothing_armed(at, monkeypatch):
    def taken_meanwhile(operator):
        at.desk.take_over()
        return []

    monkeypatch.setattr(desk, "burn_table", taken_meanwhile)
    assert "press 'Take over'" in sentence(at.ask("arm"))
    assert at.seen()["armed"] is None


def test_what_was_armed_before_the_computer_slept_is_not_started(at):
    code = at.ok("arm")["armed"]["code"]
    at.slept[0] = 3600.0
    until(lambda: at.seen()["armed"] is None)
    assert sentence(at.ask("start", code=code)).startswith("Nothing is armed")


def test_a_sheet_that_was_held_when_the_computer_slept_stays_held(at):
    at.start()
    until(lambda: at.bench.device.beam_on)
    at.ok("key", key="hold")
    at.until(state="Hold:0")
    at.slept[0] = 3600.0
    until(lambda: "This computer slept for 3600 s." in at.seen()["said"])
    assert b"\x18" not in at.bench.bytes_came
    at.ok("abort")


def test_an_abort_at_the_end_of_a_session_is_no_fault(at):
    session = session_of(at)
    at.ok("leave")
    session.abort()
    at.ok("abort")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_session_that_cannot_be_ended_well_leaves_room_for_another(at, monkeypatch):
    process = session_of(at).process

    def fails(operator):
        raise RuntimeError("a defect")

    with monkeypatch.context() as patch:
        patch.setattr("miurafab.workflow.at_machine.Operator.close", fails)
        at.ok("leave")
    process.end()
    assert not at.seen()["open"]
    assert "look at the machine" in at.seen()["ended"]
    at.connect()


def test_the_settings_are_compared_once_and_not_at_each_look(at, monkeypatch):
    looks = []
    table = desk.settings_table

    def counted(*told):
        looks.append(told)
        return table(*told)

    monkeypatch.setattr(desk, "settings_table", counted)
    heard = session_of(at).process.heard
    until(lambda: session_of(at).process.heard > heard + 0.5)
    assert len(looks) <= 1


def test_neither_sheet_nor_material_is_changed_under_a_sheet_that_burns(at):
    """The mark of burnt material would be gone at its end, and a wrong sheet counted as done."""
    at.start()
    at.until(busy="cut")
    assert "Wait for the end of 'cut'" in sentence(at.ask("do", action="fresh"))
    assert "Wait for the end of 'cut'" in sentence(at.ask("sheet", number=1))


def test_a_job_that_was_read_for_a_session_that_is_over_comes_to_no_other(at, monkeypatch):
    read = desk.prepare

    def meanwhile(*what, **how):
        monkeypatch.setattr(desk, "prepare", read)
        at.desk.leave()
        at.desk.connect("virtual", MACHINE)
        return read(*what, **how)

    monkeypatch.setattr(desk, "prepare", meanwhile)
    assert "The session has ended" in sentence(at.ask("job"))
    assert at.seen()["job"] is None


def test_a_job_that_was_read_under_another_s_control_is_not_put_on(at, monkeypatch):
    read, before = desk.prepare, at.seen()["job"]

    def meanwhile(*what, **how):
        at.desk.take_over()
        return read(*what, **how)

    monkeypatch.setattr(desk, "prepare", meanwhile)
    assert "press 'Take over'" in sentence(at.ask("job"))
    assert at.seen()["job"] == before
