"""Dashes in chains of relative moves: chosen where the wire is the limit, and the same strokes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from test_posting import CARD, LASER, PERFORATE, joined, toolpath, toolpaths
from worked import changed

import miurafab.posting.make_job as posting
from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import strokes
from miurafab.machine.journal import JournalRun
from miurafab.machine.planning import plan_job
from miurafab.machine.resume import resume
from miurafab.machine.sender import stream_plan
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.posting import post
from miurafab.posting.relative_moves import LONGEST_CHAIN, LONGEST_GAP
from miurafab.profiles import OPERATIONS, MachineProfile, Material, load_machine
from miurafab.workflow.dry_run import dry_run


@contextmanager
def always_chained() -> Iterator[None]:
    with (
        mock.patch.object(posting, "_wire_is_short", return_value=True),
        mock.patch.object(posting, "_WORTH_IT", np.inf),
    ):
        yield


@contextmanager
def never_chained() -> Iterator[None]:
    with mock.patch.object(posting, "_wire_is_short", return_value=False):
        yield


def perforation(count: int, cut: float, gap: float) -> Toolpath:
    """A slanted line of dashes, 250 mm to a row."""
    direction = np.array([np.cos(0.3), np.sin(0.3)])
    row, place = np.divmod(np.arange(count), int(250 / (cut + gap)))
    starts = place[:, None] * (cut + gap) * direction + np.array([5.0, 5.0])
    starts[:, 1] += 2.0 * row
    lines = np.stack([starts, starts + cut * direction], axis=1)
    return toolpath([[tuple(p) for p in line] for line in lines], [PERFORATE] * count)


def perforated_at(feed: float) -> Material:
    return changed(CARD, perforate={"feed_mm_min": feed})


def on_a_wire(machine: MachineProfile, baud: int) -> MachineProfile:
    return replace(machine, controller=replace(machine.controller, baud=baud))


def seconds(text_of: Toolpath, machine: MachineProfile, material: Material) -> float:
    job = post(text_of, machine, material)
    link = Link(baud=machine.controller.baud, rx_bytes=machine.controller.rx_bytes)
    return estimate(parse_program(job), MotionParameters.from_profile(machine), link).seconds


@given(toolpaths().map(joined))
@settings(max_examples=40, derandomize=True, deadline=None)
def test_read_back_it_is_the_same_strokes(path: Toolpath) -> None:
    with always_chained():
        program = parse_program(post(path, LASER, CARD))
    read = strokes(program)
    assert np.array_equal(read.offsets, path.offsets)
    assert np.abs(read.points[:, :2] - path.points).max(initial=0.0) <= 1e-3
    for index in range(len(path)):
        operation = CARD.on(LASER).operations[OPERATIONS[path.operation[index]]]
        moves = slice(read.first_move[index], read.last_move[index] + 1)
        assert (program.power[moves] == round(100 * operation.power)).all()
        assert (program.feed_mm_min[moves] == operation.feed_mm_min).all()
        assert read.contexts[read.context[index]].operation == OPERATIONS[path.operation[index]]


def test_a_chain_says_steps_and_every_chain_where_it_begins() -> None:
    path = toolpath(
        [[(10, 10), (10.3, 10)], [(10.5, 10), (10.8, 10.1)], [(10.8, 10.1), (10.8, 9)],
         [(50, 50), (49.5, 50)]],
        [PERFORATE] * 4,
    )  # fmt: skip
    with always_chained():
        lines = post(path, LASER, CARD).text.splitlines()
    assert lines[lines.index("(patch 0)") + 1 :] == [
        *["G90G0X10Y10", "G91G1X.3S700F1500", "X.2S0", "X.3Y.1S700", "Y-1.1"],
        *["G90G0X50Y50", "G91G1X-.5S700F1500"],
        *["G90", "M5", "G0 X0 Y0", "M2"],
    ]


def test_no_chain_is_longer_than_its_sums_are_good() -> None:
    with always_chained():
        text = post(perforation(1000, 0.3, 0.2), LASER, CARD).text
    assert text.count("G90G0") >= 1000 // LONGEST_CHAIN
    assert all(len(line) < 30 for line in text.splitlines())
    far = toolpath([[(0, 0), (1, 0)], [(2 + LONGEST_GAP / 1000, 0), (9, 0)]], [PERFORATE] * 2)
    with always_chained():
        assert post(far, LASER, CARD).text.count("G90G0") == 2


@pytest.mark.parametrize(
    ("baud", "cut", "gap", "feed", "chained"),
    [
        (115_200, 1.2, 0.8, 1500, False),
        (115_200, 0.3, 0.2, 1500, False),
        (38_400, 1.2, 0.8, 1500, False),
        (38_400, 0.3, 0.2, 6000, True),
        (19_200, 0.3, 0.2, 6000, True),
    ],
)
def test_chains_are_chosen_where_the_wire_is_the_limit(
    baud: int, cut: float, gap: float, feed: float, chained: bool
) -> None:
    machine, material = on_a_wire(LASER, baud), perforated_at(feed)
    path = perforation(300, cut, gap)
    assert ("G91" in post(path, machine, material).text) == chained
    with never_chained():
        hopping = seconds(path, machine, material)
    assert (seconds(path, machine, material) < 0.98 * hopping) == chained


def test_only_a_beam_that_laser_mode_darkens_is_chained() -> None:
    for name in ("grbl09-laser-300", "marlin-laser-220", "grbl-pen-a4"):
        with always_chained():
            job = post(perforation(20, 0.3, 0.2), load_machine(name), CARD)
        assert "G91" not in job.text


def test_the_virtual_controller_takes_chains() -> None:
    machine = on_a_wire(LASER, 19_200)
    job = post(perforation(200, 0.3, 0.2), machine, perforated_at(6000))
    assert "G91" in job.text
    assert stream_plan(plan_job(job, machine), "virtual").errors == ()


@pytest.mark.parametrize("taken", [40, 130, 131, 180, 300])
def test_a_chain_can_be_taken_up_in_its_middle(taken: int) -> None:
    with always_chained():
        job = post(perforation(200, 0.3, 0.2), LASER, CARD)
    whole = strokes(parse_program(job))
    run = JournalRun(job.name, job.sha256, LASER.name, "virtual", 400, taken=taken, line=taken)
    rest = resume(job, LASER, [run])
    made = strokes(parse_program(rest.job))
    assert len(made) == len(whole) - rest.stroke
    assert made.points == pytest.approx(whole.points[whole.offsets[rest.stroke] :], abs=1e-3)


def test_the_preview_says_that_moves_are_relative() -> None:
    path = perforation(200, 0.3, 0.2)
    with always_chained():
        job = post(path, LASER, CARD)
    number = next(n for n, line in enumerate(job.iter_lines(), 1) if line.startswith("G91"))
    seen = dry_run("sheet-01", job, LASER, (300.0, 300.0))
    (finding,) = seen.findings
    assert (finding.code, finding.severity) == ("relative", "note")
    assert finding.where == f"{job.name}:{number}"
    assert f"line {number} begins relative moves (G91)" in finding.sentence
    plain = Job("a", "(G91)\nG1 F9 X1 ; G91\nG91.1\nG90\n")
    assert not any("relative" in w for w in dry_run("a", plain, LASER, (300.0, 300.0)).warnings)
