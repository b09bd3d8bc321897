"""Files sent to a cutter in memory that answers nothing, and over a pseudo-terminal."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from miurafab.errors import InputError, JobStopped, PortError
from miurafab.gcode.job import Job
from miurafab.machine.dialects import make_safe, virtual_machine
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.resume import resume
from miurafab.machine.sender import deliver, stream_plan
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import VirtualTransport
from miurafab.machine.virtual_server import PtyWire
from miurafab.profiles import load_machine
from miurafab.simulate.plotter import VirtualPlotter

MACHINE = load_machine("hpgl-cutter-a3")
ROWS = 120


def strokes(speed: int = 40) -> Job:
    """Strokes of 10 mm in a column: more than the cutter's buffer holds."""
    rows = [f"PU400,{400 + 40 * n};PD600,{400 + 40 * n},800,{400 + 40 * n};" for n in range(ROWS)]
    head = f"IN;PA;\nPU;SP4;VS{speed};FS120;\n"
    return Job("rows.plt", head + "\n".join(rows) + "\nPU;PU0,0;SP0;\n")


def drawn(device: VirtualPlotter) -> list[tuple[float, float, float, float]]:
    return [(s.x0, s.y0, s.x1, s.y1) for s in device.beam_log]


WHOLE = [line for n in range(ROWS) for line in ((10, 10 + n, 15, 10 + n), (15, 10 + n, 20, 10 + n))]


def send(job: Job, device: VirtualPlotter, **options: object) -> StreamResult:
    return deliver(plan_job(job, MACHINE), VirtualTransport(device), StopSignals(), **options)


def new_device() -> VirtualPlotter:
    device = virtual_machine(MACHINE)
    assert isinstance(device, VirtualPlotter)
    return device


def test_every_stroke_is_cut_though_the_cutter_is_slower_than_the_wire(tmp_path: Path) -> None:
    device = new_device()
    states: list[str] = []
    journal = tmp_path / "rows.journal"
    result = send(
        strokes(speed=3),
        device,
        journal_path=journal,
        on_progress=lambda now: states.append(now.state),
    )
    assert "Hold" in states  # by its XOFF
    device.advance(300.0)
    assert drawn(device) == WHOLE
    assert {line.force for line in device.beam_log} == {120.0}
    assert device.lost_bytes == 0
    assert not device.pen_down
    assert device.pen == 0
    assert "wait until it has cut what it holds" in result.findings[-1].sentence
    run = read_journal(journal)[-1]
    assert (run.ended, run.why) == ("done", f"{result.lines} lines handed over")
    assert run.taken == run.lines == result.lines == ROWS + 3
    assert run.line == ROWS + 3


class Keys:
    """Space at 2 s of the cutter's time, r at 30 s."""

    def __init__(self, device: VirtualPlotter) -> None:
        self._device, self._due = device, [(2.0, " "), (30.0, "r")]

    def pressed(self) -> str:
        if self._due and self._device.now >= self._due[0][0]:
            return self._due.pop(0)[1]
        return ""


def test_space_hands_nothing_over_until_r() -> None:
    device = new_device()
    told: list[tuple[float, int]] = []

    def note(now: Progress) -> None:
        if now.state == "Hold" and 4.0 < device.now < 30.0:
            told.append((device.now, now.lines_acknowledged))

    send(strokes(), device, keys=Keys(device), on_progress=note)
    assert len({lines for _, lines in told}) == 1
    assert told[-1][0] - told[0][0] > 20
    device.advance(300.0)
    assert drawn(device) == WHOLE


