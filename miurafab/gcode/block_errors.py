"""The reasons for which a controller refuses a block: an ``error:`` number and a sentence.

The numbers are those of GRBL (``report.h``); the dialects that derive from GRBL keep them.
"""

from __future__ import annotations

LETTER_EXPECTED = 1
NUMBER_EXPECTED = 2
NEGATIVE = 4
BAD_JOG = 16
UNSUPPORTED = 20
GROUP_CONFLICT = 21
NO_FEED = 22
NOT_WHOLE = 23
AXES_CLAIMED_TWICE = 24
WORD_REPEATED = 25
NO_AXES = 26
LINE_NUMBER = 27
VALUE_MISSING = 28
NO_SUCH_OFFSET = 29
G53_MOTION = 30
AXES_WHILE_OFF = 31
NO_AXES_IN_PLANE = 32
IMPOSSIBLE_TARGET = 33
IMPOSSIBLE_RADIUS = 34
NO_CENTRE = 35
LEFT_OVER = 36
OFFSET_AXIS = 37
TOOL_NUMBER = 38

_SENTENCES = {
    LETTER_EXPECTED: "{what} stands where a word's letter must be",
    NUMBER_EXPECTED: "{what} has no readable number",
    NEGATIVE: "{what} may not be negative",
    BAD_JOG: "{what} is not allowed in a jog",
    UNSUPPORTED: "{what} is not a word that the controller knows",
    GROUP_CONFLICT: "{what} contradicts another word of the line",
    NO_FEED: "{what} needs a feed, and no F was given",
    NOT_WHOLE: "{what} must be a whole number",
    AXES_CLAIMED_TWICE: "{what} and another command of the line both want the axis words",
    WORD_REPEATED: "{what} stands twice in the line",
    NO_AXES: "{what} needs axis words",
    LINE_NUMBER: "{what} is above the largest line number, 10000000",
    VALUE_MISSING: "{what} needs a P or L word",
    NO_SUCH_OFFSET: "{what} is not one of the work offsets P0 to P6",
    G53_MOTION: "{what} works only with G0 or G1",
    AXES_WHILE_OFF: "{what} leaves no motion mode, yet axis words stand in the line",
    NO_AXES_IN_PLANE: "{what} has no axis word in its plane",
    IMPOSSIBLE_TARGET: "{what} cannot reach this end point",
    IMPOSSIBLE_RADIUS: "{what} has a radius too small to reach the end point",
    NO_CENTRE: "{what} has no centre offset (I, J, K) in its plane",
    LEFT_OVER: "{what} is used by no command of the line",
    OFFSET_AXIS: "{what} takes a Z word and nothing else",
    TOOL_NUMBER: "{what} is above the largest tool number, 255",
}


class BlockError(Exception):
    """The controller would refuse a block with the error ``code``; ``what`` names the culprit."""

    def __init__(self, code: int, what: str) -> None:
        super().__init__(_SENTENCES[code].format(what=what))
        self.code = code
