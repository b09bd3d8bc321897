"""A job interrupted anywhere goes on: nothing is left out, and only what was stated burns twice."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from dashes import STROKES, burnt, dashes
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from wires import FakeWire

from miurafab.errors import GcodeError, InputError, JobStopped, MachineError
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import strokes
from miurafab.machine.journal import JournalRun, read_journal
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.resume import Resumption, from_stroke, resume
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
KINDS = ("disconnect", "reset", "interrupt", "power", "alarm", "hang")


def new_device(*faults: str) -> VirtualGrbl:
    settings = virtual_settings(MACHINE)
    return VirtualGrbl(settings, baud=MACHINE.controller.baud, faults=parse_faults(faults))


def run(
    job: Job, wire: FakeWire, journal: Path | None, resumption: Resumption | None = None
) -> None:
    """One run on a machine whose head stands at the origin of the job."""
    plan = plan_job(job, MACHINE, SendOptions(at=(0.0, 0.0)), resumption=resumption)
    deliver(plan, wire, StopSignals(), journal_path=journal)


def struck(kind: str, at: float) -> FakeWire:
    """A wire to a controller on which a run ends so at ``at`` s of the controller's time."""
    if kind != "interrupt":
        return FakeWire(new_device(f"{kind}@{at:.6f}s"))

    def before_call(call: int) -> None:
        if wire.device.now >= at:
            wire.before_call = lambda call: None
            raise KeyboardInterrupt

    wire = FakeWire(new_device(), before_call=before_call)
    return wire


def interrupted_and_resumed(
    job: Job, kinds: list[tuple[str, float]], tmp_path: Path
) -> tuple[Counter[int], list[Resumption]]:
    journal = tmp_path / "journal"
    journal.unlink(missing_ok=True)
    devices: list[VirtualGrbl] = []
    rests: list[Resumption] = []
    rest = None
    for kind, at in kinds:
        wire = struck(kind, at)
        devices.append(wire.device)
        with pytest.raises((MachineError, JobStopped)):
            run(job, wire, journal, rest)
        wire.settle(5.0)
        assert not wire.device.beam_on
        # A firmware that hangs in mid-move waits its step idle delay ($1) with the beam on.
        standing = standing_seconds(wire.device.beam_log)
        assert standing <= (0.026 if kind == "hang" else 0.0)
        rest = resume(job, MACHINE, read_journal(journal))
        rests.append(rest)
    wire = FakeWire(new_device())
    devices.append(wire.device)
    run(job, wire, journal, rest)
    assert read_journal(journal)[-1].ended == "done"
    with pytest.raises(InputError, match="nothing is left"):
        resume(job, MACHINE, read_journal(journal))
    return burnt(job, [device.beam_log for device in devices]), rests


