"""The trade-off: laws recovered from samples made by them, and real fits that obey them."""

from __future__ import annotations

import itertools
import json
import math
import signal
import threading
import warnings
from dataclasses import replace

import numpy as np
import pytest
from command_line import sentence
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

import miurafab
from miurafab.errors import InputError, TargetError
from miurafab.origami.tradeoff import Sample, Tradeoff, cost, optimal_side, summarise
from miurafab.origami.tradeoff_plot import SIZE, draw_tradeoff, tradeoff_table
from miurafab.workflow.tradeoff import _deaf_children

SIDES = (6, 8, 10)


def made(sides, c=0.5, a=1.7, b=-0.2, failed=()) -> list[Sample]:
    return [
        Sample(n, n, "stalled")
        if n in failed
        else Sample(n, n, "converged", 0.8, 0.6, 100 * c / n, c / n, 0.01, a + b / n, 1.0)
        for n in sides
    ]


def test_a_plane_has_no_law_of_its_middle(run) -> None:
    """Which lies on it with any number of facets."""
    words = ("--sides", "4,6,8", "--workers", "1", "--polish", "off")
    done = run("tradeoff", "plane", *words)
    assert done.returncode == 0
    assert "distance = 48" in done.stdout
    assert "mid-surface" not in done.stdout


def test_ctrl_c_while_processes_are_started_comes_when_they_are() -> None:
    started = []
    with pytest.raises(KeyboardInterrupt), _deaf_children():
        started.append(signal.raise_signal(signal.SIGINT))
    assert started == [None]
    other = threading.Thread(target=lambda: started.append(list(_other_thread())))
    other.start()
    other.join()
    assert started[1:] == [["there"]]


def _other_thread():
    with _deaf_children():  # only the main thread may have handlers
        yield "there"


@given(
    st.lists(st.integers(2, 300), min_size=3, max_size=8, unique=True),
    st.floats(0.01, 2),
    st.floats(1, 4),
    st.floats(-1, 1),
)
def test_the_laws_are_recovered(sides, c, a, b):
    found = summarise(made(sides, c, a, b))
    assert found.coefficient == pytest.approx(c, rel=1e-9)
    assert found.exponent == pytest.approx(-1, abs=1e-9)
    assert found.law_error == pytest.approx(0, abs=1e-9)
    assert found.area_limit == pytest.approx(a, rel=1e-6)
    assert found.area_slope == pytest.approx(b, abs=1e-4)


@pytest.mark.parametrize("power", [-0.5, -1.0, -2.0, -3.0])
def test_the_powers_that_are_left_free_are_recovered(power):
    sides = (6, 8, 12, 16, 24)
    samples = [
        replace(s, area_ratio=1.7 + 0.8 * n**power, hausdorff_midsurface_mm=3.0 * n ** (power - 1))
        for s, n in zip(made(sides), sides, strict=True)
    ]
    found = summarise(samples)
    assert found.area_power == pytest.approx(power, abs=0.011)
    assert found.area_free_limit == pytest.approx(1.7, abs=2e-3)
    assert found.midsurface_exponent == pytest.approx(power - 1, abs=1e-9)


@given(st.floats(0.01, 0.99), st.floats(0.01, 2))
def test_no_n_is_cheaper_than_the_optimal_one(weight, c):
    best = optimal_side(weight, c)
    least = cost(weight, np.array([best]), np.array([c / best]))[0]
    others = best * np.geomspace(0.2, 5, 101)
    assert least <= cost(weight, others, c / others).min() + 1e-12 * least


def test_more_weight_on_effort_asks_for_fewer_facets():
    curves = summarise(made((8, 16, 32, 64))).curves
    assert (np.diff([curve.optimal_facets for curve in curves]) < 0).all()
    assert (np.diff([curve.best_facets for curve in curves]) <= 0).all()
    assert curves[-1].best_facets == 64 if curves[-1].optimal_facets < 100 else True


def test_sheets_that_were_not_found_are_listed_and_left_out():
    found = summarise(made((8, 12, 16, 24), failed=(12,)))
    assert [s.status for s in found.samples] == ["converged", "stalled", "converged", "converged"]
    assert found.coefficient == pytest.approx(0.5)
    assert summarise(made((8, 12, 16), failed=(12,))).coefficient is None


def test_two_sheets_make_no_law_and_no_plot(tmp_path):
    found = summarise(made((8, 12)))
    assert repr(found) == "<Tradeoff 2 sheets, 2 converged, no law>"
    with pytest.raises(InputError, match="nothing to plot: fewer than three sheets were found"):
        draw_tradeoff(found, Figure().subplots(1, 3))
    found.save(tmp_path / "two.csv")
    header, *rows = (tmp_path / "two.csv").read_text().splitlines()
    assert "cost" not in header
    assert [row.split(",")[:4] for row in rows] == [
        ["64", "8", "8", "converged"],
        ["144", "12", "12", "converged"],
    ]


def test_a_sheet_that_was_not_found_costs_nothing_in_the_table():
    lines = tradeoff_table(summarise(made((8, 12, 16, 24), failed=(12,)))).splitlines()
    assert lines[2] == "144,12,12,stalled" + "," * (lines[0].count(",") - 3)
    assert all(line.split(",")[-1] for line in (lines[1], lines[3], lines[4]))


