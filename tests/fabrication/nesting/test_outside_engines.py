"""Engines of others: asked in a process of their own, never believed, killed when time is over."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import pytest
import shapely
from test_nesting import ANY, HOLE, assert_sound, problem, rectangle, sheets_of, zigzag_pieces

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting import ENGINES, SheetKind, Slot, nest, outside, run, worker
from miurafab.fabrication.nesting.outside import OUTSIDE, Proposals, installed, propose
from miurafab.fabrication.nesting.problem import clear_rectangle

PRESENT = [engine for engine in OUTSIDE if installed(engine)]


def test_the_table_of_engines_is_what_the_options_offer():
    assert set(ENGINES) == {"raster", "auto", *OUTSIDE}
    assert "rectpack" in PRESENT


@pytest.mark.parametrize("engine", PRESENT)
def test_an_engine_nests_zigzag_patches(engine):
    asked = problem(zigzag_pieces(8, 1.2), SheetKind(600.0, 400.0, ANY), seconds=12.0)
    found = nest(asked, engine)
    assert_sound(asked, found.slots)
    assert (found.engine, found.remarks) == (engine, ())
    assert found.version[0].isdigit()
    assert found.bound <= sheets_of(found.slots) <= 3


@pytest.mark.parametrize("engine", PRESENT)
def test_an_engine_keeps_to_stock_rotations_and_defects(engine):
    kinds = [
        SheetKind(90.0, 60.0, (90, 270), 1, (HOLE,)),
        SheetKind(60.0, 100.0, (90, 270)),
    ]
    asked = problem([rectangle(18, 28)] * 11, kinds, seconds=12.0)
    found = nest(asked, engine)
    assert_sound(asked, found.slots)
    assert (found.engine, found.remarks) == (engine, ())
    assert any(slot.kind == 0 for slot in found.slots)


def test_each_kind_of_sheet_may_have_rotations_of_its_own():
    kinds = [SheetKind(100.0, 60.0, (0, 180), 1), SheetKind(100.0, 60.0, (90, 270))]
    asked = problem([rectangle(48, 28)] * 6, kinds, seconds=12.0)
    for engine in PRESENT:
        found = nest(asked, engine)
        assert_sound(asked, found.slots)
        if engine == "packingsolver":
            assert found.engine == "raster"
            assert "grain runs in different ways" in found.remarks[0]


def test_a_problem_reaches_the_worker_as_it_was():
    kinds = (SheetKind(90.0, 60.0, (90, 270), 1, (HOLE,)), SheetKind(120.0, 100.0, ANY))
    asked = problem(zigzag_pieces(3, 0.3), kinds, seconds=7.5)
    engine, read = worker.read(worker.written("spyrrow", asked))
    assert (engine, read.stock, read.names) == ("spyrrow", asked.stock, asked.names)
    assert (read.seconds, read.seed) == (asked.seconds, asked.seed)
    for one, other in zip(read.outlines, asked.outlines, strict=True):
        np.testing.assert_array_equal(one, other)


ONE = problem([rectangle(30, 30)] * 2, SheetKind(100.0, 50.0, ANY), seconds=1.0)
GOOD = [Slot(0, 0, 0.0, 0.0, 0), Slot(0, 0, 50.0, 0.0, 0)]
WORSE = [Slot(0, 0, 0.0, 0.0, 0), Slot(1, 0, 0.0, 0.0, 0)]
OVERLAP = [Slot(0, 0, 0.0, 0.0, 0), Slot(0, 0, 10.0, 0.0, 0)]


def answering(monkeypatch, **what):
    monkeypatch.setattr(run, "propose", lambda engine, asked: Proposals("1.0", **what))


def test_a_layout_that_is_wrong_is_refused_and_told(monkeypatch):
    answering(monkeypatch, layouts=[WORSE, OVERLAP])
    found = nest(ONE, "rectpack")
    assert list(found.slots) == WORSE
    assert found.remarks == (
        "A layout of rectpack was refused: patches P1 and P2 are nearer than 2 mm.",
    )


def test_an_engine_without_a_sound_layout_gives_way_to_the_raster(monkeypatch):
    answering(monkeypatch, layouts=[OVERLAP], complaint="ended with an error: out of memory")
    found = nest(ONE, "rectpack")
    assert found.engine == "raster"
    assert_sound(ONE, found.slots)
    assert [sentence.split(":")[0] for sentence in found.remarks] == [
        "A layout of rectpack was refused",
        "The nesting engine 'rectpack'",
        "The nesting engine 'rectpack' found no layout in 0 s.",
    ]


def test_auto_asks_others_only_where_the_bound_is_not_reached(monkeypatch):
    answering(monkeypatch, layouts=[GOOD])
    monkeypatch.setattr(run, "installed", lambda engine: engine == "spyrrow")
    assert nest(ONE, "auto").engine == "raster"

    def wasteful(asked, report):
        report(WORSE)
        return True

    monkeypatch.setattr(run, "raster_engine", wasteful)
    found = nest(ONE, "auto")
    assert (found.engine, list(found.slots)) == ("spyrrow", GOOD)


STUCK = """
import sys, time
sys.stdin.readline()
print('{"begun": "9.9"}', flush=True)
print('{"slots": [[0, 0, 0.0, 0.0, 0], [0, 0, 50.0, 0.0, 0]]}', flush=True)
print('{"slots": [[0, 0, 0.0', end='', flush=True)
while True:
    time.sleep(0.01)
