"""A job over a fake wire to the virtual controller: done right, or ended with the beam off."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from wires import BANNER, FakeWire

from miurafab.errors import (
    ControllerError,
    GcodeError,
    InputError,
    JobStopped,
    MachineError,
    PortError,
)
from miurafab.gcode.job import Job
from miurafab.grbl.streamer import LineRefused
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.sender import deliver, stream_plan
from miurafab.machine.signals import StopSignals
from miurafab.profiles import MachineProfile, load_machine
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")


def zigzag(strokes: int, feed: int = 3000) -> Job:
    """Strokes of 10 mm, one above the other."""
    text = "G21\nG90\nM4 S0\n"
    for n in range(strokes):
        y = n % 300 + 1
        text += f"G0 X5 Y{y}\nG1 X15 S500 F{feed}\n"
    return Job("zigzag.nc", text + "M5\nG0 X0 Y0\n")


def new_device(*faults: str, **changes: float) -> VirtualGrbl:
    """A controller set up as MACHINE; ``s32=0`` changes ``$32``."""
    values = virtual_settings(MACHINE) | {int(name[1:]): value for name, value in changes.items()}
    return VirtualGrbl(values, baud=MACHINE.controller.baud, faults=parse_faults(faults))


def send(
    job: Job,
    wire: FakeWire,
    *,
    machine: MachineProfile = MACHINE,
    force: frozenset[str] = frozenset(),
    check_mode: bool = False,
    **options: object,
) -> StreamResult:
    plan = plan_job(job, machine, SendOptions(force=force, check_mode=check_mode))
    try:
        return deliver(plan, wire, StopSignals(), **options)
    finally:
        assert wire.closed


ASKED = b"$I\n$$\n$#\n$G\n$N\n"
AS_WRITTEN, MODES = b"\x90\x95\x99", b"G21G90G17G94G54\n"
HANDSHAKE = ASKED + AS_WRITTEN + MODES
"""All that comes before the first line of a job: the questions, no override, the modes."""


def assert_dark_after_reset(wire: FakeWire) -> None:
    """The reset is the last command, and from when it had arrived nothing burns."""
    assert wire.commands.endswith(b"\x18")
    wire.settle()
    assert not wire.device.beam_on
    first = next(at for at, data in wire.written if b"\x18" in data)
    latest = first + 0.05  # the wire's latency, and the byte itself
    assert all(segment.t1 <= latest for segment in wire.device.beam_log)
    assert not any(segment.standing for segment in wire.device.beam_log)


# Done right


@given(
    st.integers(0, 2**32),
    st.sampled_from([0.0, 0.001, 0.016]),
    st.integers(1, 20),
    st.sampled_from(["character-counting", "send-response"]),
)
@settings(max_examples=30)
def test_every_line_is_acknowledged_once_in_order_and_none_is_lost(
    seed: int, latency: float, strokes: int, streaming: str
) -> None:
    job = zigzag(strokes, 6000)
    device = new_device()
    wire = FakeWire(device, latency=latency, seed=seed)
    machine = _with_streaming(streaming)
    seen: list[Progress] = []
    result = send(job, wire, machine=machine, on_progress=seen.append)
    lines = tuple(job.send_lines())
    assert result.lines == len(lines)
    sent = wire.commands.partition(HANDSHAKE)[2]
    assert sent == b"".join(line.data + b"\n" for line in lines)
    assert device.lost_bytes == 0
    assert all(0 <= item.in_flight <= 128 for item in seen)
    assert seen[-1].lines_acknowledged == seen[-1].lines_total == len(lines)
    assert seen[-1].state == "Idle"
    burnt = sum(abs(s.x1 - s.x0) for s in device.beam_log)
    assert burnt == pytest.approx(10 * strokes, abs=0.05 * strokes)


def _with_streaming(streaming: str) -> MachineProfile:
    from dataclasses import replace

    return replace(MACHINE, controller=replace(MACHINE.controller, streaming=streaming))


def test_done_means_that_the_motion_has_ended() -> None:
    device = new_device()
    result = send(Job("slow.nc", "G1 X20 F600\n"), FakeWire(device))
    assert result.seconds == pytest.approx(2.0, abs=0.3)
    assert device.position[0] == pytest.approx(20)


def test_progress_comes_five_times_a_second_and_knows_the_place() -> None:
    seen: list[Progress] = []
    result = send(zigzag(40, 1500), FakeWire(new_device()), on_progress=seen.append)
    assert 4 * result.seconds < len(seen) < 11 * result.seconds
    assert [item.seconds_elapsed for item in seen] == sorted(i.seconds_elapsed for i in seen)
    assert any(item.position and item.position[0] > 5 for item in seen)


def test_eeprom_lines_in_a_job_lose_nothing() -> None:
    job = Job("offsets.nc", "G0X1\nG0X2\nG10L2P2X1Y1\nG0X3\nG28.1\nG0X4\n" * 20)
    device = new_device()
    assert send(job, FakeWire(device, latency=0.004, seed=3)).lines == 120
    assert device.lost_bytes == 0


def test_a_pause_in_the_job_waits_for_its_dwell() -> None:
    assert send(Job("wait.nc", "G4 P8\nG0X1\n"), FakeWire(new_device())).seconds > 8


def test_check_mode_moves_nothing_and_gathers_what_is_refused() -> None:
    job = Job("bad.nc", "G21\nG1 X5\nG99\nM3 S10\nG1 X5 F100\n")
    device = new_device()
    wire = FakeWire(device)
    result = send(job, wire, check_mode=True)
    assert [refusal.line.number for refusal in result.errors] == [2, 3]
    assert result.lines == 5
    assert wire.commands.endswith(b"\x18")
    assert device.position[0] == 0
    assert device.beam_log == []


def test_the_embedded_controller_is_reached_by_name(tmp_path: Path) -> None:
    transcript = tmp_path / "job.transcript"
    result = stream_plan(plan_job(zigzag(50), MACHINE), "virtual", transcript_path=transcript)
    assert result.lines == 105
    lines = transcript.read_text().splitlines()
    assert lines[0] == "# zigzag.nc to virtual"
    assert all(re.fullmatch(r"\d+\.\d{6} [<>] \S.*", line) for line in lines[1:])
    assert any(line.endswith(" < Grbl 1.1h ['$' for help]\\r\\n") for line in lines)
    assert sum(line.endswith(" < ok\\r\\n") for line in lines) == 105 + len(HANDSHAKE.split())


def test_the_same_job_makes_the_same_records(tmp_path: Path) -> None:
    for name in ("a", "b"):
        stream_plan(
            plan_job(zigzag(30), MACHINE),
            "virtual",
            journal_path=tmp_path / f"{name}.journal",
            transcript_path=tmp_path / f"{name}.transcript",
        )
    for suffix in ("journal", "transcript"):
        first = (tmp_path / f"a.{suffix}").read_bytes()
        assert first == (tmp_path / f"b.{suffix}").read_bytes()


# Stopped by somebody

STOPPED = zigzag(16)  # more moves than a controller holds
NO_SHRINKING = (Phase.explicit, Phase.generate)  # it takes minutes; the first failure says enough


def _calls_of_a_whole_job() -> int:
    wire = FakeWire(new_device(), latency=0.002, seed=1)
    send(STOPPED, wire)
    return wire.calls


CALLS = None


@given(st.integers(0, 10_000), st.booleans())
@settings(max_examples=60, phases=NO_SHRINKING)
def test_an_interrupt_at_any_point_ends_with_a_reset_and_a_dark_beam(
    where: int, in_progress: bool
) -> None:
    global CALLS
    if CALLS is None:
        CALLS = _calls_of_a_whole_job()
    at = where % CALLS + 1
    fired: list[int] = []

    def interrupt(call: int) -> None:
        if call == at and not in_progress:
            fired.append(call)
            raise KeyboardInterrupt

    def progress(_: Progress) -> None:
        if in_progress and not fired and wire.calls >= at:
            fired.append(wire.calls)
            raise KeyboardInterrupt

    wire = FakeWire(new_device(), latency=0.002, seed=1, before_call=interrupt)
    begun = False
    try:
        send(STOPPED, wire, on_progress=progress)
    except JobStopped as error:
        begun = b"G21\n" in wire.bytes_written
        sentence = str(error)
        assert "stopped by Ctrl-C" in sentence
        expected = "reports the beam off" if begun else "before a line of it was sent"
        assert expected in sentence
    else:
        assert not fired
    if begun:
        assert_dark_after_reset(wire)
    assert wire.device.lost_bytes == 0


def test_after_the_interrupt_the_reset_is_the_first_thing_written() -> None:
    written: list[int] = []

    def interrupt(call: int) -> None:
        if wire.device.now > 1.0 and not written:
            written.append(len(wire.written))
            raise KeyboardInterrupt

    wire = FakeWire(new_device(), before_call=interrupt)
    with pytest.raises(JobStopped, match=r"stopped by Ctrl-C; .* reports the beam off"):
        send(STOPPED, wire)
    assert wire.written[written[0]][1] == b"\x18"


def test_a_fault_of_the_caller_stops_the_machine_and_stays_itself() -> None:
    def progress(item: Progress) -> None:
        if item.lines_acknowledged > 20:
            raise ZeroDivisionError("mine")

    wire = FakeWire(new_device())
    with pytest.raises(ZeroDivisionError, match="mine"):
        send(STOPPED, wire, on_progress=progress)
    assert_dark_after_reset(wire)


# Failed


def test_a_refused_line_is_dark_at_once_and_is_named() -> None:
    text = zigzag(40).text.replace("G0 X5 Y12\n", "G99 X5 Y12\n")
    wire = FakeWire(new_device(), latency=0.001)
    with pytest.raises(LineRefused) as caught:
        send(Job("bad.nc", text), wire, force=frozenset({"program"}))
    number = text.splitlines().index("G99 X5 Y12") + 1
    assert f"bad.nc, line {number} ('G99X5Y12'): error:20" in str(caught.value)
    assert "reports the beam off" in str(caught.value)
    assert wire.commands.endswith(b"!\x18")
    assert_dark_after_reset(wire)


def test_an_alarm_ends_the_job_and_is_never_unlocked() -> None:
    wire = FakeWire(new_device("alarm@1s"))
    with pytest.raises(ControllerError, match=r"ALARM:1, a limit switch was hit.*beam off"):
        send(STOPPED, wire)
    assert_dark_after_reset(wire)
    assert b"$X" not in wire.bytes_written


@pytest.mark.parametrize("at", [0.5, 1.5, 2.5])
def test_a_reset_that_nobody_asked_for_ends_the_job(at: float) -> None:
    wire = FakeWire(new_device(f"reset@{at}s"))
    with pytest.raises(ControllerError, match=r"restarted by itself|ALARM:3"):
        send(STOPPED, wire)
    wire.settle()
    assert wire.commands.endswith(b"\x18")
    assert all(segment.t1 <= at + 0.02 for segment in wire.device.beam_log)


def test_a_vanished_port_is_told_and_an_m4_job_goes_dark_by_itself() -> None:
    wire = FakeWire(new_device("disconnect@1s"))
    with pytest.raises(PortError, match=r"went away.*switch the laser off at the machine"):
        send(STOPPED, wire)
    wire.settle()
    assert not wire.device.beam_on
    assert not any(segment.standing for segment in wire.device.beam_log)


def test_a_controller_that_says_nothing_any_more_is_reset() -> None:
    wire = FakeWire(new_device("drop-reply=all@1s"))
    with pytest.raises(ControllerError, match=r"said nothing for 3 s.*did not confirm"):
        send(zigzag(200), wire)
    assert_dark_after_reset(wire)


def test_a_lost_answer_is_noticed_when_the_controller_idles() -> None:
    """Of 80 bytes that are lost a status report is the smaller part."""
    wire = FakeWire(new_device("drop-reply=80@1s"))
    with pytest.raises(ControllerError, match=r"idle but has not answered line \d+ of zigzag"):
        send(STOPPED, wire)
    assert_dark_after_reset(wire)


def test_talk_among_the_replies_does_no_harm() -> None:
    wire = FakeWire(new_device())
    wire.lies = [(0.5, b"\xff\x00\xf0garbage\r\n"), (1.0, b"[MSG:hello]\r\n")]
    assert send(STOPPED, wire).lines == 37


def test_an_answer_to_nothing_ends_the_job() -> None:
    wire = FakeWire(new_device())
    wire.lies = [(0.8, b"ok\r\n" * 30)]
    with pytest.raises(ControllerError, match="answered a line that was never sent"):
        send(STOPPED, wire)
    assert_dark_after_reset(wire)


@pytest.mark.parametrize("said", [b"", b"hello\r\nlogin: "])
def test_what_does_not_speak_grbl_is_told(said: bytes) -> None:
    device = new_device("drop-reply=all@0s")
    device.advance(0.1)
    device.take_output()
    wire = FakeWire(device)
    wire.lies = [(0.0, said)]
    with pytest.raises(PortError, match="Nothing that speaks GRBL answers at the fake wire"):
        send(STOPPED, wire)
    assert b"G21" not in wire.bytes_written


# Refused before anything is sent


@pytest.mark.parametrize(
    ("text", "name", "sentence"),
    [
        ("G21\nM3 S100\nG1 X5 F100\n", "m3", r"line 2 arms the laser with M3"),
        ("G0 X5\nG0 X401\n", "bounds", r"line 2 moves to X401 Y0, off the bed of grbl-laser-400"),
        ("G0 X-1\n", "bounds", r"line 1 moves to X-1 Y0"),
        ("M4 S1500\nG1 X5 F100\n", "power", r"line 2 asks for S1500, more than the 1000"),
        ("G1 X5\n", "program", r"line 1"),
    ],
)
def test_each_check_of_a_job_has_a_name_that_forces_it(text: str, name: str, sentence: str) -> None:
    with pytest.raises(GcodeError, match=sentence) as caught:
        plan_job(Job("job.nc", text), MACHINE)
    assert f"'force' {name}" in str(caught.value)
    plan = plan_job(Job("job.nc", text), MACHINE, SendOptions(force=frozenset({name})))
    assert len(plan.forced) == 1


def test_m3_may_be_allowed() -> None:
    assert plan_job(Job("a", "M3 S1\nG1X1F9\n"), MACHINE, SendOptions(allow_m3=True)).forced == ()


@pytest.mark.parametrize(
    ("changes", "name", "sentence"),
    [
        ({"s32": 0}, "laser-mode", r"\$32 \(laser mode\) is 0 instead of 1"),
        ({"s30": 255}, "s-range", r"\$30 \(largest S value\) is 255 instead of 1000"),
        ({"s110": 500}, "settings", r"\$110 \(X maximum rate\) is 500 mm/min instead of 6000"),
    ],
)
def test_each_check_of_the_controller_has_a_name_that_forces_it(
    changes: dict[str, float], name: str, sentence: str
) -> None:
    job = Job("job.nc", "G0 X5\n")
    wire = FakeWire(new_device(**changes))
    with pytest.raises(ControllerError, match=sentence) as caught:
        send(job, wire)
    assert f"'force' {name}" in str(caught.value)
    assert b"G0X5" not in wire.bytes_written
    result = send(job, FakeWire(new_device(**changes)), force=frozenset({name}))
    assert len(result.findings) == 1


def test_an_unknown_name_to_force_is_refused() -> None:
    with pytest.raises(InputError, match=r"'everything' is not a check.*bounds"):
        plan_job(Job("a", ""), MACHINE, SendOptions(force=frozenset({"everything"})))


def test_a_line_that_may_not_be_sent_is_refused_before_the_port_is_opened() -> None:
    with pytest.raises(GcodeError, match=r"a\.nc, line 2"):
        plan_job(Job("a.nc", "G0X1\nG0!X2\n"), MACHINE)


# Records


def test_the_journal_says_what_was_taken(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "job.journal"
    send(STOPPED, FakeWire(new_device()), journal_path=path)
    wire = FakeWire(new_device("disconnect@1500ms"))
    with pytest.raises(PortError, match=r"went away; .* switch the laser off"):
        send(STOPPED, wire, journal_path=path)
    done, failed = read_journal(path)
    assert (done.job, done.lines, done.taken, done.ended) == ("zigzag.nc", 37, 37, "done")
    assert failed.ended == "failed"
    assert 0 < failed.taken < 65
    assert "went away" in (failed.why or "")
    lines = tuple(STOPPED.send_lines())
    assert failed.line == lines[failed.taken - 1].number


def test_a_record_that_cannot_be_written_is_told_before_anything_moves(tmp_path: Path) -> None:
    wire = FakeWire(new_device())
    with pytest.raises(InputError, match=r"journal .* cannot be written: Is a directory"):
        send(STOPPED, wire, journal_path=tmp_path)
    assert wire.written == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_told_before_anything_moves() -> None:
    wire = FakeWire(new_device())
    with pytest.raises(InputError, match="transcript /dev/full cannot be written: No space left"):
        send(STOPPED, wire, transcript_path=Path("/dev/full"))
    assert wire.written == []


@pytest.mark.parametrize("noun", ["journal", "transcript"])
def test_a_disk_that_fills_up_in_mid_job_stops_it_only_for_the_journal(
    noun: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from miurafab.machine.append_log import DurableFile

    appended: list[int] = []
    append = DurableFile.append

    def full(self: DurableFile, data: bytes) -> None:
        appended.append(1)
        append(self, data)
        if len(appended) == 10:
            self._fault = OSError(28, "No space left on device")

    monkeypatch.setattr(DurableFile, "append", full)
    wire = FakeWire(new_device())
    files = {f"{noun}_path": tmp_path / noun}
    if noun == "journal":
        with pytest.raises(MachineError, match=r"can no longer be written: No space.*beam off"):
            send(zigzag(200), wire, **files)
        assert_dark_after_reset(wire)
    else:
        (finding,) = send(zigzag(200), wire, **files).findings
        assert finding.code == "records"
        assert "can no longer be written: No space left" in finding.sentence


@pytest.mark.parametrize("reset", [False, True])
def test_a_board_that_rests_is_reset_only_if_asked(reset: bool) -> None:
    """It stays awake when its port opens, and proves by ``$I`` that it holds nothing."""
    device = new_device()
    device.advance(0.1)
    assert BANNER in device.take_output()
    wire = FakeWire(device)
    plan = plan_job(STOPPED, MACHINE, SendOptions(reset=reset))
    assert deliver(plan, wire, StopSignals()).lines == 37
    first = b"\x18" if reset else b"$I\n"
    assert wire.commands.startswith(first + HANDSHAKE + b"G21\nG90\n")


def test_a_board_at_work_is_left_alone() -> None:
    device = new_device()
    device.receive(b"G1X100F100\n")
    device.advance(0.5)
    device.take_output()
    wire = FakeWire(device)
    with pytest.raises(ControllerError, match=r"is at work \(Run\)"):
        send(STOPPED, wire)
    assert wire.commands == b""


def test_a_job_that_leaves_the_laser_burning_is_ended_by_a_reset() -> None:
    device = new_device()
    result = deliver(
        plan_job(Job("forgot.nc", "M3 S500\nG1 X5 F600\n"), MACHINE, SendOptions(allow_m3=True)),
        FakeWire(device),
        StopSignals(),
    )
    (finding,) = result.findings
    assert finding.code == "armed"
    assert str(finding) == "The job ended with the laser armed, so the controller was reset."
    device.advance(1)
    assert not device.beam_on


def test_a_machine_with_homing_is_homed_first_if_asked() -> None:
    """After power-up such a controller is locked, and nothing unlocks it by itself."""
    homing = {"s22": 1, "s24": 500, "s25": 3000}
    job = Job("job.nc", "G90\nG53 G0 X-5\n")
    wire = FakeWire(new_device(**homing))
    force = frozenset({"bounds", "program"})
    with pytest.raises(
        ControllerError, match=r"restarted the board, which is locked.*'force' idle"
    ):
        send(job, wire, force=force)
    assert b"$X" not in wire.bytes_written
    assert b"$H" not in wire.bytes_written
    plan = plan_job(job, MACHINE, SendOptions(force=force, home=True))
    wire = FakeWire(new_device(**homing))
    assert deliver(plan, wire, StopSignals()).lines == 2
    # Behind the homing the firmware runs its startup blocks, so its modes are asked for again.
    homed = b"$H\n" + b"$#\n$G\n"
    assert wire.commands.startswith(ASKED + AS_WRITTEN + homed + MODES + b"G90\n")
    assert wire.device.position[0] == pytest.approx(-5)


def test_soft_limits_are_checked_from_where_the_machine_stands() -> None:
    device = new_device(s20=1, s22=1, s24=500, s25=3000)
    wire = FakeWire(device)
    job = Job("job.nc", "G0 X10\n")
    with pytest.raises(ControllerError, match=r"past its soft limits.*'force' travel"):
        deliver(plan_job(job, MACHINE, SendOptions(home=True)), wire, StopSignals())
    assert b"G0X10" not in wire.bytes_written
    device = new_device(s20=1, s22=1, s24=500, s25=3000)
    device.receive(b"$X\n")
    device.advance(0.1)
    device.receive(b"G10L2P1X-400Y-400\n")
    device.advance(0.5)
    device.power_cycle()
    wire = FakeWire(device)
    assert deliver(plan_job(job, MACHINE, SendOptions(home=True)), wire, StopSignals()).lines == 1
    assert device.position[0] == pytest.approx(-390)
