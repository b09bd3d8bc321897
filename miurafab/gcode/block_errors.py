"""The reasons for which a controller refuses a block: an ``error:`` number and a sentence.

The numbers are those of GRBL (``report.h``); the dialects that derive from GRBL keep them.
"""

from __future__ import annotations

from typing import NamedTuple


class Reason(NamedTuple):
    """The ``number`` of an ``error:`` answer, and its ``sentence`` about ``what``."""

    number: int
    sentence: str


LETTER_EXPECTED = Reason(1, "{what} is in place of a word's letter")
NUMBER_EXPECTED = Reason(2, "{what} has no readable number")
NEGATIVE = Reason(4, "{what} may not be negative")
BAD_JOG = Reason(16, "{what} is not allowed in a jog")
UNSUPPORTED = Reason(20, "{what} is not a word that the controller knows")
GROUP_CONFLICT = Reason(21, "{what} contradicts another word of the line")
NO_FEED = Reason(22, "{what} needs a feed, and F is missing")
NOT_WHOLE = Reason(23, "{what} must be a whole number")
AXES_CLAIMED_TWICE = Reason(24, "{what} and another command of the line both want the axis words")
WORD_REPEATED = Reason(25, "{what} is twice in the line")
NO_AXES = Reason(26, "{what} needs axis words")
LINE_NUMBER = Reason(27, "{what} is above the largest line number, 10000000")
VALUE_MISSING = Reason(28, "{what} needs a P or L word")
NO_SUCH_OFFSET = Reason(29, "{what} is not one of the work offsets P0 to P6")
G53_MOTION = Reason(30, "{what} works only with G0 or G1")
AXES_WHILE_OFF = Reason(31, "{what} cancels the motion mode, but the line has axis words")
NO_AXES_IN_PLANE = Reason(32, "{what} has no axis word in its plane")
IMPOSSIBLE_TARGET = Reason(33, "{what} cannot reach this end point")
IMPOSSIBLE_RADIUS = Reason(34, "{what} has a radius too small to reach the end point")
NO_CENTRE = Reason(35, "{what} has no centre offset (I, J, K) in its plane")
LEFT_OVER = Reason(36, "no command of the line uses {what}")
OFFSET_AXIS = Reason(37, "{what} takes a Z word and nothing else")
TOOL_NUMBER = Reason(38, "{what} is above the largest tool number, 255")


class BlockError(Exception):
    """The controller would refuse a block with the error ``code``; ``what`` names the culprit."""

    def __init__(self, reason: Reason, what: str) -> None:
        super().__init__(reason.sentence.format(what=what))
        self.code = reason.number
