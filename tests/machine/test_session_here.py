"""A session in this process: the port it opens, its keys, its signals, and its end."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from session_walk import JOB, MACHINE
from wires import FakeWire

from miurafab.errors import JobStopped, PersonNeeded
from miurafab.machine import sender
from miurafab.machine.journal import read_journal
from miurafab.machine.progress import Progress
from miurafab.machine.sender import SheetSession, deliver, session_here, stream_plan
from miurafab.machine.signals import StopSignals
from miurafab.profiles import MachineProfile
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


class Opened:
    """What is opened in place of a port: the virtual controller over a fake wire."""

    def __init__(self) -> None:
        self.wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))
        self.asked: list[tuple[str, str, float | None]] = []

    def __call__(self, machine: MachineProfile, port: str, speed: float | None = None) -> FakeWire:
        self.asked.append((machine.name, port, speed))
        return self.wire


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Opened:
    opened = Opened()
    monkeypatch.setattr(sender, "open_machine", opened)
    return opened


class Reset:
    """Ctrl-X, pressed as soon as a beam has burnt."""

    def __init__(self, wire: FakeWire) -> None:
        self._wire = wire

    def pressed(self) -> str:
        return "\x18" * bool(self._wire.device.beam_log)


@contextmanager
def heeding(number: signal.Signals) -> Iterator[list[int]]:
    """A program that counts the signals which reach it."""
    came: list[int] = []
    before = signal.signal(number, lambda told, _: came.append(told))
    try:
        yield came
    finally:
        signal.signal(number, before)


def here(**more: object) -> contextmanager[SheetSession]:
    return session_here(MACHINE, "a port", "rows.nc", **more)


def test_the_port_that_was_asked_for_is_opened_and_closed_dark(opened: Opened) -> None:
    with here(virtual_speed=3.0) as session:
        assert session.cut(JOB).lines == 15
        assert not opened.wire.closed
    assert opened.asked == [("grbl-laser-400", "a port", 3.0)]
    assert opened.wire.closed
    assert not opened.wire.device.beam_on


@pytest.mark.parametrize("blocks", [False, True])
def test_a_signal_raises_at_once_only_where_reads_take_real_time(
    opened: Opened, blocks: bool
) -> None:
    signals = StopSignals()
    opened.wire.blocks = blocks
    with here(signals=signals):
        assert signals.at_once is blocks


def test_a_signal_is_caught_here_unless_somebody_else_catches_it(opened: Opened) -> None:
    """In mid-job the reset is the next thing on the wire; the end of the block frees the signal."""

    def press(now: Progress) -> None:
        if now.lines_acknowledged > 5 and not signalled:
            signalled.append(len(opened.wire.commands))
            signal.raise_signal(signal.SIGTERM)

    signalled: list[int] = []
    with heeding(signal.SIGTERM) as came:
        with pytest.raises(JobStopped, match=r"stopped by .*SIGTERM.*reports the beam off"):
            stream_plan(JOB, "a port", on_progress=press)
        assert opened.wire.commands[signalled[0] :] == b"\x18"
        assert came == []
        signal.raise_signal(signal.SIGTERM)
        assert came == [signal.SIGTERM]
        with here(signals=StopSignals()):
            signal.raise_signal(signal.SIGTERM)
        assert came == 2 * [signal.SIGTERM]


def test_a_signal_ends_the_wait_for_a_person_with_the_name_of_the_job(opened: Opened) -> None:
    def wait() -> None:
        with here() as session, session.waits() as has_ended:
            assert has_ended() is False
            signal.raise_signal(signal.SIGINT)

    with heeding(signal.SIGINT), pytest.raises(JobStopped) as caught:
        wait()
    assert str(caught.value) == "rows.nc was stopped by Ctrl-C."
    assert opened.wire.closed


def test_signals_of_another_stop_a_job_before_anything_is_sent(opened: Opened) -> None:
    signals = StopSignals()
    signals.caught = "SIGHUP"
    with pytest.raises(JobStopped, match="closing of the terminal"):
        stream_plan(JOB, "a port", signals=signals)
    assert opened.wire.commands == b""


def test_a_sheet_takes_one_job_until_another_is_loaded(opened: Opened) -> None:
    opened.wire.blocks = True
    with here() as session:
        session.frame(JOB)
        session.cut(JOB)
        burnt = len(opened.wire.device.beam_log)
        with pytest.raises(PersonNeeded, match="put in fresh material"):
            session.cut(JOB)
        assert len(opened.wire.device.beam_log) == burnt
        session.load()
        assert session.cut(JOB).lines == 15


def cut_here(wire: FakeWire, keys: Reset) -> None:
    with here(keys=keys) as session:
        session.cut(JOB)


@pytest.mark.parametrize(
    "cut",
    [
        cut_here,
        lambda wire, keys: stream_plan(JOB, "a port", keys=keys),
        lambda wire, keys: deliver(JOB, wire, StopSignals(), keys=keys),
    ],
    ids=["session", "plan", "wire"],
)
def test_a_key_resets_whichever_way_a_job_is_sent(
    opened: Opened, cut: Callable[[FakeWire, Reset], object]
) -> None:
    wire = opened.wire
    with pytest.raises(JobStopped, match="stopped at the keyboard") as caught:
        cut(wire, Reset(wire))
    assert type(caught.value) is JobStopped
    assert wire.commands.endswith(b"\x18")
    assert wire.closed
    wire.settle()
    assert len(wire.device.beam_log) <= 2


@pytest.mark.parametrize("how", ["plan", "wire"])
def test_a_job_is_told_and_recorded_whichever_way_it_is_sent(
    opened: Opened, tmp_path: Path, how: str
) -> None:
    seen: list[Progress] = []
    files = {"journal_path": tmp_path / "journal", "transcript_path": tmp_path / "transcript"}
    if how == "plan":
        result = stream_plan(JOB, "a port", virtual_speed=2.0, on_progress=seen.append, **files)
        assert opened.asked == [("grbl-laser-400", "a port", 2.0)]
    else:
        result = deliver(JOB, opened.wire, StopSignals(), on_progress=seen.append, **files)
    assert seen[-1].lines_acknowledged == result.lines == 15
    (run,) = read_journal(tmp_path / "journal")
    assert (run.ended, run.taken) == ("done", 15)
    lines = (tmp_path / "transcript").read_text().splitlines()
    assert lines[0] == "# rows.nc to the fake wire"
    sent = [line.partition(" > ")[2] for line in lines if " > " in line]
    assert [line for line in sent if line.startswith("G1")] != []


def test_a_small_controller_gets_no_more_than_it_holds(opened: Opened) -> None:
    """Whose receive buffer the profile tells."""
    small = replace(MACHINE, controller=replace(MACHINE.controller, rx_bytes=40))
    seen: list[Progress] = []
    with session_here(small, "a port", "rows.nc") as session:
        session.cut(replace(JOB, machine=small), on_progress=seen.append)
    assert 0 < max(now.in_flight for now in seen) <= 40
