"""Which of the ways from flat is shown: the first, one in finer steps, or one with contact."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import named_patterns
import pytest

from miurafab.origami.folding import motion
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
