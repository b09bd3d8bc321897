"""How long the controller's processor takes for its work, in clock cycles.

GRBL runs on an ATmega328P at 16 MHz without a floating-point unit. Short moves are limited by
how fast it can parse, plan and prepare them, so that time is part of the motion. Each cost below
is the number of operations that the firmware does there (``gcode.c``, ``planner.c``,
``stepper.c``, ``nuts_bolts.c``, ``serial.c`` of 1.1h) times what one costs: the averages of
avr-libc's benchmark table for cores with a multiplier (manual, "Benchmarks"), plus the cycles
to load two 4-byte operands, call, and store the result (AVR instruction set: 2 cycles a byte
each way, 8 for call and return).

The interrupts take their share while such work goes on: see :data:`STEP_TICK`.
"""

from __future__ import annotations

import math

from miurafab.gcode.numbers import single

CLOCK = 16_000_000
"""Cycles a second."""

DWELL_STEP = CLOCK // 20
"""A dwell is a number of these, 50 ms each (``config.h``)."""

_OPERANDS = 30
ADD = 102 + _OPERANDS
MULTIPLY = 129 + _OPERANDS
DIVIDE = 469 + _OPERANDS
ROOT = 474 + _OPERANDS // 2
ROUND = 120 + _OPERANDS // 2
CONVERT = 90 + _OPERANDS // 2
COMPARE = 40 + _OPERANDS // 2

# The stepper interrupt saves and restores 18 registers (about 90 cycles with entry and exit),
# adds and compares a 32-bit counter for each of three axes (about 50 each), moves a 32-bit
# position where an axis steps (about 45), sets ports and timers (about 50), and is followed by
# the short interrupt that ends the pulse (about 35).
STEP_TICK = 350
"""Cycles of one stepper interrupt with its pulse end."""

CHARACTER = 90 + 80
"""Receiving a byte in the interrupt, then taking it from the ring and filtering it."""
ANSWER_BYTE = 100
"""Printing a byte to the ring, and sending it in the interrupt."""

_WORD_FIXED = 2 * ROUND + 4 * CONVERT + ADD + MULTIPLY + 100
_DIGIT = 65
LINE_FIXED = 2 * ADD + 3 * COMPARE + 1200
"""A G-code line besides its words: clearing the block, the checks, updating the modes."""


def words_cost(words: int, characters: int, points: int) -> int:
    """Reading a line's words: ``characters`` in all, ``points`` numbers with decimals."""
    digits = max(characters - words, 0)
    return words * _WORD_FIXED + digits * _DIGIT + points * 2 * MULTIPLY


def dwell_steps(seconds: float) -> int:
    """How many times 50 ms a dwell of ``seconds`` lasts."""
    return math.ceil(single(20.0 * single(seconds))) & 0xFFFF


_LENGTH = 3 * COMPARE + 2 * (MULTIPLY + ADD) + ROOT + DIVIDE + 3 * MULTIPLY
_AXIS_LIMIT = 3 * COMPARE + 2 * (DIVIDE + COMPARE)
PLAN_LINE = (
    3 * (MULTIPLY + ROUND + CONVERT + COMPARE)
    + 2 * DIVIDE
    + _LENGTH
    + 2 * _AXIS_LIMIT
    + 2 * (MULTIPLY + 2 * ADD)
    + CONVERT
    + 3 * MULTIPLY
    + 6 * COMPARE
    + 800
)
"""Planning one line: steps, direction, limits along it, and the angle to the line before."""
PLAN_CORNER = _LENGTH + _AXIS_LIMIT + 2 * ADD + 3 * MULTIPLY + DIVIDE + ROOT + COMPARE
"""The junction speed, where the lines do not run straight on."""
PLAN_NEWEST = 2 * MULTIPLY + COMPARE + 60
PLAN_BACKWARD = 2 * MULTIPLY + ADD + 2 * COMPARE + 40
PLAN_FORWARD = 2 * COMPARE + 40
PLAN_FORWARD_RISING = 2 * MULTIPLY + ADD + COMPARE
"""One block in the backward and in the forward pass, the latter more where speed rises."""

ARC_SETUP = 2882 + ROOT + 4 * DIVIDE + 12 * MULTIPLY + 8 * ADD
"""An arc before its first chord: its angle, and how many chords."""
ARC_CHORD = 5 * MULTIPLY + 5 * ADD + (4 * MULTIPLY + 2 * ADD + 2 * 1760) // 12 + 200
"""Turning the radius by one chord, every twelfth time by sine and cosine (``mc_arc``)."""

LOAD_BLOCK = CONVERT + 2 * DIVIDE + ROOT + 350
LOAD_RATE = DIVIDE
"""Taking up a block for stepping, and more where power follows the speed."""
PROFILE = DIVIDE + ROOT + CONVERT + 6 * MULTIPLY + 6 * ADD + 7 * COMPARE + 150
"""Laying the speed profile over the rest of a block."""
SEGMENT = 5 * ADD + 3 * MULTIPLY + DIVIDE + 3 * ROUND + 2 * CONVERT + 4 * COMPARE + 500
RAMP = 3 * MULTIPLY + 4 * ADD + 4 * COMPARE
RAMP_END = DIVIDE + MULTIPLY + 2 * ADD
SEGMENT_POWER = 5 * MULTIPLY + ADD + ROUND + 2 * CONVERT + 3 * COMPARE
"""One segment, each ramp that it runs over, the end of a ramp, and its power."""
REALTIME = 200
"""One look at the flags."""
