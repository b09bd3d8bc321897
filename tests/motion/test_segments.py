"""Segments: every step made once, in the time that physics says, and Bresenham's line closed."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_planner import ACCELERATION, machine

from miurafab.motion import cpu
from miurafab.motion.planner import Move, Planner
from miurafab.motion.segments import MICRO, Segment, SegmentGenerator
from miurafab.motion.stepper import Processor, Stepper, steps_taken


def generate(planner: Planner, pwm: int = 1) -> list[Segment]:
    generator = SegmentGenerator(planner, lambda word: pwm if word else 0)
    return list(iter(generator.next, None))


def seconds(segments: list[Segment]) -> float:
    return sum(segment.cycles for segment in segments) / cpu.CLOCK


def trapezoid(length: float, speed: float) -> float:
    """From rest to rest over ``length``: ramps of v/a each, or the triangle of 2 sqrt(l/a)."""
    if length < speed * speed / ACCELERATION:
        return 2 * math.sqrt(length / ACCELERATION)
    return length / speed + speed / ACCELERATION


@given(st.integers(80, 40000), st.floats(2, 200))
def test_one_move_takes_the_time_of_its_trapezoid(steps: int, speed: float) -> None:
    planner = Planner(machine())
    planner.append((steps / 80, 0, 0), 60 * speed)
    segments = generate(planner)
    expected = trapezoid(steps / 80, speed)
    # Each segment's step rate is rounded up to a whole number of cycles, and to AMASS's ticks.
    assert seconds(segments) == pytest.approx(expected, rel=2e-3, abs=1e-4)


targets = st.lists(
    st.tuples(st.integers(-200, 200), st.integers(-200, 200)), min_size=1, max_size=15
)


@given(targets, st.sampled_from([300.0, 3000.0, 12000.0]))
def test_every_step_is_made_once(points: list[tuple[int, int]], feed: float) -> None:
    planner = Planner(machine())
    for x, y in points:
        planner.append((x / 80, y / 80, 0), feed)
    end = planner.position
    planned = list(planner.moves)
    at: tuple[int, ...] = (0, 0, 0)
    done = dict.fromkeys(map(id, planned), 0)
    for segment in generate(planner):
        assert segment.ticks > 0
        assert segment.done == done[id(segment.move)]
        done[id(segment.move)] += segment.ticks * segment.stride
        at = steps_taken(segment.move, done[id(segment.move)])
    assert at == end
    assert list(done.values()) == [MICRO * move.events for move in planned]


def test_power_that_follows_the_speed_falls_to_nothing_at_rest() -> None:
    planner = Planner(machine())
    planner.append((5, 0, 0), 3000, spindle=4, speed_word=1000)
    generator = SegmentGenerator(planner, lambda word: round((word or 0) * 0.255))
    powers = [segment.power for segment in iter(generator.next, None)]
    assert max(powers) == 255
    assert powers[-1] == 0
    assert powers[0] < powers[1] < powers[2]


def test_constant_power_is_constant() -> None:
    planner = Planner(machine())
    planner.append((5, 0, 0), 3000, spindle=3, speed_word=1000)
    assert {segment.power for segment in generate(planner, 200)} == {200}


def test_a_hold_brakes_as_fast_as_it_may_and_can_go_on() -> None:
    planner = Planner(machine())
    planner.append((20, 0, 0), 3000)
    generator = SegmentGenerator(planner, lambda word: 0)
    made = [generator.next() for _ in range(10)]
    speed, left = generator.speed / 60, planner.moves[0].length
    generator.hold()
    made += list(iter(generator.next, None))
    braked = left - planner.moves[0].length
    assert braked == pytest.approx(speed * speed / 2 / ACCELERATION, abs=2 / 80)
    generator.resume()
    planner.restart()
    made += list(iter(generator.next, None))
    assert sum(segment.ticks * segment.stride for segment in made if segment) == 1600 * MICRO


@given(st.integers(-300, 300), st.integers(-300, 300), st.integers(-300, 300), st.integers(0, 3))
def test_the_closed_line_is_bresenhams(x: int, y: int, z: int, level: int) -> None:
    move = Move()
    move.steps, move.events = (x, y, z), max(abs(x), abs(y), abs(z))
    if not move.events:
        return
    whole = move.events * MICRO
    counters, made = [whole // 2] * 3, [0, 0, 0]
    stride = MICRO >> level
    for micro in range(stride, whole + 1, stride):
        for axis, n in enumerate(move.steps):
            counters[axis] += abs(n) * stride
            if counters[axis] > whole:
                counters[axis] -= whole
                made[axis] += 1 if n > 0 else -1
        assert steps_taken(move, micro) == tuple(made)
    assert tuple(made) == move.steps


def test_the_processor_is_slowed_by_the_steps_and_stands_still_while_motion_settles() -> None:
    planner = Planner(machine())
    planner.append((10, 0, 0), 6000)
    stepper = Stepper()
    stepper.idle_lock = 400_000
    stepper.queue += generate(planner)[:3]
    total = sum(segment.cycles for segment in stepper.queue)
    processor = Processor(stepper)
    assert processor.run(0, 16_000) == 16_000
    stepper.wake(0)
    slowed = processor.run(0, 16_000)
    tick = (cpu.STEP_TICK + cpu.STEP_AXIS) / stepper.queue[0].period
    assert slowed == math.ceil(16_000 / (1 - tick))
    assert processor.run(total - 1, 16_000) > total + 400_000
    assert stepper.stopped
