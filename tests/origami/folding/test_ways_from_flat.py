"""Which of the ways from flat is shown: the first, one in finer steps, or one with contact."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import named_patterns
import numpy as np
import pytest

from miurafab.errors import PatternError
from miurafab.origami.energy.bar_hinge import flat_model
from miurafab.origami.energy.equilibrium import solve
from miurafab.origami.folding import from_flat, motion, ramp_walk
from miurafab.origami.folding import ramp_motion as ramp_motion_module
from miurafab.origami.folding.first_order import waiting_folds
from miurafab.origami.folding.judge_motion import motion_findings
from miurafab.origami.folding.motion import find_motion
from miurafab.origami.folding.ramp_motion import ramp_motion


def test_a_way_that_is_lost_is_gone_again_in_finer_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The number of frames that are asked for does not decide whether a pattern folds."""
    pattern = named_patterns.waterbomb_base()

    def lost(*given: Any, finer: int = 1, **more: Any) -> Any:
        way, verdict = ramp_motion(*given, finer=finer, **more)
        if finer > 1:
            return way, verdict
        kept = replace(way, frames=way.frames[:2], states=way.states[:2])
        kept = replace(kept, fold_angles=way.fold_angles[:2])
        return kept, replace(verdict, complete=False, wrong_signs=0.5)

    whole = find_motion(pattern, 4)
    monkeypatch.setattr(motion, "ramp_motion", lost)
    again = find_motion(pattern, 4)
    assert again.verdict is not None
    assert again.verdict.complete
    assert len(again.motion.frames) == len(whole.motion.frames) == 5
    assert again.motion.frames == pytest.approx(whole.motion.frames, abs=1e-6)


def test_folds_that_go_astray_with_contact_alone_make_no_sequence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A roll folds as its letters tell and passes through itself, which is told."""
    pattern = named_patterns.roll()

    def astray(*given: Any, touching: bool = False, **more: Any) -> Any:
        way, verdict = ramp_motion(*given, **more)
        return way, replace(verdict, wrong_signs=0.5 if touching else 0.0, touching=touching)

    monkeypatch.setattr(motion, "ramp_motion", astray)
    found = motion._from_flat(pattern, 4, None, None)
    assert found.verdict is not None
    assert not found.verdict.touching
    assert len(found.motion.frames) == 5


@pytest.mark.parametrize("frames", [1, 3])
def test_the_way_next_to_the_folded_form_is_shown_where_that_from_flat_is_lost(
    frames: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A way of one frame shows nothing, so that the reason is told instead."""
    pattern = named_patterns.waterbomb_base()
    way, _ = ramp_motion(pattern, 4)
    part = replace(
        way, frames=way.frames[:frames], states=way.states[:frames],
        fold_angles=way.fold_angles[:frames],
    )  # fmt: skip

    def lost(*given: Any) -> Any:
        raise PatternError("The way is lost.")

    monkeypatch.setattr(motion, "_bent", lambda *given: part)
    monkeypatch.setattr(motion, "_from_flat", lost)
    if frames == 1:
        with pytest.raises(PatternError, match="The way is lost"):
            motion._find(pattern, 4, None)
    else:
        assert motion._find(pattern, 4, None).motion is part


def test_flat_facets_that_touch_leave_the_way_on_which_bent_ones_do_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pattern = named_patterns.waterbomb_base()
    way, verdict = ramp_motion(pattern, 4)
    touching = replace(verdict, touching=True)
    monkeypatch.setattr(motion, "ramp_motion", lambda *given, **more: (way, touching))
    flat = replace(way)
    monkeypatch.setattr(motion, "certified", lambda found: (flat, None))
    for met, shown in (([0], way), ([], flat)):
        monkeypatch.setattr(motion, "contacts", lambda found, met=met: met if found is flat else [])
        assert motion._from_flat(pattern, 4, None, None).motion is shown


def test_a_pattern_that_folds_in_a_sequence_is_told_by_its_folds() -> None:
    _, verdict = ramp_motion(named_patterns.waterbomb_base(), 2)
    none = np.empty(0, dtype=np.int64)
    few = np.array([3, 4])
    away = replace(verdict, wrong_edges=none, waiting_edges=none, angle_error=0.5, folds=8)
    wrong = replace(away, wrong_edges=few, wrong_signs=0.25, waiting_edges=few)
    assert "creases stay 29 degrees away from their fold angles. All of them could begin" in str(
        motion._sequence(away)
    )
    said = str(motion._sequence(wrong))
    assert "25% of its folds end on the other side than their letter tells, the first" in said
    assert "With flat facets 2 of its 8 folds cannot begin from flat" in said
    assert "the first being edge 3" in said


