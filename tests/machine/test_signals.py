"""Signals: one exception, once, and the program's own handlers back afterwards."""

from __future__ import annotations

import contextlib
import os
import signal
import threading

import pytest

from miurafab.machine.signals import StopSignals

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends itself signals")


@pytest.mark.parametrize(
    ("name", "words"), [("SIGINT", "Ctrl-C"), ("SIGTERM", "SIGTERM"), ("SIGHUP", "SIGHUP")]
)
def test_the_first_signal_interrupts_and_the_others_do_not(name: str, words: str) -> None:
    with StopSignals() as signals:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(getattr(signal, name))
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        assert words in signals.reason


def test_a_signal_whose_exception_was_dropped_is_raised_by_the_next_check() -> None:
    with StopSignals() as signals:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signals.check()


def test_news_for_a_block_that_has_ended_are_dropped_and_are_no_ctrl_c() -> None:
    StopSignals().interrupt(RuntimeError("before"))
    with StopSignals() as signals:
        with pytest.raises(RuntimeError, match="in time"), signals.raising():
            signals.interrupt(RuntimeError("in time"))
        signals.interrupt(RuntimeError("late"))
        signals.check()
        assert signals.caught is None


def test_a_wire_that_must_not_be_torn_is_interrupted_only_by_the_check() -> None:
    with StopSignals() as signals:
        signals.at_once = False
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signals.check()


def test_once_the_job_is_being_stopped_no_signal_counts() -> None:
    with StopSignals() as signals:
        signals.hold()
        signal.raise_signal(signal.SIGINT)
        signals.check()


def test_the_old_handlers_come_back() -> None:
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    with StopSignals():
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)] == before


def test_nohup_is_respected() -> None:
    old = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopSignals():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, old)


def test_another_thread_leaves_the_handlers_alone() -> None:
    seen: list[object] = []
    before = signal.getsignal(signal.SIGINT)

    def work() -> None:
        with StopSignals():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [before]