"""


def test_an_engine_that_does_not_end_is_killed_and_its_best_layout_stands(monkeypatch):
    monkeypatch.setattr(outside, "_COMMAND", STUCK)
    monkeypatch.setattr(outside, "_GRACE", 0.2)
    started = time.monotonic()
    found = propose("rectpack", ONE)
    assert time.monotonic() - started < 30.0
    assert (found.version, found.layouts, found.finished) == ("9.9", [GOOD], False)
    assert found.complaint == ""


def test_a_worker_ends_when_whoever_started_it_is_gone():
    code = (
        "import threading, time; "
        "from miurafab.fabrication.nesting.worker import _end_with_parent; "
        "threading.Thread(target=_end_with_parent, daemon=True).start(); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as process:
        process.stdin.close()
        assert process.wait(30) == 1


def test_an_engine_that_crashes_is_told_with_its_last_words(monkeypatch):
    monkeypatch.setattr(outside, "_COMMAND", "raise SystemExit('no licence')")
    found = propose("rectpack", ONE)
    assert found.complaint == "ended with an error: no licence"
    assert found.layouts == []


def test_an_engine_that_is_not_installed_is_told_with_the_command(monkeypatch):
    monkeypatch.setattr(outside, "find_spec", lambda name: None)
    sentence = r"'rectpack' is not installed; install it with: pip install 'miurafab\[nesting\]'"
    with pytest.raises(LayoutError, match=sentence):
        nest(ONE, "rectpack")
    monkeypatch.setitem(OUTSIDE, "packingsolver", (99, 1))
    with pytest.raises(LayoutError, match=r"'packingsolver' needs Python 99\.1 or newer"):
        nest(ONE, "packingsolver")


def test_the_clear_rectangle_is_the_largest_without_a_defect():
    def flawed(*rings):
        return SheetKind(100.0, 60.0, ANY, None, rings)

    def ring(*box):
        return tuple(map(tuple, shapely.get_coordinates(shapely.box(*box))[:-1].tolist()))

    assert clear_rectangle(flawed()) == (0.0, 0.0, 100.0, 60.0)
    assert clear_rectangle(flawed(ring(40, 20, 50, 30))) == (50.0, 0.0, 100.0, 60.0)
    assert clear_rectangle(flawed(ring(-5, -5, 120, 10))) == (0.0, 10.0, 100.0, 60.0)
    two = flawed(ring(10, 0, 20, 60), ring(15, 0, 60, 20))
    assert clear_rectangle(two) == (20.0, 20.0, 100.0, 60.0)
    assert clear_rectangle(flawed(ring(-1, -1, 101, 61))) == (0.0, 0.0, 0.0, 0.0)
