"""A job directory that a stranger made, or that something stands in: nothing outside it is read or
written, and what was there before is whole."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import pytest
from sealing import seal

import miurafab
from miurafab.errors import InputError
from miurafab.files import write_draft
from miurafab.gcode.job import Job
from miurafab.machine.append_log import DurableFile
from miurafab.machine.journal import Journal, read_journal
from miurafab.workflow.job_files import job_files, settle_job
from miurafab.workflow.manifest import LAYOUT

ROOT = Path(__file__).parents[2]
CORPUS = ROOT / "tests" / "corpus" / "job"
NAMES = sorted(path.name for path in CORPUS.iterdir())
READ = {
    "check": miurafab.check_job,
    "read": miurafab.read_job,
    "preview": miurafab.preview,
    "cut": lambda job: miurafab.cut(job, port="virtual"),
    "settle": settle_job,
}
needs_links = pytest.mark.skipif(os.name != "posix", reason="makes links")


@pytest.fixture
def job(tmp_path):
    folder = tmp_path / "job"
    folder.mkdir()
    for name in NAMES:
        (folder / name).write_bytes((CORPUS / name).read_bytes())
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["profiles"] = {  # a job of an earlier profile or material is to be made again
        name: hashlib.sha256((ROOT / name).read_bytes()).hexdigest()
        for name in manifest["profiles"]
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def seen(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_the_job_is_whole(job):
    assert miurafab.check_job(job).valid
    assert miurafab.read_job(job).edits == ()


@needs_links
@pytest.mark.parametrize("name", [*NAMES, "sheet-01.journal", "card-250.toml"])
@pytest.mark.parametrize("how", READ)
def test_a_link_out_of_the_job_is_not_followed(job, tmp_path, name, how):
    """Neither to what is the same, nor to a device without an end, nor to nothing."""
    ring = tmp_path / "ring"
    ring.symlink_to(ring)
    for target in (CORPUS / name, Path("/dev/zero"), Path("../gone"), tmp_path, ring):
        (job / name).unlink(missing_ok=True)
        (job / name).symlink_to(target)
        with pytest.raises(InputError, match=f"{name} is a link out of the job"):
            READ[how](job)


@needs_links
def test_a_link_within_the_job_is_a_file_of_it(job):
    (job / "sheet-01.nc").rename(job / "first.txt")
    (job / "sheet-01.nc").symlink_to("first.txt")
    assert miurafab.check_job(job).valid


@needs_links
def test_no_record_is_written_through_a_link(tmp_path):
    victim, link = tmp_path / "victim", tmp_path / "sheet-01.journal"
    victim.write_text("mine")
    for target in (victim, tmp_path / "new"):
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        with pytest.raises(InputError, match=r"The journal .*sheet-01.journal is a link"):
            DurableFile(link, "journal", b"head", append=target is victim)
    assert victim.read_text() == "mine"
    assert not (tmp_path / "new").exists()


def put(folder, *names):
    with job_files(folder) as staging:
        for name in (*names, LAYOUT):
            write_draft(staging / name, "new")


@pytest.mark.parametrize("name", ["sheet-01.nc", "assembly.pdf", "sheet-02.svg"])
def test_a_folder_in_the_way_of_a_file_leaves_the_earlier_job(job, name):
    (job / name).unlink(missing_ok=True)
    (job / name).mkdir()
    before = seen(job)
    with pytest.raises(InputError, match=rf"{name} is a folder where a file belongs|no part of a"):
        put(job, "sheet-01.nc", "sheet-02.svg", "assembly.pdf")
    assert seen(job) == before
    (job / name).rmdir()
    put(job, "sheet-01.nc", "sheet-02.svg", "assembly.pdf")
    assert (job / name).read_text() == "new"


@pytest.mark.parametrize("name", [".lock", ".unfinished"])
def test_what_is_not_of_miurafab_is_named_and_left_alone(job, name):
    before = seen(job)
    (job / name).mkdir() if name == ".lock" else (job / name).write_text("mine")
    with pytest.raises(InputError, match=rf"{name} is not a .* of miurafab; remove it"):
        put(job, "sheet-01.nc")
    if os.name == "posix" and name == ".lock":
        (job / name).rmdir()
        (job / name).symlink_to("../made")
        with pytest.raises(InputError, match=r"\.lock is not a lock of miurafab"):
            put(job, "sheet-01.nc")
        assert not (job.parent / "made").exists()
    (job / name).unlink()
    assert seen(job) == before


NAMED = {"letters": "Sättel 鞍's 😀", "signs": 'a "3:4*b|c<d>?"', "long": 35 * "鞍😀"}


@pytest.mark.parametrize("name", NAMED.values(), ids=NAMED)
def test_a_pattern_of_any_name_becomes_a_job(tmp_path, name):
    path = tmp_path / f"{name}.fold"
    try:
        path.write_bytes((CORPUS / "p.fold").read_bytes())
    except OSError:
        path = tmp_path / f"{name[:60]}.fold"
        path.write_bytes((CORPUS / "p.fold").read_bytes())
    made = miurafab.sheets(path).write(tmp_path / "a job")
    assert miurafab.check_job(made.path).valid
    (copy,) = made.path.glob("*.fold")
    assert len(os.fsencode(copy.name)) <= 220
    assert copy.read_bytes() == path.read_bytes()
    assert not set(copy.name) & set(':*?"<>|')
    inside = made.path / path.name
    inside.write_bytes(path.read_bytes())
    assert miurafab.check_job(miurafab.sheets(inside).write(made.path).path).valid


def rewrite(path, **values):
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


@pytest.mark.parametrize("value", ["x" * 240, "a/b", "..", "", "a\x1b[2J", 3, None])
def test_a_name_that_no_file_can_have_is_refused_in_a_sentence(job, value):
    """A name of 300 letters was an error of the system."""
    for key in ("machine", "material"):
        before = (job / LAYOUT).read_text()
        rewrite(job / LAYOUT, **{key: value})
        with pytest.raises(InputError, match=r"layout\.json.* is not the name of a file"):
            miurafab.read_job(job)
        (job / LAYOUT).write_text(before)
    rewrite(job / "manifest.json", files={str(value): "00"})
    if isinstance(value, str):
        with pytest.raises(InputError, match=r"manifest\.json names .* is not the name of a file"):
            miurafab.check_job(job)


@pytest.mark.parametrize("tool", ["a\x1b[2J", "miurafab" + 200 * "[", "\ud800"])
def test_a_tool_of_a_manifest_is_a_plain_name(job, tool):
    rewrite(job / "manifest.json", tool=tool)
    with pytest.raises(InputError, match=r"manifest\.json .*'tool' is no name and version"):
        miurafab.check_job(job)


WRONG = (
    {"lines": "9"}, {"taken": None}, {"line": -1}, {"line": 2.5}, {"overrides": "abc"},
    {"overrides": [1, 2]}, {"overrides": [1, 2, "3"]}, {"seconds": "1"}, {"why": 3}, {"job": []},
    {"blocks": True}, {"sheet": 1},
)  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG, ids=json.dumps)
def test_a_journal_with_other_values_is_refused_in_a_sentence(tmp_path, wrong):
    path = tmp_path / "a.journal"
    Journal(path, Job("a.nc", "G0X1\n"), "laser", "virtual", 1).close()
    assert read_journal(path)[0].lines == 1
    with path.open("a") as file:
        file.write(json.dumps(wrong) + "\n")
    with pytest.raises(InputError, match=r"a\.journal is not a journal of this version"):
        read_journal(path)


def test_a_patch_of_a_huge_number_is_refused_at_once(job):
    """One of 2 ** 31 took minutes: a table was as long as the number."""
    layout = json.loads((job / LAYOUT).read_text())
    layout["patches"][0]["id"] = 2**31
    (job / LAYOUT).write_text(json.dumps(layout))
    seal(job)
    found = miurafab.check_job(job)
    assert not found.valid
    assert any("not numbered from 0" in finding.sentence for finding in found.findings)
