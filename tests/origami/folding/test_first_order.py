"""Folds that cannot begin with the others: proved by the linear program, compared with samples."""

from __future__ import annotations

import math
from typing import Any

import named_patterns
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from miurafab.errors import PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding import first_order, motion
from miurafab.origami.folding.first_order import waiting_folds
from miurafab.origami.folding.motion import find_motion

TOGETHER = ("waterbomb_base", "bird_base", "square_twist", "yoshimura", "kresling", "resch")


@pytest.mark.parametrize("name", TOGETHER)
def test_all_folds_of_a_known_pattern_begin_together(name: str) -> None:
    assert not len(waiting_folds(getattr(named_patterns, name)()))


def folded_map(letters: str, turn: complex = 1.0, digits: int = 16) -> CreasePattern:
    """A map of 3 x 3: lines across by lines up, the second line folded after the first."""

    def place(x: float, y: float) -> tuple[float, float]:
        turned = turn * complex(x, y)
        return round(turned.real, digits), round(turned.imag, digits)

    lines = named_patterns.border(place(0, 0), place(3, 0), place(3, 3), place(0, 3))
    marks = iter(letters)
    for k in (1, 2):
        lines += [(place(k, at), place(k, at + 1), next(marks), 180.0) for at in range(3)]
    for k in (1, 2):
        lines += [(place(at, k), place(at + 1, k), next(marks), 180.0) for at in range(3)]
    return named_patterns.drawn(lines)


def middles(pattern: CreasePattern, edges: np.ndarray) -> set[tuple[float, float]]:
    points = pattern.vertices_coords[pattern.edges_vertices[edges]].mean(axis=1) / 10.0
    return {(float(x), float(y)) for x, y in points}


def test_the_lines_of_a_map_that_are_folded_later_wait() -> None:
    """Upright lines keep their letter; lying ones change it where they cross a fold."""
    pattern = folded_map("VVVVVVVMVVMV")
    wanted = {(x, y) for x in (0.5, 1.5, 2.5) for y in (1.0, 2.0)}
    assert middles(pattern, waiting_folds(pattern)) == wanted


@pytest.mark.parametrize("letters", ["VVVVVVMVMMVM", "VVVVVVVMVVMV", "VMVMVMVVMMMV"])
def test_a_sequence_is_refused_with_the_folds_that_wait(letters: str) -> None:
    with pytest.raises(PatternError, match=r"With flat facets [0-9]+ of its 12 folds cannot begin"):
        find_motion(folded_map(letters), 10)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(4, 6))
def test_at_one_vertex_the_program_is_what_a_search_finds(seed: int, count: int) -> None:
    """Of rays d_e with signs s_e, those wait that are in no positive combination of zero: a ray
    turns if its opposite lies in the cone of at most two others.
    """
    random = np.random.default_rng(seed)
    turns = np.sort(random.uniform(0, 2 * math.pi, count))
    if np.diff(turns, append=turns[0] + 2 * math.pi).max() > 3 or np.diff(turns).min() < 0.1:
        return
    letters = random.choice(["M", "V"], count)
    tips = [(math.cos(t), math.sin(t)) for t in turns]
    lines = named_patterns.border(*tips)
    lines += [((0.0, 0.0), tip, str(a), 90.0) for tip, a in zip(tips, letters, strict=True)]
    pattern = named_patterns.drawn(lines)
    waiting = set()
    signed = np.array(tips) * np.where(letters == "V", 1, -1)[:, None]
    for k in range(count):
        pairs = [(i, j) for i in range(count) for j in range(i) if k not in (i, j)]
        ways = [np.linalg.solve(signed[[i, j]].T, -signed[k]) for i, j in pairs]
        if not any((way >= 0).all() for way in ways):
            waiting.add((round(tips[k][0] / 2, 6), round(tips[k][1] / 2, 6)))
    low = np.array(tips).min(axis=0)  # the drawing is moved into the first quadrant
    found = middles(pattern, waiting_folds(pattern))
    assert {(round(x + low[0], 6), round(y + low[1], 6)) for x, y in found} == waiting


