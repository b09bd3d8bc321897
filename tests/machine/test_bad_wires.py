"""Whole jobs over bad wires: a few of each kind here, hundreds with ``-m large``."""

from __future__ import annotations

from pathlib import Path

import pytest
from bad_wires import ALL, ANSWERS, BLOWS, Trial

SMALL = 3
LARGE = 400


@pytest.mark.parametrize("seed", range(SMALL))
def test_answers_that_are_lost_around_pauses_end_the_job_dark_and_in_time(
    seed: int, tmp_path: Path
) -> None:
    assert Trial(seed, tmp_path / "journal", ANSWERS).run()


@pytest.mark.parametrize("seed", range(SMALL))
def test_whatever_befalls_a_job_it_ends_dark_and_in_time(seed: int, tmp_path: Path) -> None:
    assert Trial(seed, tmp_path / "journal", ALL, BLOWS).run()


@pytest.mark.large
@pytest.mark.parametrize("seed", range(SMALL, LARGE))
def test_lost_answers_more(seed: int, tmp_path: Path) -> None:
    assert Trial(seed, tmp_path / "journal", ANSWERS).run()


@pytest.mark.large
@pytest.mark.parametrize("seed", range(SMALL, LARGE))
def test_whatever_befalls_a_job_more(seed: int, tmp_path: Path) -> None:
    assert Trial(seed, tmp_path / "journal", ALL, BLOWS).run()