@cache
def stroke_ends(style: str) -> list[float]:
    """When each stroke ends in an undisturbed run, on the controller's clock."""
    wire = FakeWire(new_device())
    run(dashes(style), wire, None)
    ends = {(round(s.y1), int((s.x1 - 4.98) // 3)): s.t1 for s in wire.device.beam_log}
    return list(ends.values())


def check(job: Job, kinds: list[tuple[str, float]], tmp_path: Path) -> None:
    counts, rests = interrupted_and_resumed(job, kinds, tmp_path)
    missing = [index for index in range(STROKES) if counts[index] == 0]
    assert missing == [], (kinds, rests)
    stated = {n for rest in rests for n in range(rest.stroke, rest.new_stroke)}
    twice = {n % 1000 for n, c in counts.items() if c > 1 or n >= 1000}
    assert twice <= stated, (kinds, rests)
    for rest in rests:
        # 21 moves, and what 128 bytes hold of the shortest lines: 11 and 9 strokes.
        assert rest.new_stroke - rest.stroke <= 21


@pytest.mark.parametrize("style", ["absolute", "relative"])
@pytest.mark.parametrize("first", [0, 1, 2, 50, 121, 198, 199])
def test_a_fault_after_a_stroke(style: str, first: int, tmp_path: Path) -> None:
    job = dashes(style)
    ends = stroke_ends(style)
    assert len(ends) == STROKES
    check(job, [(KINDS[first % 6], ends[first] + 0.001)], tmp_path)


@pytest.mark.parametrize("style", ["absolute", "relative"])
@given(at=st.floats(0.3, 11.0), kind=st.sampled_from(KINDS))
@settings(max_examples=10, phases=[Phase.generate])
def test_a_fault_at_any_moment(style: str, at: float, kind: str) -> None:
    with TemporaryDirectory() as folder:
        check(dashes(style), [(kind, at)], Path(folder))


@pytest.mark.large
@pytest.mark.parametrize("style", ["absolute", "relative"])
@given(at=st.floats(0.3, 11.0), kind=st.sampled_from(KINDS))
@settings(max_examples=400, phases=[Phase.generate])
def test_a_fault_at_very_many_moments(style: str, at: float, kind: str) -> None:
    with TemporaryDirectory() as folder:
        check(dashes(style), [(kind, at)], Path(folder))


@pytest.mark.large
@pytest.mark.parametrize("style", ["absolute", "relative"])
def test_a_fault_after_every_stroke(style: str, tmp_path: Path) -> None:
    job = dashes(style)
    for index, end in enumerate(stroke_ends(style)):
        for kind in KINDS if index % 10 == 0 else (KINDS[index % 6],):
            check(job, [(kind, end + 0.001)], tmp_path)


class Killed(BaseException):
    """The sender is killed: it says no last word, neither to the wire nor to the journal."""


def killed(job: Job, at: float, lag: float, journal: Path) -> FakeWire:
    """A run whose sender is killed ``at`` s, with a journal that is ``lag`` s behind."""

    def before_call(call: int) -> None:
        if wire.device.now >= at:
            raise Killed

    wire = FakeWire(new_device(), before_call=before_call)
    with pytest.raises(Killed):
        run(job, wire, journal)
    wire.device.advance(5.0)  # the controller makes what it has
    lines = journal.read_text().splitlines(keepends=True)
    records = [json.loads(line) if line.strip() else {} for line in lines]
    last = max((record.get("seconds", 0.0) for record in records), default=0.0)
    known = [
        line
        for line, record in zip(lines, records, strict=True)
        if "ended" not in record and record.get("seconds", 0.0) <= last - lag
    ]
    journal.write_text("".join(known))
    return wire


@pytest.mark.parametrize("style", ["absolute", "relative"])
@given(at=st.floats(0.5, 11.0), lag=st.sampled_from([0.0, 0.3, 0.7]))
@settings(max_examples=6, phases=[Phase.generate])
def test_what_a_killed_sender_left_is_stated(style: str, at: float, lag: float) -> None:
    job = dashes(style)
    with TemporaryDirectory() as folder:
        journal = Path(folder) / "journal"
        wire = killed(job, at, lag, journal)
        rest = resume(job, MACHINE, read_journal(journal))
        again = FakeWire(new_device())
        run(job, again, journal, rest)
    counts = burnt(job, [wire.device.beam_log, again.device.beam_log])
    assert all(counts[n] for n in range(STROKES)), rest
    twice = {n % 1000 for n, c in counts.items() if c > 1 or n >= 1000}
    assert twice <= set(range(rest.stroke, rest.new_stroke)), rest


def test_what_is_stated_after_a_kill_is_what_the_machine_can_have_made() -> None:
    """80 strokes of 10 mm at 3000 mm/min, cut down after the 30th: not all that a wire carries."""
    text = "M4 S0\n" + "".join(f"G0 X5 Y{n}\nG1 X15 S500 F3000\n" for n in range(80)) + "M5\n"
    job = Job("dashes.nc", text)
    left = JournalRun(job.name, job.sha256, MACHINE.name, "p", 162, taken=61, line=61)
    rest = resume(job, MACHINE, [left])
    assert rest.stroke == 19
    # In a second at most 7 strokes of 0.1 s, with rapids; 21 moves held, and 128 bytes.
    assert 30 + 5 + 10 <= rest.new_stroke <= 30 + 7 + 11 + 6


def test_a_resumed_job_is_interrupted_again(tmp_path: Path) -> None:
    job = dashes("absolute")
    ends = stroke_ends("absolute")
    kinds = [
        ("disconnect", ends[60]),
        ("power", ends[3]),
        ("interrupt", ends[40]),
        ("reset", ends[0]),
    ]
    check(job, kinds, tmp_path)


def test_the_modes_are_those_of_the_whole(tmp_path: Path) -> None:
    """The rest alone, read back, burns exactly what the whole burns from its stroke on."""
    for style in ("absolute", "relative"):
        job = dashes(style)
        whole = strokes(parse_program(job))
        made = replace(record(job), line=260, taken=260)
        rest = resume(job, MACHINE, [made])
        again = strokes(parse_program(rest.job))
        assert len(again) == rest.strokes - rest.stroke
        for index in range(len(again)):
            assert again.stroke(index) == pytest.approx(whole.stroke(rest.stroke + index), abs=1e-3)
        first, second = parse_program(job), parse_program(rest.job)
        tail = first.line >= rest.line
        for name in ("motion", "feed_mm_min", "power", "spindle", "line"):
            theirs = getattr(second, name)[second.line >= rest.line]
            assert (theirs == getattr(first, name)[tail]).all(), name
        assert "M8" in rest.job.text


def test_every_mode_is_brought_back_by_name() -> None:
    """Inches, both kinds of air, the height, the plane and the motion mode of the line before."""
    head = "G90\n(blank)\n\n\n\n\n\n\nM7\nM8\nM3 S0\nG0 Z-2\n"
    rows = [f"G21 G0 X{n} Y5\nG1 X{n + 0.5} S300 F900\nG20\nG0 S0\n" for n in range(60)]
    job = Job("modes.nc", "".join([head, *rows, "M5\n"]))
    rest = resume(job, MACHINE, [record(job, line=180, taken=180)])
    preamble = rest.job.text[: rest.job.text.index("\n\n")].splitlines()
    assert preamble[:2] == ["G21G90G17G94M5", f"G0X{rest.stroke}.0000Y5.0000"]
    assert preamble[2:] == ["G0Z-2.0000", "M8", "M7", "M3S0F900.0000", "G21G90G17", "G0"]
    whole, again = strokes(parse_program(job)), strokes(parse_program(rest.job))
    for index in range(len(again)):
        assert again.stroke(index) == pytest.approx(whole.stroke(rest.stroke + index), abs=1e-3)


def test_strokes_that_hang_together_are_taken_up_where_the_first_begins() -> None:
    """Between them is no travel: a rest that began at a later one would begin with the beam on."""
    chain = "".join(f"(patch {n})\nG1 X{12 + 2 * n} S500 F3000\n" for n in range(100))
    head = "G21\nG90\nM4 S0\n" + "".join(f"G0 X{n} Y{n}\n" for n in range(10))
    job = Job("chain.nc", f"{head}G1 X9.5 S500 F3000\nG0 X10 Y5\n{chain}M5\n")
    whole = parse_program(job)
    assert len(strokes(whole)) == 101
    rest = resume(job, MACHINE, [record(job, line=200, taken=200)])
    assert (rest.stroke, rest.line) == (1, 16)
    assert not parse_program(rest.job).beam_on[0]
    assert rest.new_stroke > 90
    assert "strokes 2 to " in rest.finding.sentence


def test_a_rest_is_the_whole_where_nothing_can_stand_before_it() -> None:
    bare = Job("bare.nc", "M4 S500 G1 X5 F600\n" + "G0 X9\nG1 X5\n" * 50 + "M5\n")
    rest = resume(bare, MACHINE, [record(bare)])
    assert (rest.line, rest.stroke, rest.job.text) == (1, 0, bare.text)
    travels = "".join(f"G0 X{n} Y{n % 7}\n" for n in range(80))
    late = Job("late.nc", f"M4 S0\n{travels}G1 X5 S500 F600\nM5\n")
    rest = resume(late, MACHINE, [record(late, line=2, taken=2)])
    assert rest.finding.sentence.endswith("; no stroke is burnt twice.")


def record(job: Job, **changes: object) -> JournalRun:
    made = JournalRun(job.name, job.sha256, MACHINE.name, "virtual", job.line_count)
    return replace(made, ended="failed", **changes)


def test_twenty_one_moves_back_or_as_many_as_the_controller_plans() -> None:
    job = dashes("absolute")
    moved = parse_program(job).line
    # The travel to the stroke, the first of these moves, is made by the modes brought back.
    stock = resume(job, MACHINE, [record(job, line=204, taken=204)])
    deep = resume(job, MACHINE, [record(job, line=204, taken=204, blocks=100)])
    assert (moved <= 204).sum() - (moved < stock.line).sum() >= 21 - 1
    assert (moved <= 204).sum() - (moved < deep.line).sum() >= 106 - 1


def test_a_sender_that_died_may_have_sent_more_than_it_wrote_down() -> None:
    job = dashes("absolute")
    told = resume(job, MACHINE, [record(job, line=100, taken=100)])
    silent = resume(job, MACHINE, [replace(record(job, line=100, taken=100), ended=None)])
    assert silent.stroke == told.stroke
    assert silent.new_stroke > told.new_stroke


def test_only_the_last_cut_from_the_beginning_counts() -> None:
    job = dashes("absolute")
    runs = [record(job, line=300, taken=300), record(job, line=0)]
    assert resume(job, MACHINE, runs).line == 1
    runs[1] = replace(runs[1], from_line=280)
    assert resume(job, MACHINE, runs).line > 200


def test_what_cannot_be_resumed_is_said() -> None:
    job = dashes("absolute")
    with pytest.raises(InputError, match="another text"):
        resume(Job(job.name, job.text + "G4P1\n"), MACHINE, [record(job)])
    shifted = Job("shift.nc", job.text.replace("G90\n", "G90\nG92 X5\n", 1))
    with pytest.raises(GcodeError, match=r"shift\.nc, line 3 \(G92X5\)"):
        resume(shifted, MACHINE, [record(shifted, line=200, taken=200)])
    over = Job("over.nc", job.text + "".join(f"G0 X{n} Y1\n" for n in range(1, 60)))
    with pytest.raises(InputError, match=r"Every stroke of over\.nc was burnt before .* is left\."):
        resume(over, MACHINE, [record(over, line=over.line_count, taken=over.line_count)])
    for name in ("grbl09-laser-300", "grbl-pen-a4"):
        other = load_machine(name)
        with pytest.raises(InputError, match=f"{name} has no laser mode, so .* up to line 200"):
            resume(job, other, [record(job, line=200, taken=200)])
        with pytest.raises(InputError, match=f"{name} has no laser mode.* leave .from_stroke. out"):
            from_stroke(job, other, 2)
    rest = resume(job, MACHINE, [record(job, line=200, taken=200)])
    with pytest.raises(InputError, match=r"'home'.*'at'"):
        plan_job(job, MACHINE, resumption=rest)
    with pytest.raises(InputError, match="check mode"):
        plan_job(job, MACHINE, SendOptions(check_mode=True), resumption=rest)


@pytest.mark.parametrize("style", ["absolute", "relative"])
def test_m3_is_armed_in_the_dark(style: str) -> None:
    """The beam comes on with the first stroke, not when its modes are brought back."""
    text = dashes(style).text.replace("M4 S0", "M3 S0")
    job = Job("m3.nc", text)
    rest = resume(job, MACHINE, [record(job, line=300, taken=300)])
    wire = FakeWire(new_device())
    plan = plan_job(job, MACHINE, SendOptions(at=(0.0, 0.0), allow_m3=True), resumption=rest)
    deliver(plan, wire, StopSignals())
    first = wire.device.beam_log[0]
    x, y, _ = strokes(parse_program(job)).stroke(rest.stroke)[0]
    assert (first.x0, first.y0) == pytest.approx((x, y), abs=0.02)
    standing = [segment for segment in wire.device.beam_log if segment.standing]
    assert standing in ([], wire.device.beam_log[-1:])  # the job's own M5 waits for the last stroke
    moved = {(round(s.y0), int((s.x0 - 4.98) // 3)) for s in wire.device.beam_log}
    assert len(moved) == STROKES - rest.stroke
