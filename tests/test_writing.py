"""Whatever is written takes the place of what was there, whole or not at all."""

import ast
import errno
import json
import os
import shutil
import stat
import threading
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import sentence
from disk import calls_of, full_from, killed_at
from problems import regular

import miurafab
from miurafab.errors import InputError
from miurafab.files import (
    Reading,
    as_path,
    new_file,
    new_folder,
    sync_folder,
    write_bytes,
    write_draft,
    write_text,
)
from miurafab.profiles.own import OwnDefaults, write_defaults
from miurafab.workflow import whole_folder
from miurafab.workflow.fold import fold
from miurafab.workflow.job_files import LAYOUT, job_files, settle_job
from miurafab.workflow.whole_folder import ORDER, STAGING

ROOT = Path(__file__).parent.parent
PATTERN = regular(3, 3)
MOTION = fold(PATTERN, steps=2)
WRITERS = {
    "text": lambda path: write_text(path, "new"),
    **{
        ending: lambda path: PATTERN.save(path, title="new")
        for ending in (".fold", ".svg", ".dxf", ".cp", ".opx", ".obj", ".stl", ".glb")
    },
    **{f"motion{ending}": MOTION.save for ending in (".fold", ".glb", ".html")},
    "angles.csv": MOTION.save_angles,
}
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="kills a fork of the tests")


@pytest.fixture(autouse=True)
def a_quick_disk(monkeypatch):
    """A process that is killed loses nothing that it wrote, so the tests need not wait."""
    monkeypatch.setattr(os, "fsync", lambda opened: None)


