"""The list of what goes wrong at a machine, one by one, on the controller's clock.

Each case: the beam goes off and never stood, the sentence says what happened, the exit code is
that of a machine that failed, and the job goes on from its journal with no stroke left out and
only the stated ones burnt twice. tests/cli/test_cut_faults.py has the same with real processes.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from dashes import STROKES, burnt, dashes
from wires import FakeWire

from miurafab.errors import GcodeError, JobStopped, MiurafabError
from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import StreamResult
from miurafab.machine.resume import Resumption, resume
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
JOB = dashes("absolute")


def new_wire(*faults: str) -> FakeWire:
    settings = virtual_settings(MACHINE) | {21: 1}
    return FakeWire(
        VirtualGrbl(settings, baud=MACHINE.controller.baud, faults=parse_faults(faults))
    )


def send(
    job: Job, wire: FakeWire, journal: Path | None = None, rest: Resumption | None = None
) -> StreamResult:
    plan = plan_job(job, MACHINE, SendOptions(at=(0.0, 0.0)), resumption=rest)
    return deliver(plan, wire, StopSignals(), journal_path=journal)


RESET = "the controller was reset and reports the beam off."
UNSURE = "did not confirm that the beam is off, so switch the laser off at the machine."


@pytest.mark.parametrize("at", ["4.4s", "2500"])
@pytest.mark.parametrize(
    ("fault", "said", "outcome"),
    [
        ("alarm", "ALARM:1, a limit switch was hit", RESET),
        ("reset", "restarted by itself|ALARM:3", RESET),
        ("power", "restarted by itself", RESET),
        ("disconnect", "went away", UNSURE),
        ("disconnect=2s", "went away", UNSURE),
        ("drop-reply=all", "has said nothing for 3 s", UNSURE),
        ("drop=all", "has said nothing for 3 s", UNSURE),
        ("drop-reply=90", "is idle but has not answered line", RESET),
        ("delay-reply=6s", "has said nothing for 3 s", "."),
        ("hang=10s", "has said nothing for 3 s", "."),
        ("hang", "has said nothing for 3 s", UNSURE),
    ],
)
def test_a_fault_ends_the_job_in_the_dark_and_it_goes_on(
    fault: str, at: str, said: str, outcome: str, tmp_path: Path
) -> None:
    journal = tmp_path / "journal"
    wire = new_wire(f"{fault}@{at}")
    with pytest.raises(MiurafabError, match=said) as caught:
        send(JOB, wire, journal)
    assert caught.value.exit_code == 3
    assert str(caught.value).endswith(outcome)
    assert re.search(r"\d+ of 407 lines were acknowledged", str(caught.value))
    wire.settle()
    assert not wire.device.beam_on
    # A firmware that hangs in mid-move waits its step idle delay ($1) with the beam on.
    standing = standing_seconds(wire.device.beam_log)
    assert standing <= (0.026 if fault.startswith("hang") else 0.0)
    run = read_journal(journal)[-1]
    assert (run.ended, run.why) == ("failed", str(caught.value))

    rest = resume(JOB, MACHINE, read_journal(journal))
    again = new_wire()
    send(JOB, again, journal, rest)
    counts = burnt(JOB, [wire.device.beam_log, again.device.beam_log])
    assert all(counts[index] for index in range(STROKES))
    twice = {index % 1000 for index, count in counts.items() if count > 1 or index >= 1000}
    assert twice <= set(range(rest.stroke, rest.new_stroke))
    assert rest.new_stroke - rest.stroke <= 21
    assert read_journal(journal)[-1].ended == "done"


@pytest.mark.parametrize(
    "fault", ["delay=2s", "delay-reply=2s", "slow=16ms", "slow=100ms", "hang=2s"]
)
def test_what_is_only_late_ends_whole(fault: str) -> None:
    wire = new_wire(f"{fault}@3s")
    assert send(JOB, wire).lines == 407
    assert wire.device.lost_bytes == 0
    assert set(burnt(JOB, [wire.device.beam_log]).values()) == {1}


@pytest.mark.parametrize("at", [601, 617, 1503, 4000])
@pytest.mark.parametrize("fault", ["drop=1", "drop=5", "corrupt=1", "corrupt=4", "noise=6"])
def test_noise_on_the_line_never_leaves_the_beam_standing(fault: str, at: int) -> None:
    """The controller cannot tell a changed figure from a meant one; all else ends in the dark."""
    wire = new_wire(f"{fault}@{at}")
    stop = StopSignals()
    wire.before_call = lambda call: setattr(
        stop, "caught", "SIGINT" if wire.device.now > 120 else None
    )
    error = None
    try:
        deliver(plan_job(JOB, MACHINE), wire, stop)
    except MiurafabError as raised:
        error = raised
    if error is not None:
        assert error.exit_code == (130 if isinstance(error, JobStopped) else 3)
        assert re.search(r"refused|bytes were lost|ALARM|restarted|into|stopped by", str(error))
        assert str(error).endswith(RESET)
    wire.settle()
    assert not wire.device.beam_on
    assert standing_seconds(wire.device.beam_log) == 0.0


def test_an_error_in_mid_job_is_named_and_dark_at_once(tmp_path: Path) -> None:
    text = JOB.text.replace("G0 X8 Y7\n", "G0 X8 Y7 Q1\n")
    job = Job("bad.nc", text)
    number = text.splitlines().index("G0 X8 Y7 Q1") + 1
    wire = new_wire()
    plan = plan_job(job, MACHINE, SendOptions(force=frozenset({"program"})))
    with pytest.raises(MiurafabError, match=rf"bad\.nc, line {number} \('G0X8Y7Q1'\): error:") as e:
        deliver(plan, wire, StopSignals(), journal_path=tmp_path / "journal")
    assert e.value.exit_code == 3
    assert str(e.value).endswith(RESET)
    wire.settle()
    at = next(at for at, data in wire.written if b"\x18" in data)
    assert all(segment.t1 <= at + 0.002 for segment in wire.device.beam_log)
    assert standing_seconds(wire.device.beam_log) == 0.0


# What is in the file


def plain(text: str) -> list[tuple[float, ...]]:
    """What ``text`` burns, and that it does so to the end."""
    wire = new_wire()
    send(Job("odd.nc", text), wire)
    assert wire.device.lost_bytes == 0
    return [(s.x0, s.y0, s.x1, s.y1, s.power) for s in wire.device.beam_log]


ODD = "G21\nG90\nM4 S0\nG0 X5 Y5\nG1 X15 S500 F3000\nG0 X5 Y6\nG1 X15\nM5\n"


@pytest.mark.parametrize(
    "text",
    [
        ODD.replace("\n", " ; careful! really? ~ \n"),
        ODD.replace("\n", " (careful! really? ~)\n"),
        ODD.replace("\n", " ; schön, 切る, \x84 \x85 \x18 \x90\n"),
        ODD.replace("\n", "\r\n"),
        ODD.replace("\n", "\r"),
        "\n\n" + ODD,
        ODD.replace("G0 X5 Y6\n", "G0 X5 Y6" + " " * 300 + "\n"),
        ODD.replace("\n", "; " + "x" * 200 + "\n"),
    ],
    ids=["semicolon", "brackets", "utf8", "crlf", "cr", "blank", "blanks", "long comment"],
)
def test_what_comments_blanks_and_line_ends_hold_never_reaches_the_wire(text: str) -> None:
    assert plain(text) == plain(ODD)


@pytest.mark.parametrize("length", [70, 79])
def test_a_line_that_fits_is_sent(length: int) -> None:
    line = "G1X15S500F3000"
    padded = line.replace("X15", "X15." + "0" * (length - len(line) - 1))
    assert len(padded) == length
    assert plain(ODD.replace("G1 X15 S500 F3000", padded)) == plain(ODD)


@pytest.mark.parametrize("length", [80, 100, 200])
def test_a_line_that_does_not_fit_is_refused_before_the_port_is_opened(length: int) -> None:
    padded = "G1X15." + "0" * (length - 6)
    with pytest.raises(GcodeError, match=rf"odd\.nc, line 5.* {length} ") as caught:
        plan_job(Job("odd.nc", ODD.replace("G1 X15 S500 F3000", padded)), MACHINE)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("byte", ["!", "?", "~", "\x18", "\x84", "é", "\x00", "\t\x07"])
def test_a_byte_that_is_a_command_is_refused_with_its_line(byte: str) -> None:
    with pytest.raises(GcodeError, match=r"odd\.nc, line 5"):
        plan_job(Job("odd.nc", ODD.replace("X15 S500", f"X15{byte} S500")), MACHINE)


@pytest.mark.parametrize("line", ["G10 L2 P2 X1 Y1", "G28.1", "G30.1", "G10L20P3X0"])
def test_what_writes_the_eeprom_in_mid_job_loses_nothing(line: str) -> None:
    lines = JOB.text.splitlines()
    for index in range(6, 400, 40):
        lines.insert(index, line)
    wire = new_wire()
    send(Job("stored.nc", "\n".join(lines)), wire)
    assert wire.device.lost_bytes == 0
    # Where motion ends before the write, the last bit of braking is dark: such a stroke is short.
    counts = burnt(JOB, [wire.device.beam_log])
    assert all(counts[index] + counts[1000 + index] == 1 for index in range(STROKES))
