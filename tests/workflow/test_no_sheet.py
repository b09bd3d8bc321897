"""A fit that finds no sheet is an answer, in whatever room it is asked for."""

import csv
import json

import numpy as np
import pytest
from problems import saddle_mesh

import miurafab as mf
from miurafab.errors import InputError, LayoutError, PatternError
from miurafab.fabrication import plan_size
from miurafab.workflow.cut import prepare

NONE = {"facets": "4x4", "polish": "off", "timeout": "0.000001"}
"""No time to find one, and nothing is tried first."""
WORDS = [word for name, value in NONE.items() for word in (f"--{name}", value)]
WHY = "'timeout' ended the search before an exact sheet was found; allow more."


@pytest.mark.parametrize("size", ["100mm", "bed"])
def test_a_fit_says_why_and_writes_no_pattern(run, tmp_path, size):
    done = run("fit", "hypar", *WORDS, "--size", size, "-o", "x.fold", "--json")
    assert (done.returncode, done.stderr) == (1, "")
    answer = json.loads(done.stdout)
    assert answer["status"] == "stalled"
    assert WHY.replace("'timeout'", "--timeout") in answer["advice"]
    assert list(tmp_path.glob("*.fold")) == []


@pytest.mark.parametrize("polish", ["on", "off"])
def test_a_search_of_the_size_that_runs_out_of_time_was_not_interrupted(polish):
    """Polished, the first start of the first size is made whatever the time."""
    limits = {"min_edge": "3mm", "max_distance": "1mm"}
    found = mf.fit("hypar", **limits, polish=polish, timeout="0.000001")
    assert found.status == ("infeasible" if polish == "on" else "stalled")
    assert (found.pattern is None) == (polish == "off")
    assert found.advice


def test_it_is_neither_cut_nor_laid_out(run):
    done = run("cut", "hypar", *WORDS, "--port", "virtual")
    assert (done.returncode, done.stderr) == (1, "")
    assert done.stdout.startswith("hypar is not cut: The --timeout ended the search before")
    assert prepare("hypar", options=NONE | {"size": "bed"}).refused
    prepared = prepare("hypar", options=NONE)
    with pytest.raises(InputError, match=f"hypar cannot be cut: The {WHY}"):
        prepared.chosen(None)
    with pytest.raises(PatternError, match=f"The fit found no sheet: The {WHY}"):
        mf.sheets(mf.fit("hypar", **NONE))


def test_what_was_found_of_a_mesh_is_told_before(run, tmp_path):
    mesh = saddle_mesh(9)
    mesh.update_faces(~np.isin(np.arange(len(mesh.faces)), [60, 61, 62, 63]))
    mesh.export(tmp_path / "torn.stl")
    done = run("fit", "torn.stl", *WORDS, "-o", "x.fold")
    assert done.returncode == 1
    assert "the largest is the target, and 3 others with 2.7 %" in " ".join(done.stderr.split())


def test_a_trade_off_lists_it_and_has_no_law(run, tmp_path):
    words = [*WORDS[2:], "--sides", "4,6,8", "--workers", "1", "-o", "x.csv"]
    done = run("tradeoff", "hypar", *words)
    assert (done.returncode, done.stderr) == (1, "")
    assert "Fewer than three sheets were found: there is no law to fit." in done.stdout
    with (tmp_path / "x.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["facets"], row["status"], row["hausdorff_mm"]) for row in rows] == [
        ("16", "stalled", ""),
        ("36", "stalled", ""),
        ("64", "stalled", ""),
    ]


# The size of the bed


class Sizes:
    """The bed takes half of each fit, on the stock that is asked for."""

    held, stock = True, None

    def __init__(self, pattern, machine, material, options, sheets):
        type(self).stock = options.nesting.stock
        self.side = float(np.ptp(pattern.folded_coords, axis=0).max())

    def largest_scale(self):
        return 0.5 * 200 / self.side

    def holds(self):
        return self.held


def test_the_stock_that_is_named_decides_the_size(monkeypatch, tmp_path):
    monkeypatch.setattr(plan_size, "Sizing", Sizes)
    stock = tmp_path / "stock.toml"
    found = mf.fit("hypar", facets="4x4", polish="off", size="bed", stock=stock)
    assert np.ptp(found.pattern.folded_coords, axis=0).max() == pytest.approx(100)
    assert Sizes.stock == stock


def test_a_size_that_never_holds_is_told(monkeypatch):
    monkeypatch.setattr(plan_size, "Sizing", Sizes)
    monkeypatch.setattr(Sizes, "held", False)
    with pytest.raises(LayoutError, match=r"No 'size' was found .* then fits; about 100 mm fit"):
        mf.fit("hypar", facets="4x4", polish="off", size="bed")
