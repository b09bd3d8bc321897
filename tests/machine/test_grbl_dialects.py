"""The sender against each firmware that speaks GRBL, as its profile says it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dashes import STROKES, burnt, dashes
from wires import FakeWire

from miurafab.errors import ControllerError, JobStopped, MachineError
from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.resume import resume
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import MachineProfile, load_machine
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.simulate.grbl.dialect import DIALECTS

PROFILES = ("grbl-laser-400", "grbl09-laser-300", "grblhal-laser-600", "fluidnc-laser-600")


@pytest.fixture(params=PROFILES)
def machine(request: pytest.FixtureRequest) -> MachineProfile:
    return load_machine(request.param)


def new_wire(machine: MachineProfile, *faults: str, latency: float = 0.0) -> FakeWire:
    device = VirtualGrbl(
        virtual_settings(machine),
        baud=machine.controller.baud,
        dialect=machine.dialect,
        faults=parse_faults(faults),
    )
    return FakeWire(device, latency=latency)


def job_for(machine: MachineProfile) -> Job:
    """The 200 dashes; without laser mode the beam is switched at each."""
    job = dashes("absolute")
    if machine.tool.beam_mode == "M4":
        return job
    lines = []
    for line in job.text.replace("M4 S0\n", "").splitlines():
        lines += ["M3 S500", line.replace(" S500", ""), "M5"] if line.startswith("G1") else [line]
    return Job(job.name, "\n".join([*lines, ""]))


def test_no_dialect_is_left_out() -> None:
    assert {load_machine(name).dialect for name in PROFILES} == DIALECTS.keys()


@pytest.mark.parametrize("latency", [0.0, 0.016])
def test_a_job_is_done_whole_and_no_byte_is_lost(
    machine: MachineProfile, latency: float, tmp_path: Path
) -> None:
    wire = new_wire(machine, latency=latency)
    job = job_for(machine)
    plan = plan_job(job, machine, SendOptions(allow_m3=True))
    result = deliver(plan, wire, StopSignals(), journal_path=tmp_path / "j")
    assert result.lines == plan.lines
    assert wire.device.lost_bytes == 0
    counts = burnt(dashes("absolute"), [wire.device.beam_log])
    assert all(counts[index] + counts[1000 + index] == 1 for index in range(STROKES))
    blocks = {"grbl-1.1": 15, "grblhal": 35}.get(machine.dialect)
    assert read_journal(tmp_path / "j")[-1].blocks == blocks


def test_the_buffer_is_filled_and_never_overrun(machine: MachineProfile) -> None:
    """One byte more in flight than the profile says would be lost."""
    size = DIALECTS[machine.dialect].rx_bytes
    assert size - 1 <= machine.controller.rx_bytes <= size
    flood = Job("flood.nc", "G1 X0.4 F30\n" + "G1 X0.5\nG1 X0.4\n" * 400)
    for rx_bytes, lost in ((machine.controller.rx_bytes, False), (size + 40, True)):
        wire = new_wire(machine)
        stop = StopSignals()
        wire.before_call = lambda call, w=wire, s=stop: setattr(
            s, "caught", "SIGINT" if w.device.now > 4 else None
        )
        # Where $I tells the size, that counts, and no profile can spoil it.
        told = machine.dialect in ("grbl-1.1", "grblhal")
        other = replace(machine, controller=replace(machine.controller, rx_bytes=rx_bytes))
        with pytest.raises((JobStopped, ControllerError)):
            deliver(plan_job(flood, other, SendOptions(allow_m3=True)), wire, stop)
        assert (wire.device.lost_bytes > 0) == (lost and not told)


@pytest.mark.parametrize("fault", ["reset@4s", "alarm@4s", "power@4s", "disconnect@4s"])
def test_a_fault_ends_it_and_it_goes_on(
    machine: MachineProfile, fault: str, tmp_path: Path
) -> None:
    wire, job = new_wire(machine, fault), job_for(machine)
    journal = tmp_path / "journal"
    plan = plan_job(job, machine, SendOptions(at=(0.0, 0.0), allow_m3=True))
    with pytest.raises(MachineError, match=r"restarted|ALARM|Hard limit|went away|Abort"):
        deliver(plan, wire, StopSignals(), journal_path=journal)
    wire.settle(120.0)
    if fault.startswith("disconnect") and machine.tool.beam_mode == "M3":
        return  # what M3 does then is why it must be allowed
    assert not wire.device.beam_on
    if machine.tool.beam_mode == "M3":
        return
    rest = resume(job, machine, read_journal(journal))
    again = new_wire(machine)
    plan = plan_job(job, machine, SendOptions(at=(0.0, 0.0)), resumption=rest)
    deliver(plan, again, StopSignals(), journal_path=journal)
    counts = burnt(job, [wire.device.beam_log, again.device.beam_log])
    assert all(counts[index] for index in range(STROKES))
    twice = {index % 1000 for index, count in counts.items() if count > 1 or index >= 1000}
    assert twice <= set(range(rest.stroke, rest.new_stroke))


def test_a_refused_line_is_told_in_the_firmwares_own_words() -> None:
    machine = load_machine("grbl09-laser-300")
    job = Job("bad.nc", "G21\nG1 X5 F100\nG99\n")
    plan = plan_job(job, machine, SendOptions(force=frozenset({"program"})))
    with pytest.raises(ControllerError, match=r"bad\.nc, line 3 \('G99'\): Unsupported command"):
        deliver(plan, new_wire(machine), StopSignals())


def test_keys_that_a_firmware_does_not_know_are_not_sent(machine: MachineProfile) -> None:
    """GRBL 0.9 would take the byte of an override for a part of the next line."""

    class Pressed:
        left = "+-]["

        def pressed(self) -> str:
            keys, self.left = (self.left, "") if wire.device.now > 3 else ("", self.left)
            return keys

    wire = new_wire(machine)
    plan = plan_job(job_for(machine), machine, SendOptions(allow_m3=True))
    result = deliver(plan, wire, StopSignals(), keys=Pressed())
    assert result.lines == plan.lines
    sent = sum(byte >= 0x80 for byte in wire.bytes_written)
    # Three more set every override back before the job.
    assert sent == (0 if machine.dialect == "grbl-0.9" else 3 + 4)


@pytest.mark.parametrize(("port", "most"), [("socket://laser:23", 256), ("/dev/ttyUSB0", 1023)])
def test_over_a_network_a_reset_waits_behind_few_bytes(port: str, most: int) -> None:
    machine = load_machine("grblhal-laser-600")
    text = "M4 S0\n" + "".join(f"G1 X{n % 200} S500 F3000\n" for n in range(1, 300)) + "M5\n"
    wire, seen = new_wire(machine), []
    wire.name = port
    plan = plan_job(Job("job.nc", text), machine)
    deliver(plan, wire, StopSignals(), on_progress=lambda now: seen.append(now.in_flight))
    assert most - 40 < max(seen) <= most
