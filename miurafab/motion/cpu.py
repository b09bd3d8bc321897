"""How long the controller's processor takes for its work, in clock cycles.

GRBL runs on an ATmega328P at 16 MHz without a floating-point unit. Short moves are limited by
how fast it can parse, plan and prepare them, so that time is part of the motion.

The costs are measured: GRBL 1.1h, built with avr-gcc 5.4 as its Makefile says, in an
instruction-level simulator; the mean cycles between entering and leaving ``gc_execute_line``,
``plan_buffer_line``, ``planner_recalculate``, ``st_prep_buffer`` and the interrupts over a dozen
jobs (dashes of 0.2 to 5 mm, circles of short chords, grey scales, arcs), interrupts not counted,
spread over what each did by least squares. Sums differ by up to 3 % with the digits of the numbers.

The interrupts take their share while such work goes on: see :data:`STEP_TICK`.
"""

from __future__ import annotations

import math

from miurafab.gcode.numbers import single

CLOCK = 16_000_000
"""Cycles a second."""

DWELL_STEP = CLOCK // 20
"""A dwell is a number of these, 50 ms each (``config.h``)."""

STEP_TICK = 326
STEP_AXIS = 16
"""Cycles of one stepper interrupt with its pulse end, and more for each axis that moves."""

CHARACTER = 105 + 70
"""Receiving a byte in the interrupt, then taking it from the ring and filtering it."""
ANSWER_BYTE = 115
"""Printing a byte to the ring, and sending it in the interrupt."""

LINE_FIXED = 1370 + 2 * 210
"""A G-code line besides its words, with the two looks at the flags before and after it."""
_WORD = 960
_DIGIT = 84
_DECIMALS = 550


def words_cost(words: int, characters: int, points: int) -> int:
    """Reading a line's words: ``characters`` in all, ``points`` numbers with decimals."""
    digits = max(characters - words, 0)
    return words * _WORD + digits * _DIGIT + points * _DECIMALS


def dwell_steps(seconds: float) -> int:
    """How many times 50 ms a dwell of ``seconds`` lasts."""
    return math.ceil(single(20.0 * single(seconds))) & 0xFFFF


PLAN_LINE = 4800
PLAN_AXIS = 2350
"""Planning one line, and more for each axis that moves."""
PLAN_CORNER = 3200
PLAN_CORNER_AXIS = 950
"""The junction speed where a line does not run straight on, and for each axis that changes."""
PLAN_NEWEST = 600
PLAN_BLOCK = 690
PLAN_RISING = 490
"""Planning anew: the newest block; each other, there and back; more where speed must rise."""

ARC_SETUP = 7000
"""An arc before its first chord: its angle, and how many chords."""
ARC_CHORD = 1850
"""Turning the radius by one chord, every twelfth time by sine and cosine (``mc_arc``)."""

LOAD_BLOCK = 500
LOAD_RATE = 500
"""Taking up a block for stepping, and more where power follows the speed."""
PROFILE = 2000
"""Laying the speed profile over the rest of a block."""
SEGMENT = 2520
ROUND = 1300
RAMP_END = 2400
"""One segment, each stretch of a ramp or of steady speed that it runs over, and a ramp's end."""
POWER = 950
"""The power of a segment."""