def test_which_folds_wait_is_found_once_for_all_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of up to four ways solved the same linear program."""
    pattern, found, ways = named_patterns.waterbomb_base(), [], []

    def waiting(given: Any) -> Any:
        found.append(given)
        return waiting_folds(given)

    def lost(*given: Any, **more: Any) -> Any:
        ways.append(more)
        way, verdict = ramp_motion(*given, **more)
        return way, replace(verdict, complete=False)

    for module in (motion, ramp_motion_module):
        monkeypatch.setattr(module, "waiting_folds", waiting)
    monkeypatch.setattr(motion, "ramp_motion", lost)
    find_motion(pattern, 2)
    assert len(ways) == 4
    assert len(found) == 1


def test_a_large_sheet_is_followed_once_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """A way lost by a sheet of 1,783 vertices was gone again, for minutes."""
    pattern, ways = named_patterns.waterbomb_base(), []

    def lost(*given: Any, **more: Any) -> Any:
        ways.append(more)
        way, verdict = ramp_motion(*given, **more)
        return way, replace(verdict, complete=False, waiting_edges=np.empty(0, dtype=np.int64))

    monkeypatch.setattr(motion, "ramp_motion", lost)
    monkeypatch.setattr(motion, "MOST_AGAIN", 4 * len(pattern.vertices_coords))
    assert motion_findings(find_motion(pattern, 4), ())[0].code != "followed-once"
    assert len(ways) == 4
    ways.clear()
    told = {finding.code: finding for finding in motion_findings(find_motion(pattern, 5), ())}
    assert len(ways) == 1
    assert "ask for at most 4 `steps`" in told["followed-once"].sentence
    monkeypatch.setattr(motion, "contacts", lambda found: [0])
    assert find_motion(pattern, 5).verdict.followed_again == 4
    monkeypatch.setattr(motion, "MOST_AGAIN", 0)
    told = {finding.code: finding for finding in motion_findings(find_motion(pattern, 5), ())}
    assert told["followed-once"].sentence.endswith("with softer paper or with contact.")


@pytest.mark.parametrize(
    ("curved", "wanted"), [(False, [25, 12, 8, 8, 8, 25, 12, 8, 8]), (True, [25, 12, 8, 8, 25, 12])]
)
def test_a_stiff_shape_that_is_not_found_is_looked_for_with_less_patience(
    curved: bool, wanted: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Curved creases have none, and spent most of their time looking for it in each frame: after
    one with the least patience three frames are left out.
    """
    given = []
    found_at = wanted.index(25, 1)

    def solved(balance: Any, *others: Any, factors: int, **more: Any) -> Any:
        found = solve(balance, *others, factors=factors, **more)
        if balance.model.compliance.any():
            return found
        given.append(factors)
        return found._replace(converged=len(given) == found_at)

    def marked(*pattern: Any, **more: Any) -> Any:
        model = flat_model(*pattern, **more)
        return replace(model, ruled=np.array([0])) if curved else model

    monkeypatch.setattr(ramp_walk, "solve", solved)
    monkeypatch.setattr(from_flat, "flat_model", marked)
    _, verdict = ramp_motion(named_patterns.waterbomb_base(), 9)
    assert verdict.complete
    assert given == wanted


def test_a_balance_after_a_descent_is_looked_for_with_all_patience(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With four factorisations a pleated hexagon did not leave the plane in 14 steps."""
    given = []

    def solved(balance: Any, *others: Any, factors: int, **more: Any) -> Any:
        if balance.model.compliance.any():
            given.append(factors)
        return solve(balance, *others, factors=factors, **more)

    monkeypatch.setattr(ramp_walk, "solve", solved)
    ramp_motion(named_patterns.waterbomb_base(), 2)
    assert set(given) == {25}


def test_a_saddle_that_could_not_be_left_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each trial took a descent, and counted as a snap until the way was lost; one that falls in
    more directions is another one.
    """
    unstable, tried, frame = [3, 3, 2, 3, 0, 1], [], ramp_walk.RampWalk.frame
    seen: list[int] = []

    def marked(walk: Any) -> Any:
        seen.append(unstable[len(seen)])
        return replace(frame(walk), unstable=seen[-1])

    def stays(walk: Any) -> bool:
        tried.append(len(seen))
        return False

    monkeypatch.setattr(ramp_walk.RampWalk, "frame", marked)
    monkeypatch.setattr(ramp_walk.RampWalk, "leave_saddle", stays)
    ramp_motion(named_patterns.waterbomb_base(), 6)
    assert tried == [1, 4, 6]


def test_facets_that_move_without_force_make_no_position_unstable() -> None:
    """Six free creases meet in the middle of a hexagon, which so has three mechanisms: as many
    eigenvalues are 0, and rounding gives each a sign. Two flaps fold beside it.
    """
    rim = [(math.cos(turn), math.sin(turn)) for turn in np.radians([0, 60, 120, 180, 240, 300])]
    lines = [((0.0, 0.0), corner, "U", 0.0) for corner in rim]
    for side, (one, other) in enumerate(zip(rim, rim[1:] + rim[:1], strict=True)):
        if side % 3:
            lines.append((one, other, "B", 0.0))
            continue
        out = (one[0] + other[0], one[1] + other[1])
        far = [(end[0] + out[0], end[1] + out[1]) for end in (one, other)]
        lines += [(one, other, "V", 65.0), (one, far[0], "B", 0.0)]
        lines += [(far[0], far[1], "B", 0.0), (far[1], other, "B", 0.0)]
    found = find_motion(named_patterns.drawn(lines), 10)
    assert found.verdict is not None
    assert found.verdict.unstable.tolist() == [0] * 11
    assert found.motion.is_rigid
    flaps = found.motion.pattern.edges_assignment == "V"
    assert np.degrees(found.motion.fold_angles[-1][flaps]) == pytest.approx([65, 65])
