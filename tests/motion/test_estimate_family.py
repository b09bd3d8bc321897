"""The estimate against the motion of the simulated controller, over a family of jobs.

An ideal sender keeps the receive buffer full; the time from the first beam to the last and the time
that the beam is on are held against what the estimate says of the same moves.
"""

from __future__ import annotations

import math
import random
from collections import deque

import numpy as np
import pytest

from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.motion.estimate import Estimate, estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINES = (
    {100: 80, 110: 12_000, 120: 1000},
    {100: 250, 110: 6000, 120: 500},
    {100: 40, 110: 30_000, 120: 3000},
)
"""Steps, rate and acceleration of X; Y and Z are alike."""
ALIKE_S = 0.035
"""A stop, of 25 ms and a few segments, may fall within or without the first and last beam."""


def dashes(chance: random.Random) -> Job:
    dash, gap = chance.choice([0.2, 0.3, 0.5, 0.8, 1.5, 3, 5]), chance.choice([0.2, 0.5, 1, 2])
    mode, hop = chance.choice(["M4", "M4", "M3", "M3M5"]), chance.choice(["G0", "G1"])
    lines = ["G21", "G90", f"F{feed(chance)}", "" if mode == "M3M5" else f"{mode}S0"]
    for n in range(100):
        x, y = 10 + (dash + gap) * (n % 25), 10 + 3 * (n // 25)
        dark = "" if hop == "G0" or mode == "M3M5" else "S0"
        lines.append(f"{hop if n % 25 else 'G0'}X{x:g}Y{y}{dark if n % 25 else ''}")
        if mode == "M3M5":
            lines += ["M3S500", f"G1X{x + dash:g}", "M5"]
        else:
            lines.append(f"G1X{x + dash:g}S500")
    return Job(f"{mode} {hop} {dash}/{gap}", "\n".join([*lines, "M5", "G0X0Y0", ""]))


def arcs(chance: random.Random) -> Job:
    radius = chance.choice([0.5, 1, 3, 8])
    lines = ["G21", "G90", f"F{feed(chance)}", "M4S0"]
    for _ in range(8):
        x, y = chance.uniform(20, 70), chance.uniform(20, 70)
        lines += [f"G0X{x:.3f}Y{y:.3f}", f"G2X{x:.3f}Y{y:.3f}I{radius}J0S400"]
    return Job(f"arcs {radius}", "\n".join([*lines, "M5", ""]))


def circle(chance: random.Random) -> Job:
    radius, chord = chance.choice([2, 10, 30]), chance.choice([0.1, 0.2, 0.5, 1])
    lines = ["G21", "G90", f"F{feed(chance)}", "M4S0", f"G0X{50 + radius}Y50"]
    for n in range(1, 250):
        turn = n * chord / radius
        x, y = 50 + radius * math.cos(turn), 50 + radius * math.sin(turn)
        lines.append(f"G1X{x:.3f}Y{y:.3f}S500")
    return Job(f"circle {radius} by {chord}", "\n".join([*lines, "M5", "G0X0Y0", ""]))


def feed(chance: random.Random) -> int:
    return chance.choice([500, 1000, 2000, 3000, 4500, 6000, 8000])


def burnt(device: VirtualGrbl, job: Job, latency: float) -> tuple[float, float]:
    """Seconds from the first beam to the last, and with the beam on, of an ideal sender."""
    device.advance(1.0)
    device.take_output()
    lines, unanswered, room, said = deque(job.send_lines()), deque[int](), 128, b""
    while lines or unanswered:
        while lines and len(lines[0].data) < room:
            data = lines.popleft().data + b"\n"
            device.receive(data)
            unanswered.append(len(data))
            room -= len(data)
        device.advance_to_line(1.0)
        device.advance(latency)
        said += device.take_output()
        assert b"error" not in said
        for _ in range(said.count(b"ok\r\n")):
            room += unanswered.popleft()
        said = said[said.rfind(b"\n") + 1 :]
    device.advance(1.0)
    log = device.beam_log
    return log[-1].t1 - log[0].t0, sum(segment.t1 - segment.t0 for segment in log)


def between_beams(program: Program, told: Estimate) -> float:
    burning = np.flatnonzero(program.beam_on)
    return float(told.end[burning[-1]] - told.start[burning[0]])


def compare(seed: int) -> tuple[str, float, float]:
    """Job ``seed`` of the family: how far the estimate is off, in parts, beyond ``ALIKE_S``."""
    chance = random.Random(seed)
    chosen, latency = chance.choice(MACHINES), chance.choice([1e-3, 1e-3, 16e-3])
    job = chance.choice([dashes, dashes, dashes, arcs, circle])(chance)
    settings = {n + axis: value for n, value in chosen.items() for axis in range(3)}
    device = VirtualGrbl({11: 0.01, 30: 1000, 32: 1} | settings, baud=115_200)
    span, on = burnt(device, job, latency)
    program = parse_program(job)
    parameters = MotionParameters.from_settings(device.settings)
    told = estimate(program, parameters, Link(latency=latency))
    return (
        f"{job.name} with {chosen} at {latency:g} s",
        max(0.0, abs(between_beams(program, told) - span) - ALIKE_S) / span,
        max(0.0, abs(told.beam_on_seconds - on) - ALIKE_S) / on,
    )


@pytest.mark.parametrize("seed", range(12))
def test_the_estimate_is_within_one_percent(seed: int) -> None:
    name, span, on = compare(seed)
    assert span < 0.01, name
    assert on < 0.01, name


@pytest.mark.large
@pytest.mark.parametrize("seed", range(100, 220))
def test_the_estimate_is_within_one_percent_of_many_more(seed: int) -> None:
    name, span, on = compare(seed)
    assert span < 0.01, name
    assert on < 0.01, name


def test_a_profile_is_estimated_as_its_virtual_machine_runs() -> None:
    machine = load_machine("grbl-laser-400")
    lines = ["G21", "G90", "M4S0", "F6000"]
    for n in range(300):
        lines += [f"G0X{10 + 0.5 * n:g}", f"G1X{10.3 + 0.5 * n:g}S500"]
    job = Job("micro", "\n".join([*lines, "M5", ""]))
    span, on = burnt(VirtualGrbl(virtual_settings(machine), baud=115_200), job, 1e-3)
    program = parse_program(job)
    told = estimate(program, MotionParameters.from_profile(machine))
    assert between_beams(program, told) == pytest.approx(span, rel=0.01)
    assert told.beam_on_seconds == pytest.approx(on, rel=0.005)
