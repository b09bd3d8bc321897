"""A long job takes no more memory while it is sent than a short one."""

from __future__ import annotations

import gc
import tracemalloc
from pathlib import Path

import pytest

from miurafab.gcode import reading
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.machine import judge_job
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.sender import stream_plan
from miurafab.profiles import load_machine

MACHINE = load_machine("grbl-laser-400")


def job(lines: int) -> Job:
    """Dashes in rows, ``lines`` of them in all."""
    rows = ["G21", "G90", "M4S0", "F6000"]
    for n in range((lines - 6) // 2):
        x, y = 10 + 0.5 * (n % 700), 10 + 0.5 * (n // 700 % 700)
        rows += [f"G0X{x:g}Y{y:g}", f"G1X{x + 0.3:g}S500"]
    return Job("long.nc", "\n".join([*rows, "M5", "G0X0Y0", ""]))


def streaming_growth(lines: int, folder: Path, *, check_mode: bool) -> int:
    """Bytes that the sender (and the controller in memory) hold more late than early on."""
    plan = plan_job(job(lines), MACHINE, SendOptions(check_mode=check_mode))
    held: list[int] = []

    def note(progress: Progress) -> None:
        gc.collect()
        held.append(tracemalloc.get_traced_memory()[0])

    # What is there already need not be looked through each time. It stays frozen, as conftest.py
    # freezes it: a collection of all that the tests hold takes half a second.
    gc.freeze()
    tracemalloc.start()
    try:
        result = stream_plan(
            plan,
            "virtual",
            journal_path=folder / "long.journal",
            on_progress=note,
        )
    finally:
        tracemalloc.stop()
    assert result.lines == lines
    return max(held[len(held) // 2 :]) - held[len(held) // 4]


@pytest.mark.parametrize("check_mode", [True, False])
def test_memory_does_not_grow_while_a_job_is_sent(tmp_path: Path, check_mode: bool) -> None:
    assert streaming_growth(2000, tmp_path, check_mode=check_mode) < 13_000


@pytest.mark.large
def test_forty_thousand_lines_take_no_more_memory_than_a_few(tmp_path: Path) -> None:
    assert streaming_growth(40_000, tmp_path, check_mode=True) < 20_000


def test_a_job_is_read_once_from_the_plan_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    reads: list[str] = []

    def read(job: Job, machine: object) -> Program:
        reads.append(job.name)
        return reading.read_program(job, MACHINE)

    monkeypatch.setattr(judge_job, "read_program", read)
    stream_plan(plan_job(job(20), MACHINE), "virtual")
    assert reads == ["long.nc"]
    judged = judge_job.judge_job(job(20), MACHINE)
    stream_plan(plan_job(job(20), MACHINE, judged=judged), "virtual")
    assert reads == ["long.nc"] * 2