def program_alone(pattern: CreasePattern) -> set[int]:
    """The folds that wait by the whole program, in other words: each by itself shall turn."""
    letters, ends = pattern.edges_assignment, pattern.edges_vertices
    inner = (pattern.edges_faces >= 0).all(axis=1)
    folds = [e for e in np.flatnonzero(inner) if letters[e] in "MVU"]
    rim = set(ends[~inner].ravel().tolist())
    rows = [v for v in range(len(pattern.vertices_coords)) if v not in rim]
    turns = np.zeros((2 * len(rows), len(folds)))
    for column, edge in enumerate(folds):
        for one, other in (ends[edge], ends[edge][::-1]):
            if one in rows:
                along = pattern.vertices_coords[other] - pattern.vertices_coords[one]
                at = 2 * rows.index(one)
                turns[at : at + 2, column] = along / np.linalg.norm(along)
    side = {"M": (None, 0), "V": (0, None), "U": (None, None)}
    waiting = set()
    for column, edge in enumerate(folds):
        if letters[edge] == "U":
            continue
        bounds: list[Any] = [side[letters[e]] for e in folds]
        bounds[column] = (1, 1) if letters[edge] == "V" else (-1, -1)
        found = linprog(np.zeros(len(folds)), A_eq=turns, b_eq=np.zeros(len(turns)), bounds=bounds)
        if found.status != 0:
            waiting.add(int(edge))
    return waiting


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), across=st.integers(2, 4))
def test_what_rests_at_a_vertex_lets_its_neighbours_rest(seed: int, across: int) -> None:
    """Against one program for each fold, on grids with diagonals and letters at random."""
    random = np.random.default_rng(seed)
    n = float(across)
    lines = named_patterns.border((0.0, 0.0), (n, 0.0), (n, n), (0.0, n))
    for x in range(across):
        for y in range(across):
            ways = [((x, y), (x + 1, y + 1))] if random.random() < 0.7 else []
            ways += [((x, y), (x + 1, y))] if y else []
            ways += [((x, y), (x, y + 1))] if x else []
            for one, other in ways:
                letter = random.choice(["M", "V", "U"], p=[0.45, 0.45, 0.1])
                lines.append(
                    ((float(one[0]), float(one[1])), tuple(map(float, other)), letter, 90.0)
                )
    pattern = named_patterns.drawn(lines)
    assert set(waiting_folds(pattern).tolist()) == program_alone(pattern)


def test_opposite_folds_of_one_letter_turn_and_those_across_them_do_not() -> None:
    """Three of the letters and one other: the line of two equal ones turns alone."""
    assert len(waiting_folds(cross("VVVM"))) == 2
    assert len(waiting_folds(cross("VVVV"))) == 0
    assert len(waiting_folds(cross("VVMM"))) == 4


def cross(letters: str) -> CreasePattern:
    return named_patterns.drawn(cross_lines(letters))


