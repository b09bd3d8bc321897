"""The processing times of the controller's CPU, in clock cycles.

GRBL runs on an ATmega328P at 16 MHz without a floating-point unit. Short moves are limited by the
time to parse, plan and prepare them, so this time is part of the motion.

The costs are measured: GRBL 1.1h, built with avr-gcc 5.4 as its Makefile says, ran a dozen jobs in
an instruction-level simulator (dashes of 0.2 to 5 mm, circles of short chords, grey scales, arcs).
The mean cycles between entering and leaving ``gc_execute_line``, ``plan_buffer_line``,
``planner_recalculate``, ``st_prep_buffer`` and the interrupts were attributed to their steps by
least squares; the cycles of interrupts inside a function are excluded. Sums vary by up to 3 % with
the digits of the numbers. Interrupts slow this work down: see :data:`STEP_TICK`.
"""

from __future__ import annotations

import math

from miurafab.gcode.numbers import single

CLOCK = 16_000_000
"""Cycles a second."""

DWELL_STEP = CLOCK // 20
"""The unit of a dwell, 50 ms (``config.h``)."""

STEP_TICK = 326
STEP_AXIS = 16
"""One stepper interrupt with its pulse end, and the addition for each moving axis."""

CHARACTER = 105 + 70
"""Receive a byte in the interrupt, then take it from the ring and filter it."""
ANSWER_BYTE = 115
"""Print a byte to the ring, and send it in the interrupt."""

LINE_FIXED = 1370 + 2 * 210
"""A G-code line without its words; realtime flags are checked before and after it."""
_WORD = 960
_DIGIT = 84
_DECIMALS = 550


def words_cost(words: int, characters: int, points: int) -> int:
    """Cycles to read a line with ``characters`` in total and ``points`` numbers with decimals."""
    digits = max(characters - words, 0)
    return words * _WORD + digits * _DIGIT + points * _DECIMALS


_LONGEST_DWELL = 1e30
"""More seconds are as good as these: both are taken modulo 2^16 steps."""


def dwell_steps(seconds: float) -> int:
    """The number of 50 ms units in a dwell of ``seconds``."""
    return math.ceil(single(20.0 * single(min(seconds, _LONGEST_DWELL)))) & 0xFFFF


PLAN_LINE = 4800
PLAN_AXIS = 2350
"""Plan one line, and the addition for each moving axis."""
PLAN_CORNER = 3200
PLAN_CORNER_AXIS = 950
"""Compute the junction speed at a corner, and the addition for each axis that changes."""
PLAN_NEWEST = 600
PLAN_BLOCK = 690
PLAN_RISING = 490
"""Replan: the newest block; each other block, both passes; each block that must speed up."""

ARC_SETUP = 7000
"""Prepare an arc: its angle and its number of chords."""
ARC_CHORD = 1850
"""Rotate the radius by one chord, every twelfth time with sine and cosine (``mc_arc``)."""

LOAD_BLOCK = 500
LOAD_RATE = 500
"""Load a block for stepping, and the addition if power follows the speed."""
PROFILE = 2000
"""Compute the speed profile for the rest of a block."""
SEGMENT = 2520
ROUND = 1300
RAMP_END = 2400
"""One segment; each piece of constant acceleration in it; each end of a ramp in it."""
POWER = 950
"""Compute the power of a segment."""
