"""What the check of a job reports: its verdict, its counts, and each finding with its place."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from sealing import seal
from test_forged_jobs import KINDS, made

import miurafab as mf
from miurafab.errors import LayoutError
from miurafab.workflow.whole_folder import ORDER, STAGING


@pytest.fixture
def job(tmp_path: Path) -> Path:
    return shutil.copytree(made("glue"), tmp_path / "job")


def places(found: mf.JobCheck) -> list[tuple[str, str]]:
    return [(each.code, each.where) for each in found.findings if each.code != "no-target"]


def rewritten(folder: Path, name: str, was: str, becomes: str) -> mf.JobCheck:
    """The check of a job of which the first ``was`` in a file is changed, sums and all."""
    text = (folder / name).read_text()
    assert was in text
    (folder / name).write_text(text.replace(was, becomes, 1))
    seal(folder)
    return mf.check_job(folder)


def test_a_whole_job_is_reported_with_its_counts(job: Path) -> None:
    found = mf.check_job(job)
    strokes = sum(KINDS["glue"].values())
    assert repr(found) == f"<JobCheck valid: 6 files, {strokes} strokes traced>"
    report = found.report()
    assert {name: report[name] for name in ("status", "job", "files", "traced")} == {
        "status": "valid",
        "job": str(job),
        "files": 6,
        "traced": KINDS["glue"],
    }
    assert [each["code"] for each in report["findings"]] == ["no-target"]
    assert found.path == job


def test_a_job_that_a_process_left_half_written_is_finished_first(job: Path) -> None:
    staging, names = job / STAGING, ["manifest.json", "layout.json"]
    staging.mkdir()
    for name in names:
        (job / name).rename(staging / name)
    order = {"first": [], "remove": [], "put": names}
    (staging / ORDER).write_text(json.dumps(order))
    assert places(mf.check_job(job)) == []
    assert not staging.exists()


def test_of_a_job_that_lacks_a_file_nothing_is_traced(job: Path) -> None:
    (job / "sheet-01.svg").unlink()
    found = mf.check_job(job)
    assert [(each.code, each.where) for each in found.findings] == [("edited", "sheet-01.svg")]
    assert found.traced == {}
    assert repr(found) == "<JobCheck invalid: 6 files, 0 strokes traced>"
    assert found.report()["status"] == "invalid"


def test_of_a_job_whose_files_have_changed_all_is_traced(job: Path) -> None:
    (job / "sheet-01.svg").write_text("<svg/>")
    found = mf.check_job(job)
    assert places(found) == [("edited", "sheet-01.svg")]
    assert found.traced == KINDS["glue"]
    assert not found.valid


def test_a_program_is_judged_as_before_a_cut(job: Path) -> None:
    found = rewritten(job, "sheet-01.nc", "M4 S0\n", "M3 S0 (!)\n")
    assert places(found) == [("m3", "sheet-01.nc:9"), ("characters", "sheet-01.nc:9")]
    assert found.traced == KINDS["glue"]


def test_the_power_of_a_program_is_that_of_its_material(job: Path) -> None:
    """Card takes 9 W of the 10 W of this laser."""
    found = rewritten(job, "sheet-01.nc", " S800 ", " S900 ")
    assert places(found) == []
    text = (job / "sheet-01.nc").read_text()
    line = text[: text.index(" S900 ")].count("\n") + 1
    found = rewritten(job, "sheet-01.nc", " S900 ", " S901 ")
    assert places(found) == [("material", f"sheet-01.nc:{line}")]
    assert found.traced == KINDS["glue"]


def test_what_the_layout_tells_is_told_again(job: Path) -> None:
    layout = json.loads((job / "layout.json").read_text())
    told = {"code": "weak-tabs", "sentence": "A tab has little glue.", "where": "P1"}
    layout["findings"] = [told]
    (job / "layout.json").write_text(json.dumps(layout))
    seal(job)
    assert ("weak-tabs", "P1") in places(mf.check_job(job))


def layout_of(job: Path, **values: Any) -> mf.JobCheck:
    layout = json.loads((job / "layout.json").read_text()) | values
    (job / "layout.json").write_text(json.dumps(layout))
    seal(job)
    return mf.check_job(job)


def test_a_layout_is_at_fault_where_it_stands(job: Path) -> None:
    layout = json.loads((job / "layout.json").read_text())
    patches = layout["patches"]
    patches[0]["tabs"][0]["fold"] = "valley"
    found = layout_of(job, patches=patches)
    assert places(found) == [("layout", "layout.json")]
    patches[0]["faces"].pop()
    found = layout_of(job, patches=patches)
    assert places(found) == [("layout", "layout.json")]
    assert found.traced == {}
    patches[0]["tabs"][0]["polygon_mm"][0] = [1e308, 0.0]
    with pytest.raises(LayoutError, match=r"layout\.json"):
        layout_of(job, patches=patches)


def test_a_pattern_that_does_not_hold_is_a_fault_of_the_job(job: Path) -> None:
    document = json.loads((job / "sheet.fold").read_text())
    crease = document["edges_assignment"].index("M")
    document["edges_assignment"][crease] = "V"
    (job / "sheet.fold").write_text(json.dumps(document))
    seal(job)
    assert ("assignment", (crease,)) in places(mf.check_job(job))
