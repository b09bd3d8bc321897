"""The page on JSON names the fields that the commands print, no more and no less."""

import json
import re

import pytest
from commands import run_line
from pages import ROOT

PAGE = ROOT / "docs" / "reference" / "json.md"
SECTIONS = {
    "fit": "miurafab fit hypar --facets 6x6 -o h.fold --json",
    "check of a job": "miurafab check job --json",
    "fold": "miurafab fold h.fold -o h.html --json",
    "energy": "miurafab energy h.fold --json",
    "energy with a pull": "miurafab energy h.fold --pull corners --json",
    "convert": "miurafab convert h.fold h.svg --json",
    "sheets": "miurafab sheets h.fold -o job2 --json",
    "preview": "miurafab preview job --json",
    "cut": "miurafab cut job --port virtual --json",
    "tradeoff": "miurafab tradeoff hypar --sides 4,5,6 --json",
    "calibrate": "miurafab calibrate -o trial --json",
    "machine info": "miurafab machine info --port virtual --json",
    "surfaces": "miurafab surfaces --json",
    "doctor": "miurafab doctor --json",
}


def _rows(section):
    """The rows of the table of ``section``: the fields, and what is said of them."""
    text = PAGE.read_text(encoding="utf-8").split(f"\n## {section}\n")[1].split("\n## ")[0]
    return re.findall(r"^\| (`.*?) \| (.*) \|$", text, re.MULTILINE)


def _fields(section):
    return {name for cell, _ in _rows(section) for name in re.findall(r"`(\w+)`", cell)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("json")
    run_line("miurafab fit hypar --facets 6x6 -o h.fold --quiet", folder)
    run_line("miurafab sheets h.fold -o job --quiet", folder)
    return folder


def _printed(line, folder):
    """The object that ``line`` prints, whatever was told beside it."""
    text = run_line(line, folder)
    return json.loads(text[text.index("\n{") if not text.startswith("{") else 0 :])


@pytest.mark.parametrize("section", SECTIONS)
def test_the_page_has_the_fields_of(folder, section):
    assert set(_printed(SECTIONS[section], folder)) == _fields(section)


def test_a_motion_from_flat_has_fields_of_its_own(folder):
    """A waterbomb base: six creases meet, so that no closed form is known."""
    rim = [(-9, -9), (9, -9), (9, 0), (9, 9), (-9, 9), (-9, 0)]
    bomb = {
        "vertices_coords": [(0, 0), *rim],
        "edges_vertices": [(0, k) for k in range(1, 7)] + [(k, k % 6 + 1) for k in range(1, 7)],
        "edges_assignment": [*"VVMVVM", *"BBBBBB"],
    }
    (folder / "bomb.fold").write_text(json.dumps(bomb))
    printed = set(_printed("miurafab fold bomb.fold --json --steps 2", folder))
    assert printed == _fields("fold") | _fields("fold from flat")


def test_a_check_has_the_fields_that_are_marked(folder):
    marked = {
        name
        for cell, meaning in _rows("fit")
        if "*check*" in meaning
        for name in re.findall(r"`(\w+)`", cell)
    }
    printed = set(_printed("miurafab check h.fold --json", folder))
    assert printed == marked | {"status", "advice", "iterations", "seconds", "proved"}
