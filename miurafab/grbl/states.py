"""What the sending side knows about the controller, as one table.

Theory
------
The wire carries two kinds of replies: answers (``ok``, ``error:``), exactly one a line sent and
in the order sent, and everything else, which may come at any time. Character counting rests on
the first kind alone: it is right as long as we know which lines are still unanswered, and worth
nothing once we do not. So the states say *how much of that knowledge is left*:

``OPENING``    the wire is open and nothing was heard; answers may be leftovers of somebody else.
``GREETED``    a banner came and no line was sent since: all buffers over there are empty.
``READY``      the lines in flight are known exactly.
``LOCKED``     as READY, but the controller refuses motion until it is unlocked or homed.
``ALARMED``    an alarm came. Some firmware answers the lines it held, some forgets them, so the
               accounting is void and only a reset can make it good.
``UNSYNCED``   the accounting broke: a banner that nobody asked for (what was in flight is lost,
               and half a line may still arrive there), or an answer to nothing.
``RESETTING``  we sent a soft reset; whatever still comes was said before it, up to the banner.
``CLOSED``     the wire is gone.

Three rules that the table keeps, and that its tests state for every state and input:

* every reply has a successor in every state: no byte from a controller can break the program;
* a soft reset is allowed in every state but CLOSED, so that the way out is always open;
* motion may be sent only from GREETED and READY, and no reply leads from ALARMED, UNSYNCED or
  LOCKED back to motion except what a human's unlock, homing or reset brings about: nothing here
  unlocks or sends again by itself.

A second banner right after the first (two resets in a row) leaves GREETED as it is. In LOCKED it
leads back to GREETED: no motion can be in flight there.
"""

from __future__ import annotations

from enum import Enum, auto
from types import MappingProxyType


class State(Enum):
    """How much we know about what the controller holds."""

    OPENING = auto()
    GREETED = auto()
    READY = auto()
    LOCKED = auto()
    ALARMED = auto()
    UNSYNCED = auto()
    RESETTING = auto()
    CLOSED = auto()


class Input(Enum):
    """What can happen: the first group comes from the controller, the second from us."""

    BANNER = auto()
    ANSWER = auto()  # ok or error with a line in flight
    STRAY = auto()  # ok or error with none
    ALARM = auto()
    LOCK = auto()  # [MSG:'$H'|'$X' to unlock], or a status report of state Alarm
    UNLOCK = auto()  # [MSG:Caution: Unlocked], or a status report of state Idle
    SLEEP = auto()  # [MSG:Sleeping]
    RESTART = auto()  # it says what it always follows with a reset of its own
    TALK = auto()  # any other reply
    END = auto()

    MOTION = auto()  # a line of G-code, or a jog
    SYSTEM = auto()  # any other $ line
    RESET = auto()  # 0x18
    REALTIME = auto()  # any other realtime byte


SENT = frozenset({Input.MOTION, Input.SYSTEM, Input.RESET, Input.REALTIME})
"""The inputs that are ours; one that a state does not list is refused there."""

_S, _I = State, Input


def _row(stay: State, changes: dict[Input, State], *refused: Input) -> dict[Input, State]:
    """All inputs lead to ``stay`` but the ``changes``, the ``refused``, and those common to all."""
    common = {_I.RESET: _S.RESETTING, _I.END: _S.CLOSED}
    row = dict.fromkeys(Input, stay) | common | changes
    return {item: state for item, state in row.items() if item not in refused}


_NO_LINES = (_I.MOTION, _I.SYSTEM)

TRANSITIONS = MappingProxyType(
    {
        _S.OPENING: _row(
            _S.OPENING,
            {_I.BANNER: _S.GREETED, _I.ALARM: _S.ALARMED, _I.SLEEP: _S.ALARMED},
            *_NO_LINES,
        ),
        _S.GREETED: _row(
            _S.GREETED,
            {
                _I.STRAY: _S.UNSYNCED,
                _I.ALARM: _S.ALARMED,
                _I.SLEEP: _S.ALARMED,
                _I.LOCK: _S.LOCKED,
                _I.MOTION: _S.READY,
                _I.SYSTEM: _S.READY,
            },
        ),
        _S.READY: _row(
            _S.READY,
            {
                _I.BANNER: _S.UNSYNCED,
                _I.STRAY: _S.UNSYNCED,
                _I.ALARM: _S.ALARMED,
                _I.SLEEP: _S.ALARMED,
                _I.LOCK: _S.LOCKED,
                _I.RESTART: _S.RESETTING,
            },
        ),
        _S.LOCKED: _row(
            _S.LOCKED,
            {
                _I.BANNER: _S.GREETED,
                _I.STRAY: _S.UNSYNCED,
                _I.ALARM: _S.ALARMED,
                _I.SLEEP: _S.ALARMED,
                _I.UNLOCK: _S.READY,
            },
            _I.MOTION,
        ),
        _S.ALARMED: _row(_S.ALARMED, {_I.BANNER: _S.GREETED}, *_NO_LINES),
        _S.UNSYNCED: _row(_S.UNSYNCED, {_I.ALARM: _S.ALARMED}, *_NO_LINES),
        _S.RESETTING: _row(_S.RESETTING, {_I.BANNER: _S.GREETED}, *_NO_LINES),
        _S.CLOSED: _row(_S.CLOSED, {}, *SENT),
    }
)
"""``TRANSITIONS[state][input]`` is the next state; a sent input that is absent is refused."""

KEEPS_ACCOUNT = frozenset({State.READY, State.LOCKED})
"""In all other states nothing is in flight as far as anybody can know."""
