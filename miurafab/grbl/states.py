"""The state table of the connection: how much the sender knows about the controller.

Theory
------
The controller sends two kinds of replies. Answers (``ok``, ``error:``) come once per line sent and
in the order sent. All other replies may come at any time. Character counting needs the answers
alone: it is correct while the sender knows which lines are unanswered, and useless afterwards. So
the states describe this knowledge:

``OPENING``    the port is open and silent; answers may belong to another program's lines.
``GREETED``    a banner came and no line was sent since: all buffers of the controller are empty.
``READY``      the lines in flight are known exactly.
``LOCKED``     as READY, but the controller refuses motion until it is unlocked or homed.
``ALARMED``    an alarm came. Some firmware answers the lines that it held, some drops them, so the
               accounting is void until a reset.
``UNSYNCED``   the accounting broke: by an unexpected banner (the lines in flight are lost, and half
               a line may still arrive at the controller), or by an answer without a line in flight.
``RESETTING``  a soft reset was sent; replies before the banner belong to the time before the reset.
``CLOSED``     the connection has ended.

The table keeps three rules, which its tests check for every state and input:

* each reply has a successor in each state: no byte from a controller can break the program;
* a soft reset is allowed in each state except CLOSED: the way out is always open;
* motion may be sent only from GREETED and READY. From ALARMED, UNSYNCED or LOCKED only a person's
  unlock, homing or reset leads back there: nothing here unlocks or resends by itself.

A banner proves that all buffers are empty. Where none comes (a board that the opening of its port
does not reset, a board that never greets), a question proves it: the controller says that it is at
rest, and answers ``$I`` before it answers anything else (PROBE, then PROVEN).

A second banner right after the first (two resets in a row) leaves GREETED unchanged. In LOCKED a
banner leads back to GREETED, because no motion can be in flight there.
"""

from __future__ import annotations

from enum import Enum, auto
from types import MappingProxyType


class State(Enum):
    """The sender's knowledge about the lines that the controller holds."""

    OPENING = auto()
    GREETED = auto()
    READY = auto()
    LOCKED = auto()
    ALARMED = auto()
    UNSYNCED = auto()
    RESETTING = auto()
    CLOSED = auto()


class Input(Enum):
    """The inputs: the first group comes from the controller, the second from the sender."""

    BANNER = auto()
    ANSWER = auto()  # ok or error with a line in flight
    STRAY = auto()  # ok or error with none
    ALARM = auto()
    LOCK = auto()  # [MSG:'$H'|'$X' to unlock], or a status report of state Alarm
    UNLOCK = auto()  # [MSG:Caution: Unlocked], or a status report of state Idle
    SLEEP = auto()  # [MSG:Sleeping]
    RESTART = auto()  # a message that the controller always follows with a reset of its own
    TALK = auto()  # any other reply
    END = auto()

    MOTION = auto()  # a line of G-code, or a jog
    SYSTEM = auto()  # any other $ line
    RESET = auto()  # 0x18
    REALTIME = auto()  # any other realtime byte
    PROBE = auto()  # the question that stands for a banner
    PROVEN = auto()  # its answer was the first one, and whole


SENT = frozenset(
    {Input.MOTION, Input.SYSTEM, Input.RESET, Input.REALTIME, Input.PROBE, Input.PROVEN}
)
"""The inputs of the sender; a state refuses those that it does not list."""

_S, _I = State, Input


def _row(stay: State, changes: dict[Input, State], *refused: Input) -> dict[Input, State]:
    """All inputs lead to ``stay``, except ``changes``, the ``refused``, RESET and END; PROBE and
    PROVEN are refused where ``changes`` do not have them.
    """
    common = {_I.RESET: _S.RESETTING, _I.END: _S.CLOSED}
    row = dict.fromkeys(set(Input) - {_I.PROBE, _I.PROVEN}, stay) | common | changes
    return {item: state for item, state in row.items() if item not in refused}


_NO_LINES = (_I.MOTION, _I.SYSTEM)

TRANSITIONS = MappingProxyType(
    {
        _S.OPENING: _row(
            _S.OPENING,
            {
                _I.BANNER: _S.GREETED,
                _I.ALARM: _S.ALARMED,
                _I.SLEEP: _S.ALARMED,
                _I.PROBE: _S.OPENING,
                _I.PROVEN: _S.READY,
            },
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
        _S.RESETTING: _row(
            _S.RESETTING,
            {_I.BANNER: _S.GREETED, _I.PROBE: _S.RESETTING, _I.PROVEN: _S.READY},
            *_NO_LINES,
        ),
        _S.CLOSED: _row(_S.CLOSED, {}, *SENT),
    }
)
"""``TRANSITIONS[state][input]`` is the next state; an absent input is refused."""

KEEPS_ACCOUNT = frozenset({State.READY, State.LOCKED})
"""The states that count bytes in flight; in all others the count is zero."""
