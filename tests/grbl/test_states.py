"""The table of states, stated as rules over every state and every input."""

from __future__ import annotations

import pytest

from miurafab.grbl.states import KEEPS_ACCOUNT, SENT, TRANSITIONS, Input, State

CASES = [(state, item) for state in State for item in Input]


@pytest.mark.parametrize(("state", "item"), CASES)
def test_every_reply_has_a_successor_in_every_state(state: State, item: Input) -> None:
    if item not in SENT:
        assert isinstance(TRANSITIONS[state][item], State)


@pytest.mark.parametrize("state", State)
def test_the_way_out_is_always_open(state: State) -> None:
    allowed = Input.RESET in TRANSITIONS[state]
    assert allowed is (state is not State.CLOSED)
    if allowed:
        assert TRANSITIONS[state][Input.RESET] is State.RESETTING


OPENING, GREETED, READY, LOCKED = State.OPENING, State.GREETED, State.READY, State.LOCKED
ALARMED, UNSYNCED, RESETTING = State.ALARMED, State.UNSYNCED, State.RESETTING


@pytest.mark.parametrize(
    ("item", "before", "after"),
    [
        (Input.ALARM, {OPENING, GREETED, READY, LOCKED, UNSYNCED, ALARMED}, ALARMED),
        (Input.SLEEP, {OPENING, GREETED, READY, LOCKED, ALARMED}, ALARMED),
        (Input.STRAY, {GREETED, READY, LOCKED, UNSYNCED}, UNSYNCED),
        (Input.LOCK, {GREETED, READY, LOCKED}, LOCKED),
        (Input.UNLOCK, {READY, LOCKED}, READY),
        (Input.RESTART, {READY, RESETTING}, RESETTING),
        (Input.BANNER, {OPENING, GREETED, LOCKED, ALARMED, RESETTING}, GREETED),
        (Input.BANNER, {READY, UNSYNCED}, UNSYNCED),
    ],
)
def test_what_a_reply_leads_to(item: Input, before: set[State], after: State) -> None:
    assert {state for state in State if TRANSITIONS[state][item] is after} == before


def test_motion_is_sent_only_where_the_account_is_right() -> None:
    may_move = {state for state in State if Input.MOTION in TRANSITIONS[state]}
    assert may_move == {GREETED, READY}
    may_command = {state for state in State if Input.SYSTEM in TRANSITIONS[state]}
    assert may_command == {GREETED, READY, LOCKED}


def test_a_question_stands_for_a_banner_only_where_one_is_awaited() -> None:
    for item in (Input.PROBE, Input.PROVEN):
        assert {state for state in State if item in TRANSITIONS[state]} == {OPENING, RESETTING}
    for state in (OPENING, RESETTING):
        assert TRANSITIONS[state][Input.PROBE] is state
        assert TRANSITIONS[state][Input.PROVEN] is READY


def test_closed_is_final_and_the_end_always_closes() -> None:
    assert set(Input) - set(TRANSITIONS[State.CLOSED]) == {
        *(Input.MOTION, Input.SYSTEM, Input.RESET, Input.REALTIME, Input.PROBE, Input.PROVEN)
    }
    assert set(TRANSITIONS[State.CLOSED].values()) == {State.CLOSED}
    assert all(TRANSITIONS[state][Input.END] is State.CLOSED for state in State)


@pytest.mark.parametrize("state", [State.LOCKED, State.ALARMED, State.UNSYNCED])
def test_no_reply_reopens_motion_but_unlocking_or_a_restart(state: State) -> None:
    """No reply to a running job heals an alarm or a broken account."""
    for item in Input:
        if item in SENT or item in (Input.BANNER, Input.UNLOCK):
            continue
        after = TRANSITIONS[state][item]
        assert Input.MOTION not in TRANSITIONS[after], item


def test_an_unexpected_banner_needs_a_reset_of_ours() -> None:
    broken = TRANSITIONS[State.READY][Input.BANNER]
    assert broken is State.UNSYNCED
    assert TRANSITIONS[broken][Input.BANNER] is State.UNSYNCED
    assert TRANSITIONS[TRANSITIONS[broken][Input.RESET]][Input.BANNER] is State.GREETED


def test_only_states_that_keep_the_account_may_hold_lines() -> None:
    for state in State:
        for item in (Input.MOTION, Input.SYSTEM):
            if item in TRANSITIONS[state]:
                assert TRANSITIONS[state][item] in KEEPS_ACCOUNT
