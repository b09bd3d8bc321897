"""Files of others with a flat pattern and a folded form: one of another size, one of another sheet,
and one that is folded flat, whose facets lie on each other."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import miurafab as mf
from miurafab.origami.formats.fold import parse_fold

FLAT = [[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [2, 1], [1, 1], [0, 1]]


def folded(one: float, other: float) -> np.ndarray:
    """A strip of three squares, the outer ones turned up by the angles ``one`` and ``other``."""
    x, y = np.array(FLAT, dtype=np.float64).T
    left, right = np.maximum(1 - x, 0), np.maximum(x - 2, 0)
    along = np.clip(x, 1, 2) - left * math.cos(one) + right * math.cos(other)
    return np.stack([along, y, left * math.sin(one) + right * math.sin(other)], axis=1)


def strip(form: np.ndarray, **keys: Any) -> dict[str, Any]:
    """The FOLD document of another program, with fold angles if ``keys`` give them."""
    return {
        "frame_classes": ["creasePattern"],
        "vertices_coords": FLAT,
        "edges_vertices": [[n, (n + 1) % 8] for n in range(8)] + [[1, 6], [2, 5]],
        "edges_assignment": [*"BBBBBBBBVV"],
        "faces_vertices": [[0, 1, 6, 7], [1, 2, 5, 6], [2, 3, 4, 5]],
        "file_frames": [
            {
                "frame_classes": ["foldedForm"],
                "frame_parent": 0,
                "frame_inherit": True,
                "vertices_coords": form.tolist(),
            }
        ],
        **keys,
    }


def test_a_folded_form_of_another_size_is_taken_at_that_of_the_flat_pattern() -> None:
    form = folded(0.5, 1.0)
    read = parse_fold(strip(1.42 * form))
    assert read.folded_coords == pytest.approx(form, abs=1e-12)
    (told,) = read.told
    assert told.code == "resized"
    assert "1.42 times" in told.sentence
    assert read.edges_fold_angle[-2:] == pytest.approx([0.5, 1.0])
    assert mf.check(read).valid


def test_a_folded_form_of_another_sheet_is_left_out_and_its_letters_fold(tmp_path: Path) -> None:
    form = folded(0.5, 1.0)
    form[3:5, 0] += 0.01  # one square is longer
    file = tmp_path / "strip.fold"
    file.write_text(json.dumps(strip(form)))
    checked = mf.check(file)
    assert [finding.code for finding in checked.findings[:1]] == ["folded-form"]
    assert "up to 0.0" in checked.findings[0].sentence
    motion = mf.fold(file, steps=4)
    assert "folded-form" in [finding["code"] for finding in motion.report()["findings"]]
    assert motion.report()["max_strain"] < 1e-12
    assert np.abs(motion.motion.fold_angles[-1, -2:]) == pytest.approx([math.pi, math.pi])
    mf.convert(file, tmp_path / "strip.cp")
    assert mf.load(tmp_path / "strip.cp").folded_coords is None


def test_a_file_of_ours_whose_forms_differ_is_refused_as_ever() -> None:
    form = folded(0.5, 1.0)
    form[3:5, 0] += 0.01
    read = parse_fold(strip(form, **{"miurafab:scale": 1.0}))
    assert read.folded_coords is not None
    assert not mf.check(read).valid


def test_facets_of_a_form_folded_flat_lie_on_each_other() -> None:
    """Both outer squares lie on the middle one: the order of the layers is told to be not judged;
    it is no fault, as it is where a facet passes through another."""
    checked = mf.check(parse_fold(strip(folded(math.pi, math.pi))))
    assert checked.valid
    assert any("lie on each other" in finding.sentence for finding in checked.findings)
    steep = [f.sentence for f in checked.findings if f.code == "steep-folds"]
    assert len(steep) == 1
    assert "amplitude" not in steep[0]
    through = mf.check(parse_fold(strip(folded(math.radians(150), math.radians(150)))))
    assert [f.code for f in through.findings if f.severity == "refusal"] == ["self-intersection"]


def test_forms_of_few_digits_are_as_exact_as_those_and_told_so(tmp_path: Path) -> None:
    rounded = np.round(folded(0.5, 1.0), 9)
    document = strip(rounded)
    read = parse_fold(document)
    left = float(np.abs(rounded - folded(0.5, 1.0)).max())
    assert left / 2 < read.rounded < 4 * left
    assert [finding.code for finding in read.told] == ["rounded"]
    checked = mf.check(read)
    assert checked.valid
    assert any(f"within {read.rounded:.2g} mean edges" in sentence for sentence in checked.proved)
    # what we write of it has the same digits; in another unit it has all, and only claims
    read.save(tmp_path / "strip.fold")
    again = mf.load(tmp_path / "strip.fold")
    assert again.rounded == read.rounded
    assert mf.check(again).valid
    read.scaled(25.4).save(tmp_path / "inches.fold")
    assert not mf.check(tmp_path / "inches.fold").valid


def test_forms_that_differ_by_more_than_their_digits_explain_are_refused() -> None:
    form = np.round(folded(0.5, 1.0), 9)
    form[3:5, 0] += 1e-6
    read = parse_fold(strip(form))
    assert read.rounded is None
    assert not mf.check(read).valid
    exact = folded(0.5, 1.0)
    exact[3:5, 0] += 1e-9  # with all its digits
    assert parse_fold(strip(exact)).rounded is None


def test_forms_of_single_precision_are_as_exact_as_that() -> None:
    read = parse_fold(strip(folded(0.5, 1.0).astype(np.float32).astype(np.float64)))
    assert 1e-9 < read.rounded < 1e-6
    assert mf.check(read).valid


@pytest.mark.parametrize("name", ["rounded", "unfolded"])
def test_what_a_file_claims_of_its_digits_is_not_believed(name: str) -> None:
    """Full digits, 5e-5 off: neither rounding nor the flat pattern of that folded form."""
    form = folded(0.5, 1.0)
    form[3:5, 0] += 5e-5 / 3
    honest = parse_fold(strip(form, **{"miurafab:scale": 1.0}))
    claimed = parse_fold(strip(form, **{"miurafab:scale": 1.0, f"miurafab:{name}": 1e-4}))
    assert not mf.check(honest).valid
    assert not mf.check(claimed).valid
    assert (claimed.rounded, claimed.unfolded, claimed.told) == (None, None, ())