def seen(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_is_the_earlier_or_the_new_one(tmp_path, name):
    """Killed at each call, and on a disk that is full from each call on."""
    path = tmp_path / f"thing{name}"

    def write():
        WRITERS[name](path)

    write()
    new, old = path.read_bytes(), b"the only copy"
    calls = calls_of(write)
    found = set()
    for number in range(1, calls + 1):
        path.write_bytes(old)
        assert killed_at(number, write)
        found.add(path.read_bytes())
        assert all(each.endswith(".new") for each in seen(tmp_path) if each != path.name)
    assert found == {old, new}
    for left in set(tmp_path.iterdir()) - {path}:
        left.unlink()
    refused = 0
    for number in range(1, calls + 1):
        path.write_bytes(old)
        said = failure_of(number, write)
        refused += said != ""
        assert said in ("", f"{path} cannot be written: No space left on device.")
        assert list(seen(tmp_path)) == [path.name]
        assert path.read_bytes() in (old, new)
    assert refused >= 3


def failure_of(number, work):
    """The sentence of ``work`` on a disk that is full from its call ``number`` on, or nothing."""
    try:
        with full_from(number):
            work()
    except InputError as fault:
        return str(fault)
    return ""


def put(directory, sheets, content):
    layout = {
        "sheets": [{"name": name} for name in sheets],
        "pattern": {"file": "p.fold"},
        "machine": "m",
        "material": "n",
    }
    with job_files(directory) as staging:
        for name in sheets:
            for ending in (".nc", ".svg"):
                write_draft(staging / f"{name}{ending}", content)
        for name in ("p.fold", "manifest.json"):
            write_draft(staging / name, content)
        write_draft(staging / LAYOUT, json.dumps(layout))


OLD, NEW = ("sheet-01", "sheet-02", "sheet-03"), ("sheet-01", "sheet-02")


def put_old(directory):
    put(directory, OLD, "old")
    write_text(directory / "notes.txt", "mine")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The old job and the new one."""
    folder = tmp_path_factory.mktemp("whole")
    put_old(folder)
    old = seen(folder)
    put(folder, NEW, "new")
    assert set(old) - set(seen(folder)) == {"sheet-03.nc", "sheet-03.svg"}
    return old, seen(folder)


def test_a_job_is_the_earlier_or_the_new_one_wherever_it_is_killed(tmp_path, whole):
    put_old(tmp_path / "count")
    calls = calls_of(lambda: put(tmp_path / "count", NEW, "new"))
    assert calls > 50
    which = []
    shutil.rmtree(tmp_path / "count")
    put_old(tmp_path / "old")
    for number in range(1, calls + 1):
        job = shutil.copytree(tmp_path / "old", tmp_path / str(number))
        assert killed_at(number, lambda job=job: put(job, NEW, "new"))
        settle_job(job)  # as every command does before it reads one
        left = {name: content for name, content in seen(job).items() if name != ".lock"}
        which.append(whole.index(left))
        put(job, NEW, "new")
        assert seen(job) == whole[1]
        assert not (job / STAGING).exists()
    assert which == sorted(which)
    assert set(which) == {0, 1}


def test_a_settling_that_is_killed_is_settled_again(tmp_path, whole):
    def half_done(job):
        put_old(job)
        calls = calls_of(lambda: put(tmp_path / "count", NEW, "new"))
        for number in range(calls, 0, -1):
            put_old(job)
            killed_at(number, lambda: put(job, NEW, "new"))
            if (job / STAGING / "order.json").exists() and (job / STAGING / LAYOUT).exists():
                return
        raise AssertionError("it never stopped between")

    put_old(tmp_path / "count")
    half_done(tmp_path / "job")
    job = tmp_path / "job"
    for number in range(1, 40):
        if not killed_at(number, lambda: settle_job(job)):
            break
    left = {name: content for name, content in seen(job).items() if name != ".lock"}
    assert left == whole[1]


def test_a_full_disk_leaves_one_job_whole(tmp_path, whole):
    put_old(tmp_path / "count")
    calls = calls_of(lambda: put(tmp_path / "count", NEW, "new"))
    refused = 0
    for number in range(1, calls + 1, 2):
        job = tmp_path / str(number)
        put_old(job)
        said = failure_of(number, lambda job=job: put(job, NEW, "new"))
        refused += said != ""
        assert not said or "No space left on device" in said
        settle_job(job)
        assert seen(job) in whole
    assert refused > 20


def test_a_second_writer_is_told_the_truth(tmp_path):
    put_old(tmp_path)
    before = seen(tmp_path)
    said = []

    def second():
        try:
            put(tmp_path, NEW, "second")
        except InputError as fault:
            said.append(str(fault))

    with job_files(tmp_path):
        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
        assert {name: text for name, text in seen(tmp_path).items() if name != ".lock"} == before
        write_text(tmp_path / STAGING / LAYOUT, (tmp_path / LAYOUT).read_text())
    assert said == [
        f"{tmp_path} is being written by another miurafab; wait until it has ended, or choose "
        "another directory."
    ]


def test_an_order_of_a_stranger_removes_nothing(tmp_path):
    (tmp_path / STAGING).mkdir()
    (tmp_path / "thesis.txt").write_text("mine")
    for order in ({"first": [], "remove": ["thesis.txt"], "put": []},
                  {"first": ["../victim"], "remove": [], "put": []}, [], {"put": 3}):  # fmt: skip
        (tmp_path / STAGING / "order.json").write_text(json.dumps(order))
        with pytest.raises(InputError, match=r"order\.json"):
            settle_job(tmp_path)
    assert (tmp_path / "thesis.txt").exists()


def test_a_layout_of_a_stranger_removes_nothing(tmp_path):
    (tmp_path / "victim.svg").write_text("mine")
    for name in ("../victim", "victim", 3):
        layout = {"sheets": [{"name": name}], "pattern": {"file": "p"}, "machine": "m",
                  "material": "n"}  # fmt: skip
        (tmp_path / LAYOUT).write_text(json.dumps(layout))
        with pytest.raises(InputError, match=r"layout\.json is not a layout of this version"):
            put(tmp_path, NEW, "new")
    assert (tmp_path / "victim.svg").exists()


def test_a_link_is_followed_and_permissions_are_kept(tmp_path):
    real, link = tmp_path / "real", tmp_path / "link"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640


def test_a_pipe_is_written_as_it_is(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    write_bytes(pipe, b"through")
    reader.join()
    assert got == [b"through"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_the_defaults_of_a_person(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    path = write_defaults(OwnDefaults(machine="a"))
    with full_from(3), pytest.raises(InputError, match=r"defaults\.toml cannot be written"):
        write_defaults(OwnDefaults(machine="b"))
    assert path.read_text() == 'machine = "a"\n'


def test_pictures_need_a_folder(tmp_path):
    (tmp_path / "x.svg").write_text("mine")
    for name in ("x.svg", "y.svg"):
        with pytest.raises(InputError, match="give a folder"):
            new_folder(tmp_path / name, "The folder of the preview")
    assert new_folder(tmp_path / "a" / "b", "The folder").is_dir()


def test_a_sheet_that_misses_a_limit_replaces_nothing(run, tmp_path, monkeypatch):
    asked = ("fit", "plane", "--facets", "4x4", "--size", "100mm", "-o", "sheet.fold")
    assert run(*asked).returncode == 0
    good = (tmp_path / "sheet.fold").read_bytes()
    fit = miurafab.fit
    missed = lambda *asked, **more: replace(fit(*asked, **more), status="infeasible")  # noqa: E731
    monkeypatch.setattr(miurafab, "fit", missed)
    done = run(*asked)
    assert done.returncode == 1
    assert "it is in sheet.rejected.fold, and sheet.fold is as it was." in done.stderr
    assert (tmp_path / "sheet.fold").read_bytes() == good
    assert json.loads((tmp_path / "sheet.rejected.fold").read_text())["vertices_coords"]


def test_a_folder_that_is_not_there_is_named_before_the_fit(run):
    done = run("fit", "hypar", "--facets", "400x400", "-o", "gone/sheet.fold")
    assert sentence(done, 2) == "miurafab: The folder of gone/sheet.fold does not exist."


WRITE_CALLS = {"write_text", "write_bytes", "copyfile", "copy2", "copytree"}
BESIDES = {
    "miurafab/files.py": "it is the writer",
    "miurafab/workflow/whole_folder.py": "moves what was written up",
    "miurafab/machine/append_log.py": "a log grows",
    "miurafab/machine/virtual_server.py": "a log grows",
    "miurafab/machine/session_process.py": "writes to a pipe",
    "miurafab/studio/work.py": "writes to the studio's own temporary folder",
    "miurafab/studio/worker.py": "writes to a pipe",
    "miurafab/studio/door.py": "needs a mode of its own",
    "miurafab/cli/ending.py": "opens the null device",
    "miurafab/machine/transport.py": "opens ports",
}


def _is_os_open(function):
    return function.attr == "open" and ast.unparse(function) == "os.open"


def test_nothing_else_writes_files():
    """All that is written goes through :mod:`miurafab.files`."""
    others = {}
    for module in sorted((ROOT / "miurafab").rglob("*.py")):
        name = module.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                called = node.func.attr
                modes = [a.value for a in node.args[:2] if isinstance(a, ast.Constant)]
                opens = called in ("open", "fdopen") and any(
                    isinstance(mode, str) and set(mode) & set("wax+") and len(mode) < 4
                    for mode in modes
                )
                if called in WRITE_CALLS or opens or _is_os_open(node.func):
                    others.setdefault(name, []).append(f"{node.lineno}: {called}")
    assert {name: where for name, where in others.items() if name not in BESIDES} == {}


def test_a_name_that_no_system_takes_is_refused_and_a_folder_is_no_file(tmp_path):
    for path in ("a" * 256, "/".join(["folder"] * 900)):
        with pytest.raises(InputError, match=r"The job is '.{40}'\.\.\., which is too long"):
            as_path(path, "The job")
    (tmp_path / "a.fold").mkdir()
    with pytest.raises(InputError, match=r"a\.fold is a folder and not a file"):
        new_file(tmp_path / "a.fold", "The pattern", (".fold",))


def test_a_file_for_which_memory_does_not_do_is_named():
    with (
        pytest.raises(InputError, match=r"a\.fold is not FOLD: it asks for more memory than there"),
        Reading("a.fold", "FOLD", InputError),
    ):
        raise MemoryError


def test_a_file_system_that_syncs_no_folders_is_no_failure(tmp_path, monkeypatch):
    for number in (errno.EINVAL, errno.EIO):

        def refused(opened, number=number):
            raise OSError(number, os.strerror(number))

        monkeypatch.setattr(os, "fsync", refused)
        if number == errno.EINVAL:
            sync_folder(tmp_path)
        else:
            with pytest.raises(OSError, match=os.strerror(errno.EIO)):
                sync_folder(tmp_path)


@pytest.fixture
def unfinished(tmp_path):
    """A folder whose writer died before it had moved its file up."""
    (tmp_path / STAGING).mkdir()
    (tmp_path / STAGING / "sheet-01.nc").write_text("new")
    order = {"first": [], "remove": [], "put": ["sheet-01.nc"]}
    (tmp_path / STAGING / ORDER).write_text(json.dumps(order))
    return tmp_path


def test_a_reader_waits_for_a_writer_and_not_for_ever(unfinished, monkeypatch):
    monkeypatch.setattr(whole_folder, "_LOOK_S", 0.01)
    with whole_folder._locked(unfinished):
        monkeypatch.setattr(whole_folder, "_PATIENCE_S", 0.03)
        with pytest.raises(InputError, match="is being written by another miurafab; wait until"):
            settle_job(unfinished)
        monkeypatch.setattr(whole_folder, "_PATIENCE_S", 20.0)
        reading = threading.Thread(target=settle_job, args=(unfinished,))
        reading.start()
    reading.join()
    assert (unfinished / "sheet-01.nc").read_text() == "new"


def test_a_lock_that_its_holder_has_just_removed_is_taken_anew(unfinished, monkeypatch):
    same, seen = os.path.samestat, []

    def once_another(one, other):
        seen.append(len(seen) > 0 and same(one, other))
        if len(seen) == 2:
            raise FileNotFoundError
        return seen[-1]

    monkeypatch.setattr(os.path, "samestat", once_another)
    settle_job(unfinished)
    assert seen[:3] == [False, True, True]
    assert (unfinished / "sheet-01.nc").read_text() == "new"


def test_a_disk_that_takes_no_lock_is_named(unfinished, monkeypatch):
    import fcntl

    def refused(opened, how):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refused)
    with pytest.raises(InputError, match=r"was not finished, and .* cannot be written: No locks"):
        settle_job(unfinished)
