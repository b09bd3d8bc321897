"""How long this computer has slept."""

from __future__ import annotations

import pytest

from miurafab.machine import sleeping


def test_a_process_that_stands_still_between_two_clocks_has_slept_for_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    awake, passed = iter([1.0, 9.0, 9.0, 9.0]), iter([9.0, 9.0])
    monkeypatch.setattr(sleeping, "_awake_s", lambda: next(awake))
    monkeypatch.setattr(sleeping, "_passed_s", lambda: next(passed))
    assert sleeping.slept_s() == 0.0


def test_a_sleep_between_two_clocks_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sleeping, "_awake_s", lambda: 1.0)
    monkeypatch.setattr(sleeping, "_passed_s", lambda: 9.0)
    assert sleeping.slept_s() == 8.0
