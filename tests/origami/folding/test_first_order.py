"""Folds that cannot begin with the others: proved by the linear program, compared with samples."""

from __future__ import annotations

import math

import named_patterns
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.errors import PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.first_order import waiting_folds
from miurafab.origami.folding.motion import find_motion

TOGETHER = ("waterbomb_base", "bird_base", "square_twist", "yoshimura", "kresling", "resch")


@pytest.mark.parametrize("name", TOGETHER)
def test_all_folds_of_a_known_pattern_begin_together(name: str) -> None:
    assert not len(waiting_folds(getattr(named_patterns, name)()))


def folded_map(letters: str) -> CreasePattern:
    """A map of 3 x 3: lines across by lines up, the second line folded after the first."""
    lines = named_patterns.border((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0))
    marks = iter(letters)
    for k in (1.0, 2.0):
        for at in range(3):
            lines.append(((k, float(at)), (k, at + 1.0), next(marks), 180.0))
    for k in (1.0, 2.0):
        for at in range(3):
            lines.append(((float(at), k), (at + 1.0, k), next(marks), 180.0))
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
