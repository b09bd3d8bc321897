"""Jobs sent to a Marlin controller in memory, whole and with whatever may go wrong on the way."""

from __future__ import annotations

import random
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from miurafab.__main__ import main
from miurafab.errors import (
    ControllerError,
    InputError,
    JobStopped,
    PersonNeeded,
    PortError,
    ProfileError,
)
from miurafab.gcode.job import Job
from miurafab.machine.dialects import make_safe
from miurafab.machine.faulty import FaultyDevice
from miurafab.machine.journal import read_journal
from miurafab.machine.judge_job import judge_job
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.sender import deliver, stream_plan
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import VirtualTransport
from miurafab.machine.virtual_server import PtyWire, load_controller
from miurafab.motion.parameters import MotionParameters
from miurafab.profiles import load_machine
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.marlin.controller import VirtualMarlin
from miurafab.simulate.plotter import VirtualPlotter
from miurafab.workflow.dry_run import dry_run

MACHINE = load_machine("marlin-laser-220")
DASHES = 40


def dashes(count: int = DASHES, feed: int = 1000) -> Job:
    lines = ["M5", "G21", "G90", "M4 I S0"]
    for n in range(count):
        x, y = 10 + 3 * (n % 20), 10 + 3 * (n // 20)
        lines += [f"G0 X{x} Y{y} S0 F9000", f"G1 X{x + 2} Y{y} S200 F{feed}"]
    return Job("dashes.nc", "\n".join([*lines, "M5 I", "M5", "G0 X0 Y0 S0 F9000", ""]))


def burnt(device: VirtualMarlin) -> list[tuple[int, int, int, int]]:
    return [
        (round(s.x0), round(s.y0), round(s.x1), round(s.y1)) for s in device.beam_log if s.power > 0
    ]


WHOLE = [
    (10 + 3 * (n % 20), 10 + 3 * (n // 20), 12 + 3 * (n % 20), 10 + 3 * (n // 20))
    for n in range(DASHES)
]


class Wire(VirtualTransport):
    """To ``device``, each byte changed by chance; ``before_read`` is called with the time."""

    def __init__(
        self,
        device: VirtualMarlin,
        *,
        wrong: float = 0.0,
        seed: int = 0,
        before_read: Callable[[float], None] = lambda now: None,
    ) -> None:
        super().__init__(device)
        self.written = b""
        self._chance, self._wrong = random.Random(seed), wrong
        self._before_read = before_read

    def _spoil(self, data: bytes) -> bytes:
        return bytes(
            byte ^ 1 << self._chance.randrange(7) if self._chance.random() < self._wrong else byte
            for byte in data
        )

    def write(self, data: bytes) -> None:
        self.written += data
        super().write(self._spoil(data))

    def write_now(self, data: bytes) -> None:
        self.written += data
        super().write_now(data)

    def read(self, timeout: float) -> bytes:
        self._before_read(self.device.now)
        return self._spoil(super().read(timeout))


def new_device(*, emergency_parser: bool = True) -> VirtualMarlin:
    parameters = MotionParameters.from_profile(MACHINE)
    return VirtualMarlin(parameters, baud=115_200, emergency_parser=emergency_parser)


def send(
    job: Job, wire: VirtualTransport, *, force: frozenset[str] = frozenset(), **options: object
) -> StreamResult:
    return deliver(plan_job(job, MACHINE, SendOptions(force=force)), wire, StopSignals(), **options)


def assert_dark(device: VirtualMarlin) -> None:
    end = max((segment.t1 for segment in device.beam_log), default=0.0)
    device.advance(60.0)
    assert not device.beam_on
    assert max((segment.t1 for segment in device.beam_log), default=0.0) == end
    assert not any(segment.standing for segment in device.beam_log)


def test_a_job_is_burnt_whole_and_ends_dark(tmp_path: Path) -> None:
    device = new_device()
    seen: list[Progress] = []
    journal = tmp_path / "dashes.journal"
    result = send(dashes(), Wire(device), journal_path=journal, on_progress=seen.append)
    assert burnt(device) == WHOLE
    assert {round(s.power * 255) for s in device.beam_log} == {200}
    assert result.lines == 7 + 2 * DASHES == seen[-1].lines_total
    assert result.findings == ()
    assert [p.lines_acknowledged for p in seen] == sorted(p.lines_acknowledged for p in seen)
    assert (run := read_journal(journal)[-1]).ended == "done"
    assert run.taken == result.lines
    assert_dark(device)


@pytest.mark.parametrize("home", [False, True])
def test_a_beam_and_a_feed_that_were_left_are_ended_before_anything_moves(home: bool) -> None:
    device = new_device()
    device.receive(b"M220 S50\nM3 S200\n")
    device.advance(0.5)
    device.take_output()
    assert device.beam_on
    job = Job("left.nc", "G21\nG90\nG1 X30 S0 F600\nM4 I S0\nG1 X40 S100 F600\nM5 I\nM5\n")
    deliver(plan_job(job, MACHINE, SendOptions(home=home)), Wire(device), StopSignals())
    left, stroke = device.beam_log
    assert (left.standing, left.x0) == (True, 0.0)
    assert (round(stroke.x0), round(stroke.x1)) == (30, 40)
    assert stroke.t1 - stroke.t0 == pytest.approx(1.0, abs=0.02)


def test_a_job_whose_beam_stays_on_at_rest_is_stopped_in_place_of_a_hold() -> None:
    strokes = "".join(f"G1 X{9 + 3 * (n % 2)} Y{n} S99 F600\n" for n in range(99))
    for arms, dark in (("M3 S99", False), ("M3 I S99", True)):
        device = new_device()
        keys = Pressed(device, **{" ": 8.0, "r": 20.0})
        plan = plan_job(
            Job("plain.nc", f"{arms}\n{strokes}M5 I\nM5\n"), MACHINE, SendOptions(allow_m3=True)
        )
        if dark:
            deliver(plan, Wire(device), StopSignals(), keys=keys)
        else:
            with pytest.raises(JobStopped, match="not held: after M3 or M4 without I the contr"):
                deliver(plan, Wire(device), StopSignals(), keys=keys)
            assert device.now < 9.0
        assert not device.beam_on


PAUSED = "M4 I S0\nG1 X9 S200 F3000\nM5 I\n{pause}\nM4 I S0\nG1 X12 S200\nM5 I\nM5\n"


def paused(pause: str, at_pause: str) -> tuple[Wire, list[str]]:
    """A job with a ``pause``, at which r is pressed after a while."""
    device = new_device()
    wire, told = Wire(device), list[str]()
    plan = replace(plan_job(Job("p.nc", PAUSED.format(pause=pause)), MACHINE), at_pause=at_pause)
    pressed = Pressed(device, r=20.0)
    deliver(plan, wire, StopSignals(), keys=pressed, on_progress=lambda p: told.append(p.state))
    assert_dark(device)
    assert burnt(device) == [(0, 0, 9, 0), (9, 0, 12, 0)]
    assert b"M0" not in wire.written.upper()
    assert b"M1*" not in wire.written
    return wire, told


@pytest.mark.parametrize("pause", ["M0", "M00 (fresh paper)", "M1", "m0", "/M0", "M0."])
def test_the_host_pauses_in_place_of_a_controller_that_waits_for_its_button(pause: str) -> None:
    _, told = paused(pause, "go on")
    assert set(told) == {"Run"}
    wire, told = paused(pause, "wait")
    assert "waiting at p.nc, line 4 (M0): r goes on" in told
    assert wire.now() > 20.0


def test_a_pause_where_nobody_is_ends_the_job_dark_and_a_restart_in_it_is_noticed() -> None:
    with pytest.raises(PersonNeeded, match=r"p\.nc, line 4 waits .*cut the sheet anew in a"):
        paused("M0", "stop")
    device = new_device()
    plan = replace(plan_job(Job("p.nc", PAUSED.format(pause="M0")), MACHINE), at_pause="wait")
    restarts = [device.power_cycle]

    def before_read(now: float) -> None:
        if now > 15.0 and restarts:
            restarts.pop()()

    with pytest.raises(ControllerError, match="restarted by itself after it took line 3"):
        deliver(plan, Wire(device, before_read=before_read), StopSignals())
    assert_dark(device)


@pytest.mark.parametrize("seed", range(8))
def test_on_a_noisy_wire_each_dash_is_burnt_once_or_the_job_is_halted(seed: int) -> None:
    device = new_device()
    wire = Wire(device, wrong=0.001, seed=seed)
    try:
        send(dashes(), wire)
    except (ControllerError, PortError):
        assert burnt(device)[:-1] == WHOLE[: max(len(device.beam_log) - 1, 0)]
        assert wire.written.endswith(b"M112\n")
    else:
        assert burnt(device) == WHOLE
    assert_dark(device)


def test_noise_is_mended_and_not_only_noticed() -> None:
    done = 0
    for seed in range(8):
        device = new_device()
        try:
            send(dashes(), Wire(device, wrong=0.0005, seed=seed))
        except (ControllerError, PortError):
            continue
        done += burnt(device) == WHOLE
    assert done >= 6


class Torn(Wire):
    """Every copy of one line is damaged."""

    def write(self, data: bytes) -> None:
        super().write(data.replace(b"X10Y10", b"X11Y10"))


def test_a_line_that_never_gets_through_ends_the_job_dark() -> None:
    device = new_device()
    with pytest.raises(
        ControllerError, match=r"never got line \d+ undamaged .*; look at the cable"
    ):
        send(dashes(4), Torn(device))
    assert_dark(device)
    assert burnt(device) == []


def test_an_answer_that_is_lost_is_asked_for_and_nothing_is_made_twice() -> None:
    device = new_device()

    class Lossy(Wire):
        lost = 0

        def read(self, timeout: float) -> bytes:
            data = super().read(timeout)
            if self.device.now > 0.5 and self.lost < 2 and b"ok" in data:
                self.lost += 1
                return b""
            return data

    send(dashes(), Lossy(device))
    assert burnt(device) == WHOLE


def test_a_refused_line_halts_the_controller_and_is_named() -> None:
    job = Job("bad.nc", dashes().text.replace("M5 I\n", "G17\nG1 X100 S200 F500\n"))
    with pytest.raises(InputError, match=r"bad.nc, line 85: G17 is not a command"):
        plan_job(job, MACHINE)
    device = new_device()
    wire = Wire(device)
    with pytest.raises(ControllerError, match=r"refused line 85 \('G17'\).*halted \(M112\)"):
        send(job, wire, force=frozenset({"program"}))
    assert wire.written.endswith(b"\nM112\n")
    assert device.killed
    assert_dark(device)


@pytest.mark.parametrize(("air", "end"), [("M8", ": shut it at the machine."), ("M9", "again.")])
def test_the_last_words_tell_of_the_air_that_stays_on(air: str, end: str) -> None:
    job = Job("bad.nc", dashes().text.replace("G90", f"G90\nM8\n{air}").replace("M5 I", "G17"))
    with pytest.raises(ControllerError, match=r"refused line 87 \('G17'\)") as fault:
        send(job, Wire(new_device()), force=frozenset({"program"}))
    assert str(fault.value).endswith(end)


def test_a_further_job_of_a_session_is_not_waited_for_again() -> None:
    device = new_device()
    wire = Wire(device)
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    plan = plan_job(dashes(), MACHINE)
    took = []
    for _ in range(2):
        begun = device.now
        took.append((session.cut(plan).seconds, device.now - begun))
        session.load()
    assert burnt(device) == 2 * WHOLE
    (first, _), (second, again) = took
    assert second == pytest.approx(first, abs=0.1)
    assert again - second < 0.2
    assert wire.written.count(b"M115") == 2


@pytest.mark.parametrize("emergency_parser", [True, False])
def test_ctrl_c_halts_and_the_halt_is_confirmed(emergency_parser: bool) -> None:
    device = new_device(emergency_parser=emergency_parser)
    at: list[float] = []

    def interrupt(now: float) -> None:
        if now > 4.0 and not at:
            at.append(now)
            raise KeyboardInterrupt

    wire = Wire(device, before_read=interrupt)
    with pytest.raises(JobStopped, match=r"dashes.nc was stopped by Ctrl-C; .*halted \(M112\)"):
        send(dashes(), wire)
    assert device.killed
    assert_dark(device)
    if emergency_parser:
        assert device.beam_log[-1].t1 < at[0] + 0.002


def test_without_an_emergency_parser_the_user_is_told() -> None:
    (finding,) = send(dashes(2), Wire(new_device(emergency_parser=False))).findings
    assert finding.code == "no-emergency-parser"
    assert "built without EMERGENCY_PARSER" in finding.sentence


def test_a_restart_ends_the_job() -> None:
    device = new_device()

    def restart(now: float) -> None:
        if now > 3.0 and not device.homed:
            device.homed = 1
            device.power_cycle()

    with pytest.raises(ControllerError, match="restarted by itself after it took line"):
        send(dashes(), Wire(device, before_read=restart))
    assert_dark(device)


def test_a_halt_of_its_own_ends_the_job() -> None:
    """As of a thermal fault, or of another program that sends M112."""
    device = new_device()

    def halt(now: float) -> None:
        if now > 3.0 and not device.killed:
            device.receive(b"M112\n")

    with pytest.raises(ControllerError, match=r"halted after it took line \d+ .*'Error:"):
        send(dashes(), Wire(device, before_read=halt))
    assert_dark(device)


def test_the_transcript_holds_the_halt(tmp_path: Path) -> None:
    """Both ways are in it, to the last byte that was sent."""
    job = Job("bad.nc", dashes(3).text.replace("M5 I\n", "G17\n"))
    wire = Wire(new_device())
    with pytest.raises(ControllerError, match="refused line"):
        send(job, wire, force=frozenset({"program"}), transcript_path=tmp_path / "t")
    lines = (tmp_path / "t").read_text().splitlines()
    sent = "".join(line.partition(" > ")[2] for line in lines)
    assert sent.replace("\\n", "\n").encode() == wire.written
    assert any(" < Error:Printer halted" in line for line in lines)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("M3 S200\nG1 X5 F600\nG4 P500\nM5\n", 5),
        ("M3\nG1 X5 S200 F600\nG4 S1\nM5\n", 5),  # its S is a time
        ("M3 S0\nG4 S1\nM3 S200\nG0 X5\nG04 P1\nM5\n", 7),
        ("M3 S200\nG4 P0\nM5\nG4 P9\n", None),
        ("M4 I S200\nG1 X5 F600\nG4 P500\nM5 I\n", None),
    ],
)
def test_a_dwell_with_the_beam_on_is_refused(text: str, line: int | None) -> None:
    """``M3`` without ``I`` burns at once, whatever the motion mode is."""
    job = Job("dwell.nc", "G21\nG90\n" + text)
    found = {each.code: each for each in judge_job(job, MACHINE).findings}
    assert ("dwell" in found) == (line is not None)
    if line is not None:
        assert found["dwell"].sentence.startswith(f"dwell.nc, line {line} waits with the beam on")


def test_silence_is_asked_again_and_then_told() -> None:
    device = new_device()

    class Deaf(Wire):
        def read(self, timeout: float) -> bytes:
            data = super().read(timeout)
            return data if self.device.now < 2.0 else b""

    wire = Deaf(device)
    with pytest.raises(ControllerError, match=r"said nothing for 9 s.*switch the laser off"):
        send(dashes(), wire)
    assert wire.written.endswith(b"\nM112\n" * 3)
    assert_dark(device)


def test_a_long_move_is_waited_for_since_the_controller_says_that_it_is_busy() -> None:
    device = new_device()
    job = Job("slow.nc", "M5\nG21\nG90\nM4 I S0\nG1 X30 S9 F60\nG1 X60 S9 F60\nM5 I\nM5\n")
    assert send(job, Wire(device)).seconds == pytest.approx(60.0, abs=1.0)
    assert [round(s.x1) for s in device.beam_log] == [30, 60]


def test_nothing_that_answers_is_no_marlin() -> None:
    class Mute(Wire):
        def read(self, timeout: float) -> bytes:
            super().read(timeout)
            return b""

    with pytest.raises(PortError, match="Nothing that speaks Marlin answers at virtual"):
        send(dashes(), Mute(new_device()))


def test_homing_and_a_stated_place_come_first() -> None:
    device = new_device()
    wire = Wire(device)
    deliver(
        plan_job(dashes(2), MACHINE, SendOptions(home=True, at=(5.0, 6.0))), wire, StopSignals()
    )
    assert device.homed == 1
    assert wire.written.index(b"G28XY*") < wire.written.index(b"G92X5.000Y6.000*")


@pytest.mark.parametrize("at", [None, (10.0, 10.0)])
def test_a_board_that_kept_inches_and_relative_moves_is_put_into_mm(
    at: tuple[float, float] | None,
) -> None:
    """The modes are on the wire before a place is stated and before the job."""
    device = new_device()
    device.receive(b"G20\nG91\n")
    device.advance(1.0)
    device.take_output()
    wire = Wire(device)
    job = Job("a.nc", "M4 I S0\nG0 X20 Y20 S0 F3000\nG1 X30 S200 F1000\nM5 I\nM5\n")
    deliver(plan_job(job, MACHINE, SendOptions(at=at)), wire, StopSignals())
    (burnt_one,) = device.beam_log
    x, y = (0.0, 0.0) if at is None else at
    assert (burnt_one.x0, burnt_one.y0) == pytest.approx((20 - x, 20 - y), abs=0.01)
    assert burnt_one.x1 == pytest.approx(30 - x, abs=0.01)
    sent = wire.written
    stated = sent.index(b"G92X10.000Y10.000*") if at else sent.index(b"M4IS0*")
    assert sent.index(b"G21*") < sent.index(b"G90*") < stated


class Pressed:
    """Keys pressed at their times."""

    def __init__(self, device: VirtualMarlin, **keys: float) -> None:
        self._device, self._keys = device, {k: k for k in keys} | {"space": " "}
        self._due = sorted((at, self._keys[name]) for name, at in keys.items())

    def pressed(self) -> str:
        now = "".join(key for at, key in self._due if at <= self._device.now)
        self._due = [(at, key) for at, key in self._due if at > self._device.now]
        return now


def test_space_holds_and_r_goes_on() -> None:
    device = new_device()
    states: list[str] = []
    send(
        dashes(),
        Wire(device),
        keys=Pressed(device, space=3.0, r=20.0),
        on_progress=lambda progress: states.append(progress.state),
    )
    assert "Hold" in states
    assert burnt(device) == WHOLE
    ends = [s.t1 for s in device.beam_log]
    assert max(b - a for a, b in pairwise(ends)) > 12.0


def test_q_halts() -> None:
    device = new_device()
    with pytest.raises(JobStopped, match=r"stopped at the keyboard.*halted"):
        send(dashes(), Wire(device), keys=Pressed(device, q=4.0))
    assert_dark(device)


def test_whoever_finds_the_machine_at_work_halts_it() -> None:
    device = new_device()
    device.receive(b"M4 I S0\nG1 X100 S200 F600\n")
    device.advance(2.0)
    assert device.beam_on
    assert "halted (M112)" in make_safe(MACHINE, Wire(device))
    assert_dark(device)


def test_it_is_served_as_a_practice_machine() -> None:
    assert isinstance(load_controller(MACHINE.name), VirtualMarlin)
    assert isinstance(load_controller("hpgl-cutter-a3"), VirtualPlotter)
    assert isinstance(load_controller(MACHINE.name, parse_faults(["reset@1s"])), FaultyDevice)
    for fault in ("alarm@1s", "stall@1s"):
        with pytest.raises(ProfileError, match=r"speaks marlin, and only .* have the fault '"):
            load_controller(MACHINE.name, parse_faults([fault]))


def serve(device: VirtualMarlin, wire: PtyWire, stop: threading.Event, speed: float) -> None:
    start = time.monotonic()
    while not stop.is_set():
        data, opened = wire.wait(0.002)
        device.advance(max(0.0, (time.monotonic() - start) * speed - device.now))
        if opened:
            device.power_cycle()
        if data:
            device.receive(data)
        output = device.take_output()
        if output:
            wire.write(output)


def test_over_a_pseudo_terminal_the_command_cuts_it(tmp_path: Path) -> None:
    device, wire, stop = new_device(), PtyWire(), threading.Event()
    thread = threading.Thread(target=serve, args=(device, wire, stop, 20.0))
    thread.start()
    try:
        result = stream_plan(plan_job(dashes(), MACHINE), wire.address)
    finally:
        stop.set()
        thread.join()
        wire.close()
    assert result.lines == 7 + 2 * DASHES
    assert burnt(device) == WHOLE


def test_the_command_cuts_on_the_virtual_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "dashes.nc"
    file.write_text(dashes().text)
    command = ["miurafab", "cut", str(file), "--machine", MACHINE.name, "--port", "virtual"]
    for arguments, code in (((), 0), (("--check-mode",), 2)):
        monkeypatch.setattr(sys, "argv", [*command, "--json", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        assert (ended.value.code or 0) == code
        capsys.readouterr()


@pytest.mark.parametrize(("dash", "gap", "feed"), [(0.3, 0.2, 6000), (2.0, 1.0, 1500)])
def test_the_estimate_knows_that_lines_go_one_by_one(dash: float, gap: float, feed: int) -> None:
    lines = ["M5", "G21", "G90", "M4 I S0"]
    for n in range(150):
        x, y = 10 + (dash + gap) * (n % 50), 10 + n // 50
        lines += [f"G0 X{x:g} Y{y} S0 F9000", f"G1 X{x + dash:g} Y{y} S200 F{feed}"]
    job = Job("estimate.nc", "\n".join([*lines, "M5 I", "M5", ""]))
    took = send(job, Wire(new_device())).seconds
    told = dry_run("estimate", job, MACHINE, (220.0, 220.0)).seconds
    assert took == pytest.approx(told, rel=0.06, abs=0.2)
