"""A job directory is changed whole or not at all."""

import errno
import json
import os

import pytest
from problems import regular

import miurafab as mf
from miurafab.errors import InputError
from miurafab.origami.formats.fold import fold_text
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.origami.unfold import unfold
from miurafab.profiles import find_file
from miurafab.workflow.job_files import LAYOUT, job_files, keep_profiles
from miurafab.workflow.sheets import sheets

SHEETS = ("sheet-01.nc", "sheet-01.svg", "assembly.pdf")
LASER, FLUIDNC = (
    find_file("firmware_profiles", name) for name in ("grbl-laser-400", "fluidnc-laser-600")
)
CARD = find_file("materials", "card-250")


def put(directory, names=SHEETS, content="new", sheets=("sheet-01",), fail=None):
    with job_files(directory) as staging:
        for name in names:
            (staging / name).write_text(content)
        if fail is not None:
            raise fail
        layout = {
            "sheets": [{"name": name} for name in sheets],
            "pattern": {"file": "p.fold"},
            "machine": "m",
            "material": "n",
        }
        (staging / LAYOUT).write_text(json.dumps(layout))


def seen(directory):
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def full():
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_leaves_nothing_behind(tmp_path):
    with pytest.raises(InputError, match="job cannot be written: No space left on device"):
        put(tmp_path / "a" / "job", fail=full())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("fault", [full(), InputError("no layout"), KeyboardInterrupt()])
def test_what_fails_leaves_the_earlier_job_as_it_was(tmp_path, fault):
    put(tmp_path, content="old")
    before = seen(tmp_path)
    with pytest.raises((InputError, KeyboardInterrupt)):
        put(tmp_path, content="half", fail=fault)
    assert seen(tmp_path) == before


def test_a_missing_file_of_somewhere_else_is_not_blamed_on_the_directory(tmp_path):
    with pytest.raises(FileNotFoundError), job_files(tmp_path / "job"):
        (tmp_path / "elsewhere").read_text()


def test_an_earlier_job_goes_with_all_its_drawings_and_guides(tmp_path):
    put(tmp_path, (*SHEETS, "sheet-02.nc", "sheet-02-a4.pdf", "pattern.svg"), "old",
        ("sheet-01", "sheet-02"))  # fmt: skip
    (tmp_path / "notes.txt").write_text("mine")
    put(tmp_path, ("sheet-01.plt", "calibration.pdf"))
    assert set(seen(tmp_path)) == {"sheet-01.plt", "calibration.pdf", "notes.txt", LAYOUT}


@pytest.mark.parametrize("name", ["sheet-01.svg", "assembly.pdf"])
def test_what_is_no_part_of_a_job_is_not_overwritten(tmp_path, name):
    (tmp_path / name).write_text("mine")
    before = seen(tmp_path)
    with pytest.raises(InputError, match=f"{name} is no part of a job"):
        put(tmp_path)
    assert seen(tmp_path) == before


def test_a_pattern_of_the_same_name_is_not_overwritten(tmp_path):
    flat = unfold(regular_miura(MiuraCell(20, 20, 1.2, 0.8), 3, 3))
    (tmp_path / "p.fold").write_text(fold_text(flat, "p"))
    job = tmp_path / "job"
    job.mkdir()
    (job / "p.fold").write_text("another design")
    with pytest.raises(InputError, match=r"p\.fold is no part of a job"):
        sheets(tmp_path / "p.fold").write(job)
    assert seen(job) == {"p.fold": b"another design"}
    (job / "p.fold").write_bytes((tmp_path / "p.fold").read_bytes())  # the same design
    made = sheets(tmp_path / "p.fold").write(job)
    (job / "sheet-01.nc").unlink()
    with pytest.raises(InputError, match=r"sheet-01\.nc is missing; make the job again"):
        mf.read_job(made.path)
    with pytest.raises(InputError, match="nowhere holds no whole job"):
        mf.read_job(tmp_path / "nowhere")


def test_a_file_is_no_directory(tmp_path):
    (tmp_path / "job").write_text("")
    with pytest.raises(InputError, match="is a file"):
        put(tmp_path / "job")


def test_profiles_of_one_name_are_told_apart(tmp_path):
    job, staging = tmp_path / "job", tmp_path / "staging"
    job.mkdir()
    staging.mkdir()
    (job / "grbl-laser-400.toml").write_text("own")
    with pytest.raises(InputError, match="would stand in for the shipped grbl-laser-400"):
        keep_profiles(LASER, CARD, job, staging)
    keep_profiles(job / "grbl-laser-400.toml", CARD, job, staging)
    assert (staging / "grbl-laser-400.toml").read_text() == "own"
    with pytest.raises(InputError, match="both called grbl-laser-400"):
        keep_profiles(FLUIDNC, job / "grbl-laser-400.toml", job, staging)


def test_a_sheet_in_hpgl_is_one_file_and_a_page_of_any_size_is_of_the_job(tmp_path):
    made = mf.sheets(regular(), machine="hpgl-cutter-a3", material="paper-100")
    made.write(tmp_path, formats="hpgl,tiled-200x300mm,tiled-tabloid")
    names = {path.name for path in tmp_path.iterdir()}
    assert {"sheet-01.plt", "sheet-01-200x300mm.pdf", "sheet-01-tabloid.pdf"} <= names
    assert "sheet-01.hpgl" not in names
    made.write(tmp_path)
    left = {path.name for path in tmp_path.iterdir()}
    assert names - left == {"sheet-01-200x300mm.pdf", "sheet-01-tabloid.pdf"}
