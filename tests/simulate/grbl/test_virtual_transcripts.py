"""The simulated controller against recorded answers and job times of the real firmware."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from virtual_player import RECORDED, ready, stream, until_answer

from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import MotionParameters
from miurafab.simulate.beam import standing_seconds

DATA = Path(__file__).parents[2] / "data" / "grbl"
CASES = json.loads((DATA / "transcripts.json").read_text(encoding="utf-8"))
MEASURED = json.loads((DATA / "measured.json").read_text(encoding="ascii"))["jobs"]
_NUMBER = re.compile(r"-?\d+\.?\d*")


def replay(steps: list[dict[str, Any]], lag: float) -> str:
    """The controller's answers, going on ``lag`` seconds after each answer to a line."""
    device, output = ready(), ""
    for step in steps:
        if "line" in step:
            device.receive(step["line"].encode() + b"\n")
            output += until_answer(device)
            device.advance(lag)
        elif "bytes" in step:
            device.receive(step["bytes"].encode("latin-1"))
        else:
            device.advance(step["wait_s"])
        output += device.take_output().decode()
    device.advance(0.3)
    return output + device.take_output().decode()


def alike(found: str, recorded: str) -> bool:
    """Whether the texts are the same but for figures within 5 %."""
    if _NUMBER.sub("#", found) != _NUMBER.sub("#", recorded):
        return False
    pairs = zip(_NUMBER.findall(found), _NUMBER.findall(recorded), strict=True)
    return all(abs(float(a) - float(b)) <= 0.05 * abs(float(b)) for a, b in pairs)


@pytest.mark.parametrize("case", CASES, ids=[case["case"] for case in CASES])
def test_it_answers_as_the_firmware_did(case: dict[str, Any]) -> None:
    steps, recorded = case["steps"], case["reply"]
    if "|FS:" not in recorded or case["case"] not in ("move status", "reset in hold", "jog cancel"):
        assert replay(steps, 0.0) == recorded
        return
    # How soon after an answer the recording went on is unknown: some lag must reproduce it.
    found = {replay(steps, lag / 1000) for lag in range(15)}
    assert any(alike(text, recorded) for text in found), found


@pytest.mark.parametrize(
    ("name", "within"),
    [("A_g0hop.nc", 0.01), ("B_g0hop.nc", 0.01), ("A_m3m5.nc", 0.01), ("S.nc", 0.01)],
)
def test_a_job_takes_as_long_as_it_did(name: str, within: float) -> None:
    job = Job(name, (DATA / name).read_text(encoding="ascii"))
    device = ready(RECORDED)
    seconds = stream(device, [line.data for line in job.send_lines()])
    burnt = sum(segment.t1 - segment.t0 for segment in device.beam_log)
    assert seconds == pytest.approx(MEASURED[name]["seconds"], rel=within)
    assert burnt == pytest.approx(MEASURED[name]["laser_on_seconds"], rel=within)
    assert device.lost_bytes == 0
    if name == "A_m3m5.nc":
        # 600 dashes, after each of which the beam waits for the motors to be let go.
        assert standing_seconds(device.beam_log) == pytest.approx(600 * 0.025, rel=0.01)
    else:
        assert standing_seconds(device.beam_log) == 0


CIRCLE = "".join(f"G2X{20 * (i % 2)}I{-10 * (-1) ** i}F{f}S9\n" for i, f in enumerate((6000, 900)))
MIXED = {
    "zigzag": "M4\n" + "".join(f"G1X{7 * i % 31}Y{5 * i % 29}F3000S500\n" for i in range(60)),
    "arcs": "M4\nG0X20\n" + CIRCLE * 3,
    "grey": "M4F6000\n" + "".join(f"G1X{i / 10}S{37 * i % 1000}\n" for i in range(1, 300)),
    "syncs": "".join(f"G0X{i}\nM8\nG4P0.12\nM9\n" for i in range(1, 20)) + "G0X0\n",
}


@pytest.mark.parametrize("name", MIXED)
def test_the_estimate_foretells_the_virtual_run(name: str) -> None:
    job = Job(name, MIXED[name])
    device = ready(RECORDED)
    seconds = stream(device, [line.data for line in job.send_lines()])
    foretold = estimate(parse_program(job), MotionParameters.from_settings(device.settings))
    assert seconds == pytest.approx(foretold.seconds, rel=0.01, abs=0.02)
    burnt = sum(segment.t1 - segment.t0 for segment in device.beam_log)
    assert burnt == pytest.approx(foretold.beam_on_seconds, rel=0.005, abs=0.001)