def test_the_transcript_holds_what_was_handed_over_and_what_the_cutter_said(tmp_path: Path) -> None:
    job, device = strokes(speed=3), new_device()
    send(job, device, transcript_path=tmp_path / "t")
    lines = (tmp_path / "t").read_text().splitlines()
    sent = "".join(line.partition(" > ")[2] for line in lines)
    assert sent.startswith(job.text.replace("\n", ""))
    said = "".join(line.partition(" < ")[2] for line in lines)
    assert said == "\\x13\\x11" * (len(said) // 8)  # XOFF and XON in turn
    assert said


@pytest.mark.parametrize("knows", [True, False])
def test_ctrl_c_lifts_the_tool_behind_what_the_cutter_holds(knows: bool) -> None:
    device = new_device()
    device.knows_abort = knows

    def stop(now: Progress) -> None:
        if now.seconds_elapsed > 2.0:
            raise KeyboardInterrupt

    with pytest.raises(JobStopped, match=r"stopped by Ctrl-C.*told to lift its tool"):
        send(strokes(), device, on_progress=stop)
    device.advance(300.0)
    assert not device.pen_down
    assert drawn(device) == WHOLE[: len(device.beam_log)]
    assert 0 < len(device.beam_log) < len(WHOLE)


@pytest.mark.parametrize("how", ["ended", "killed"])
def test_the_journal_tells_how_far_a_broken_job_got(how: str, tmp_path: Path) -> None:
    device, journal = new_device(), tmp_path / "rows.journal"
    device.knows_abort = False

    def stop(now: Progress) -> None:
        if now.seconds_elapsed > 2.0:
            raise KeyboardInterrupt

    with pytest.raises(JobStopped, match=r"; \d+ of 123 lines were handed over, and") as caught:
        send(strokes(), device, journal_path=journal, on_progress=stop)
    if how == "killed":  # without a last word
        text = journal.read_text()
        journal.write_text(text[: text.index('{"ended"')])
    device.advance(300.0)
    (run,) = read_journal(journal)
    assert run.ended == (None if how == "killed" else "stopped")
    assert how == "killed" or run.why == str(caught.value)
    given = 2 * (run.line - 2)  # two strokes a line, after two lines of head
    assert 0 < given < len(WHOLE)
    # What was begun is cut to its end; of a line that was not given whole, at most one stroke more.
    late = 2 * 12 if how == "killed" else 0  # what went in the quarter of a second since
    assert given <= len(device.beam_log) <= given + 1 + late
    said = rf"does not tell what it has cut.*given {run.line - 2} of its {ROWS} strokes, up to line"
    with pytest.raises(InputError, match=said):
        resume(strokes(), MACHINE, [run])


def test_a_cutter_that_cannot_be_told_is_told_of() -> None:
    device = new_device()

    def cut(now: Progress) -> None:
        device.connected = now.seconds_elapsed < 1.0

    with pytest.raises(PortError, match=r"went away.*lift it at the machine"):
        send(strokes(), device, on_progress=cut)


def test_what_a_cutter_cannot_do_is_refused() -> None:
    for options in ({"home": True}, {"at": (0.0, 0.0)}, {"check_mode": True}):
        with pytest.raises(InputError, match="hpgl-cutter-a3 speaks hpgl, which"):
            plan_job(strokes(), MACHINE, SendOptions(**options))
    far = Job("far.plt", "IN;PA;PU;PD40000,0;PU;")
    with pytest.raises(InputError, match="off the bed"):
        plan_job(far, MACHINE)


def test_whoever_finds_it_at_work_lifts_the_tool() -> None:
    device = new_device()
    device.receive(b"IN;PA;PD4000,4000")
    device.advance(1.0)
    assert "told to lift" in make_safe(MACHINE, VirtualTransport(device))
    device.advance(60.0)
    assert not device.pen_down


def test_over_a_pseudo_terminal_the_kernel_heeds_xoff() -> None:
    device, wire, stop = VirtualPlotter(rx_bytes=1024), PtyWire(), threading.Event()

    def serve() -> None:
        start = time.monotonic()
        while not stop.is_set():
            data, _ = wire.wait(0.002)
            device.advance(max(0.0, 20 * (time.monotonic() - start) - device.now))
            device.receive(data)
            output = device.take_output()
            if output:
                wire.write(output)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        stream_plan(plan_job(strokes(speed=10), MACHINE), wire.address)
        end = time.monotonic() + 10
        while len(device.beam_log) < len(WHOLE) and time.monotonic() < end:
            time.sleep(0.05)
    finally:
        stop.set()
        thread.join()
        wire.close()
    assert drawn(device) == WHOLE
    assert device.lost_bytes == 0