def test_a_middle_that_lies_on_the_target_has_no_power():
    flat = [replace(sample, hausdorff_midsurface_mm=0.0) for sample in made((8, 12, 16))]
    assert summarise(flat).midsurface_exponent is None


@pytest.fixture(scope="module")
def hypar() -> Tradeoff:
    return miurafab.tradeoff("hypar", SIDES)


def test_real_sheets_obey_the_law(hypar):
    assert hypar.exponent == pytest.approx(-1, abs=0.15)
    assert hypar.law_error < 0.1
    assert hypar.area_limit > 1
    held = {(s.amplitude, s.zigzag) for s in hypar.found}
    assert len(held) == 1


def test_a_pool_gives_the_same(hypar):
    assert miurafab.tradeoff("hypar", SIDES, workers=2) == hypar


def test_a_cluster_gives_the_same(hypar):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        distributed = pytest.importorskip("distributed")
        with distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
        ) as cluster:
            found = miurafab.tradeoff("hypar", SIDES, cluster=cluster.scheduler_address)
    assert found == hypar


def test_the_files(hypar, tmp_path):
    for name in ("a.csv", "b.csv"):
        hypar.save(tmp_path / name)
    text = (tmp_path / "a.csv").read_text()
    assert text == (tmp_path / "b.csv").read_text()
    lines = [line.split(",") for line in text.splitlines()]
    assert lines[0][:4] == ["facets", "columns", "rows", "status"]
    assert [line[0] for line in lines[1:]] == ["36", "64", "100"]
    assert {len(line) for line in lines} == {9 + len(hypar.curves)}
    pytest.importorskip("matplotlib")
    for kind, start in (("png", b"\x89PNG"), ("svg", b"<?xml")):
        for name in ("a", "b"):
            hypar.save(tmp_path / f"{name}.{kind}", title="hypar")
        content = (tmp_path / f"a.{kind}").read_bytes()
        assert content.startswith(start)
        assert content == (tmp_path / f"b.{kind}").read_bytes()


@pytest.mark.parametrize("sides", [(4, 6, 8, 10), (8, 12, 16, 24, 32, 48), tuple(range(4, 13))])
def test_the_numbers_on_an_axis_do_not_overlap(sides):
    """Less than a decade of facets was labelled in tenths, one over the other."""
    figure = Figure(figsize=SIZE, layout="constrained")
    axes = figure.subplots(1, 3)
    draw_tradeoff(summarise(made(sides)), axes)
    figure.canvas.draw()
    for axis in (each for pair in axes for each in (pair.xaxis, pair.yaxis)):
        boxes = [
            label.get_window_extent()
            for label in axis.get_ticklabels(which="both")
            if label.get_text() and label.get_visible()
        ]
        assert len(boxes) > 1
        assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_the_command(run, tmp_path, hypar):
    out = tmp_path / "t.csv"
    arguments = ["tradeoff", "hypar", "--sides", "6,8,10", "--workers", "1", "-o", str(out)]
    result = run(*arguments, "--json", "--weights", "0.5")
    assert result.returncode == 0, result
    answer = json.loads(result.stdout)
    assert answer["law"]["coefficient"] == hypar.coefficient
    assert [curve["weight"] for curve in answer["costs"]] == [0.5]
    assert answer["file"] == str(out)
    assert out.exists()
    shown = run(*arguments, "--quiet", "--polish", "off")
    assert "A/A0 tends to" in shown.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--sides", "4,5"], "--sides is 4,5; three different"),
        (["--sides", "1,5,9"], "whole numbers from 2"),
        (["--sides", "4,x,9"], "whole numbers"),
        (["--weights", "0.5,1"], "between 0 and 1"),
        (["--weights", "half"], "between 0 and 1, such as 0.2"),
        (["-o", "picture.gif"], "does not end in one of .png, .svg, .csv"),
        (["--workers", "-2"], "1 or more"),
    ],
)
def test_one_sentence_for_each_mistake(run, arguments, words):
    assert words in sentence(run("tradeoff", "hypar", *arguments), 2)


def test_a_target_that_is_none():
    with pytest.raises(TargetError, match=r"'hyper'.*did you mean 'hypar'"):
        miurafab.tradeoff("hyper")


def test_a_cluster_that_is_not_there():
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match="does not answer"):
        miurafab.tradeoff("plane", (2, 3, 4), cluster="nonsense://nowhere")


def test_without_distributed_the_way_out_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"miurafab\[cluster\]"):
        miurafab.tradeoff("plane", (2, 3, 4), cluster="tcp://localhost:8786")


def test_a_sheet_that_lies_as_far_as_the_law_says_costs_what_the_curve_says():
    found = summarise(made((8, 16, 32)))
    for curve in found.curves:
        n = math.sqrt(curve.optimal_facets)
        assert n == pytest.approx(optimal_side(curve.weight, found.coefficient))
        assert curve.costs == tuple(
            cost(curve.weight, np.array([8.0, 16, 32]), 0.5 / np.array([8.0, 16, 32])).tolist()
        )
