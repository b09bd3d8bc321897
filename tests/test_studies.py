"""The tables of the studies in docs, computed again in part by the commands that write them."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def study(name):
    """A module of benchmarks/."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "benchmarks" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows_of(page, command, name):
    """The rows of a table that ``command`` wrote into a page, as lists of cells."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    block = re.search(rf"<!-- {command}: {name} -->\n(.*?)<!-- end -->", text, re.DOTALL)[1]
    lines = [line for line in block.splitlines() if line.startswith("| ")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def same(written, computed, rel):
    """Whether two cells have the same words, and numbers within ``rel``."""
    assert _NUMBER.sub("#", written) == _NUMBER.sub("#", computed)
    numbers = ([float(n) for n in _NUMBER.findall(cell)] for cell in (written, computed))
    ours, theirs = numbers
    assert ours == pytest.approx(theirs, rel=rel)


def test_the_force_table_is_what_its_command_computes(monkeypatch):
    force_table = study("force_table")
    pair = {"fitted": force_table.pairs()["fitted"]}
    monkeypatch.setattr(force_table, "pairs", lambda: pair)
    monkeypatch.setattr(force_table, "POINTS", {"corners": force_table.POINTS["corners"]})
    written = rows_of("forces.md", "force_table", "forces")
    (computed,) = force_table.forces()[1]
    for cell, other in zip(written[0], computed, strict=True):
        same(cell, other, 0.03)
    assert all(float(n) > 0.95 for kind, *_, n in (row[:5] for row in written) if kind == "fitted")
    low, high = float(written[0][3].split(" / ")[0]) / force_table.MEASURED_N, 3.0
    assert 1 / high <= low <= high


def test_the_verdict_of_the_force_table_is_that_of_its_rows(monkeypatch):
    force_table = study("force_table")
    rows = [tuple(row) for row in rows_of("forces.md", "force_table", "forces")]
    monkeypatch.setattr(force_table, "forces", lambda: ((), rows))
    text = (ROOT / "docs" / "forces.md").read_text(encoding="utf-8")
    for sentence in force_table.summary():
        assert f"- {sentence}\n" in text