def cross_lines(letters: str, angle: float = 90.0) -> list[Any]:
    """Two lines that cross, their four halves of ``letters``, going round."""
    lines = named_patterns.border((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    tips = ((2.0, 1.0), (1.0, 2.0), (0.0, 1.0), (1.0, 0.0))
    halves = zip(tips, letters, strict=True)
    return [*lines, *(((1.0, 1.0), tip, letter, angle) for tip, letter in halves)]


def test_a_program_without_an_answer_tells_what_waits_at_single_vertices(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pattern = folded_map("VVVVVVVMVVMV")
    whole = waiting_folds(pattern)
    monkeypatch.setattr(first_order, "MOST_PIVOTS", 0)
    assert set(waiting_folds(pattern)) <= set(whole)


def test_a_large_sheet_whose_folds_wait_is_refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything is solved; a sheet of as many vertices whose folds begin is folded."""
    monkeypatch.setattr(first_order, "MOST_BENT", 10)
    with monkeypatch.context() as patch:
        patch.setattr(motion, "ramp_motion", None)
        with pytest.raises(PatternError, match=r"flat facets 6 of its 12 folds .* \(it has 16\)"):
            find_motion(folded_map("VVVVVVVMVVMV"), 4)
    assert len(find_motion(named_patterns.miura(4), 4).motion.frames) == 5


def test_vertices_that_only_flat_edges_have_make_no_sheet_large(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They are left out before the sheet is folded, which then has 9, and half of its folds wait;
    a fold is named by its number in the drawing.
    """
    lines: list[Any] = [((0.0, 0.0), (1.0, 1.0), "F", 0.0)]
    for k in (0.25, 0.5, 0.75):
        lines += [((k, 0.25), (k, 0.75), "F", 0.0), ((0.25, k), (0.75, k), "F", 0.0)]
    pattern = named_patterns.drawn([*lines, *cross_lines("VVVM", 180.0)])
    assert len(pattern.vertices_coords) > 12
    monkeypatch.setattr(first_order, "MOST_BENT", 9)
    assert len(find_motion(pattern, 4).motion.frames) == 5
    monkeypatch.setattr(first_order, "MOST_BENT", 8)
    with pytest.raises(PatternError, match=r" 2 of its 4 folds .* \(it has 9\)") as told:
        find_motion(pattern, 4)
    first = min(waiting_folds(pattern))
    assert first != min(waiting_folds(cross("VVVM")))
    assert f"the first being edge {first}." in str(told.value)
    monkeypatch.setattr(first_order, "MOST_BENT", 9)
    monkeypatch.setattr(motion, "MOST_WRONG", -1.0)  # as for folds that go astray on the way
    with pytest.raises(PatternError, match="does not fold in one motion") as told:
        find_motion(pattern, 4)
    waits = "2 of its 4 folds cannot begin from flat if none shall turn to its wrong side"
    assert f"{waits}, the first being edge {first}." in str(told.value)
    assert type(told.value) is PatternError


def ring(digits: int, aside: float = 0.0) -> CreasePattern:
    """A polygon with a crease out from each corner, away from one point; of the first of these the
    end lies ``aside``.

    Around all corners the turns add up to none if each side turns by the inverse of its distance
    from that point.
    """
    turns = np.cumsum([0.3, 0.8, 1.0, 0.7, 0.9, 1.1, 0.8])
    out = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    corners = out * np.array([1.0, 1.2, 0.9, 1.1, 1.3, 1.0, 1.15])[:, None]
    tips = 3 * out
    tips[0] += aside * np.array([-out[0, 1], out[0, 0]])
    places = [tuple(place) for place in np.round(np.concatenate([corners, tips]), digits).tolist()]
    near, far = places[:7], places[7:]
    lines = named_patterns.border(*far)
    for n in range(7):
        lines += [(near[n], near[(n + 1) % 7], "V", 90.0), (near[n], far[n], "V", 90.0)]
    return named_patterns.drawn(lines)


@pytest.mark.parametrize("digits", [16, 6])
def test_folds_of_a_rounded_drawing_begin_as_those_of_the_exact_one(digits: int) -> None:
    assert len(waiting_folds(ring(digits))) == 0
    assert len(waiting_folds(ring(digits, aside=0.01))) == 14


@pytest.mark.parametrize("degrees", range(5, 90, 10))
@pytest.mark.parametrize("digits", [6, 7])
def test_a_line_that_rounding_bends_to_either_side_is_straight(degrees: int, digits: int) -> None:
    """Where it bent away from the folds across it, they had their balance, ever so slowly."""
    turn = complex(math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))
    assert len(waiting_folds(folded_map("VVVVVVVMVVMV", turn, digits))) == 6
