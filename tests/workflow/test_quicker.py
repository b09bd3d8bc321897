"""What a job takes by operation, and what would make it quicker, against the jobs made so."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import times
from problems import regular

import miurafab as mf
from miurafab.profiles.shipped import shipped_directory
from miurafab.workflow.dry_run import at_work

CARD = (shipped_directory("materials") / "card-250.toml").read_text()
SCORED = "".join(f'[creases.{kind}]\nmode = "score"\n' for kind in ("mountain", "valley", "tab"))
CHANGES = {
    "all creases scored (mode = 'score')": lambda text: f"{text}\n{SCORED}",
    "valleys scored (mode = 'score')": lambda text: f'{text}\n[creases.valley]\nmode = "score"\n',
    "dashes of 2.4 mm (cut)": lambda text: text.replace('cut = "1.2mm"', 'cut = "2.4mm"'),
}


def test_the_ways_that_are_told_are_as_quick_as_told(tmp_path):
    knife = mf.load_machine("grbl-knife-a3")
    pattern = regular(9, 7)
    job = mf.sheets(pattern, machine=knife)
    told = job.quicker()
    assert {way.change for way in told} == set(CHANGES)
    assert [way.seconds for way in told] == sorted(way.seconds for way in told)
    for way in told:
        file = Path(tmp_path, "other.toml")
        file.write_text(CHANGES[way.change](CARD))
        made = mf.sheets(pattern, machine=knife, material=file)
        assert way.seconds == pytest.approx(made.seconds, rel=0.05)
        assert made.seconds < 0.95 * job.seconds


def test_a_blade_in_line_that_scores_nothing_has_longer_dashes_alone(tmp_path):
    """Its strokes need no cut that aligns it, and are all found again."""
    knife = (shipped_directory("firmware_profiles") / "grbl-knife-a3.toml").read_text()
    knife = knife.replace("s_down", 'leave_out = ["score"]\ns_down')
    file = tmp_path / "deep.toml"
    file.write_text(re.sub('offset = "[^"]*"', 'offset = "0mm"', knife))
    job = mf.sheets(regular(5, 5), machine=file)
    assert [way.change for way in job.quicker()] == ["dashes of 2.4 mm (cut)"]
    job.write(tmp_path / "job")
    checked = mf.check_job(tmp_path / "job")
    assert checked.valid
    assert [finding.code for finding in checked.findings] == ["no-target"]


def test_the_table_of_docs_is_of_the_jobs_that_it_names(capsys, tmp_path):
    file = tmp_path / "times.json"
    assert times.main(["--facets", "3x3", "--size", "60mm", "--json", str(file)]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2 + 4
    laser, knife, pen, dashed = json.loads(file.read_text())
    assert (pen["machine"], pen["creases"]) == (dashed["machine"], "as usual")
    # A pen that draws lines is lifted less, and so is quicker.
    assert 2 * pen["lifts"] < dashed["lifts"]
    assert 1.5 * pen["seconds"] < dashed["seconds"]
    assert laser["seconds"] < pen["seconds"] < knife["seconds"]
    assert max(knife["ways"].values()) < knife["seconds"]
    job = mf.sheets(mf.fit("hypar", facets=(3, 3), size=60), machine=pen["machine"])
    assert job.seconds == pen["seconds"]


@pytest.mark.parametrize(
    ("machine", "word"),
    [("grbl-laser-400", "beam on"), ("grbl-pen-a4", "pen down"), ("grbl-knife-a3", "knife down")],
)
def test_the_operations_take_the_time_of_the_job(machine, word):
    job = mf.sheets(regular(5, 5), machine=machine)
    assert sum(job.operation_seconds.values()) == pytest.approx(job.seconds, abs=0.1)
    assert {"engrave", "cut"} <= set(job.operation_seconds)
    assert at_work(job.machine) == word
