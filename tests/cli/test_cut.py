"""``miurafab sheets`` and ``miurafab cut``: the main job, and every way in which it is refused."""

import io
import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import nullcontext

import pytest
from command_line import sentence
from problems import regular, saddle_mesh
from sealing import seal

import miurafab
from miurafab.cli import cut
from miurafab.cli.console import Console
from miurafab.errors import PortError
from miurafab.machine.keys import ConsoleKeys
from miurafab.profiles import shipped_directory
from miurafab.workflow import cut as cut_module
from miurafab.workflow.multi_machine import Shared

DESIGN = """
title = "Small saddle"
facets = "6x5"
size = "70mm"
[target]
surface = "hypar"
[layout]
machine = "grbl-laser-400"
material = "paper-100"
"""


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """An empty folder for what the first test makes."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def job(run, tmp_path, kept):
    """A small pattern and its job directory, made once and copied for each test."""
    if not any(kept.iterdir()):
        fitted = run("fit", "hypar", "--facets", "6x5", "--size", "70mm", "-o", "s.fold")
        assert fitted.returncode == 0
        done = run("sheets", "s.fold", "-o", "job", "--material", "paper-100", "--json")
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["totals"]["patches"] == 1
        for name in ("s.fold", "job"):
            (tmp_path / name).rename(kept / name)
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)
    return tmp_path / "job"


def test_a_design_is_cut_in_one_command(run, tmp_path):
    (tmp_path / "small.toml").write_text(DESIGN)
    done = run("cut", "small.toml", "--port", "virtual", "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    answer = json.loads(done.stdout)
    assert answer["status"] == "done"
    assert answer["facets"] == 30
    assert max(answer["max_planarity"], answer["max_developability"]) <= 1e-10
    (sheet,) = answer["sheets"]
    assert sheet["seconds"] == pytest.approx(sheet["estimated_s"], rel=0.03)
    made = {path.name for path in (tmp_path / "jobs" / "small").iterdir()}
    assert made >= {"small.fold", "layout.json", "sheet-01.nc", "sheet-01.svg"}
    journal = (tmp_path / "jobs" / "small" / "sheet-01.journal").read_text()
    assert '"ended"' in journal


def test_a_surface_with_parameters_names_its_job(run, tmp_path):
    done = run("cut", "hypar:height=0.5", "--facets", "4x4", "--size", "60mm", "--port", "virtual")
    assert done.returncode == 0, done.stderr
    assert [path.name for path in (tmp_path / "jobs").iterdir()] == ["hypar"]


def test_a_mesh_goes_the_whole_way(run, tmp_path):
    saddle_mesh(8, 30.0).export(tmp_path / "saddle.stl")
    fitted = run("fit", "saddle.stl", "--facets", "4x4", "--size", "80mm", "-o", "saddle.fold")
    assert fitted.returncode == 0, fitted.stderr
    assert run("check", "saddle.fold").returncode == 0
    assert run("sheets", "saddle.fold", "-o", "job").returncode == 0
    shown = run("preview", "job", "--json")
    assert shown.returncode == 0, shown.stderr
    (sheet,) = json.loads(shown.stdout)["sheets"]
    assert set(sheet) >= {
        "lines", "seconds", "beam_on_seconds", "cut_mm", "travel_mm", "bounds_mm", "warnings",
    }  # fmt: skip
    assert sheet["warnings"] == []


def test_a_job_directory_and_its_file_are_cut_alike(run, job):
    whole = json.loads(run("cut", "job", "--port", "virtual", "--json").stdout)
    single = json.loads(run("cut", "job/sheet-01.nc", "--port", "virtual", "--json").stdout)
    assert whole["sheets"][0]["lines"] == single["sheets"][0]["lines"]
    assert whole["sheets"][0]["cut_m"] == single["sheets"][0]["cut_m"]


def test_check_mode_moves_nothing(run, job):
    done = run("cut", "job", "--port", "virtual", "--check-mode", "--json")
    assert done.returncode == 0, done.stderr
    (sheet,) = json.loads(done.stdout)["sheets"]
    assert sheet["refused_lines"] == 0


@pytest.mark.parametrize(
    ("arguments", "named", "code"),
    [
        (("cut", "job", "--port", "/dev/no-such-port"), "/dev/no-such-port", 3),
        (("cut", "job", "--port", "socket://127.0.0.1:1"), "127.0.0.1", 3),
        (("cut", "job", "--port", "virtual", "--sheet", "7"), "no sheet 7", 2),
        (("cut", "job", "--port", "virtual", "--machine", "gone"), "'gone'", 2),
        (("cut", "job", "--port", "virtual", "--force", "gone"), "gone", 2),
        (("cut", "gone.nc", "--port", "virtual"), "gone.nc", 2),
        (("cut", "gone.fold", "--port", "virtual"), "gone.fold", 2),
        (("cut", "gone", "--port", "virtual"), "gone", 2),
        (("sheets", "gone.fold", "-o", "other"), "gone.fold", 2),
        (("sheets", "s.fold", "-o", "s.fold"), "needs a directory", 2),
        (("sheets", "s.fold", "-o", "other", "--material", "gone"), "'gone'", 2),
        (("sheets", "s.fold", "-o", "other", "--machine", ""), "'' is not a known machine", 2),
        (("sheets", "s.fold", "-o", "other", "--design", "s.toml"), "s.toml", 2),
        (("preview", "gone"), "gone", 2),
    ],
)
def test_bad_input_is_one_sentence(run, job, arguments, named, code):
    assert named in sentence(run(*arguments, "--quiet"), code)


def test_a_design_gives_its_machine_material_and_options(run, job, tmp_path):
    (tmp_path / "d.toml").write_text(
        '[layout]\nmachine = "grbl-pen-a4"\nmaterial = "paper-100"\nseam_rows = "2"\n'
    )
    usual = ("sheets", "s.fold", "-o", "designed", "--design", "d.toml", "--json")
    answer = json.loads(run(*usual).stdout)
    assert (answer["machine"], answer["material"]) == ("grbl-pen-a4", "paper-100")
    assert answer["totals"]["patches"] == 2
    seconds = sum(sheet["seconds"] for sheet in answer["sheets"])
    assert seconds == pytest.approx(answer["totals"]["seconds"], abs=0.2)
    answer = json.loads(run(*usual, "--machine", "grbl-knife-a3").stdout)
    assert (answer["machine"], answer["material"]) == ("grbl-knife-a3", "paper-100")
    (tmp_path / "other.toml").write_text('title = "x"\n')
    done = run("sheets", "s.fold", "-o", "other", "--design", "other.toml", "--quiet")
    assert "other.toml has no [layout]" in sentence(done, 2)
    shown = run("sheets", "s.fold", "-o", "designed", "--design", "d.toml").stdout
    for words in ("paper-100", "mm of seams", "of their room used", "machine time"):
        assert words in shown


def test_an_empty_directory_is_no_job(run, job, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "no whole job" in sentence(run("cut", "empty", "--port", "virtual", "--quiet"), 2)


def test_a_bed_smaller_than_one_facet(run, job, tmp_path):
    text = (shipped_directory("firmware_profiles") / "grbl-laser-400.toml").read_text()
    small = text.replace('"400mm"', '"13mm"').replace('margin = "5mm"', 'margin = "1mm"')
    (tmp_path / "tiny.toml").write_text(small)
    done = run("sheets", "s.fold", "-o", "other", "--machine", "tiny.toml", "--quiet")
    assert "facet" in sentence(done, 2)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("M3 S100\nG1 X10 F600\nM5\n", "--force m3"),
        ("M4 S100\nG1 X900 F600\nM5\n", "bed"),
        ("M4 S100\nG1 X10 F600 ; careful\nG1 X2 !\nM5\n", "line 3"),
        ("M4 S100\nG1 X10\nM5\n", "line 2"),
    ],
)
def test_a_dangerous_program_is_refused(run, tmp_path, text, named):
    (tmp_path / "job.nc").write_text(text)
    assert named in sentence(run("cut", "job.nc", "--port", "virtual", "--quiet"), 2)


def test_a_pattern_that_is_not_valid_is_not_cut(run, job, tmp_path):
    document = json.loads((tmp_path / "s.fold").read_text())
    document["vertices_coords"][8][0] += 0.5
    (tmp_path / "torn.fold").write_text(json.dumps(document))
    done = run("cut", "torn.fold", "--port", "virtual", "--json")
    assert done.returncode == 1
    answer = json.loads(done.stdout)
    assert answer["status"] == "refused"
    assert "not the same flat and folded" in answer["advice"]
    assert not (tmp_path / "jobs" / "torn").exists()


def test_a_dry_run_opens_no_port_and_names_what_it_refuses(run, job, tmp_path):
    done = run("cut", "job", "--dry-run", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["status"] == "ready"
    assert answer["sheets"][0]["cut_mm"] > 100
    assert not (job / "sheet-01.journal").exists()
    (tmp_path / "bad.nc").write_text("G1 F600 X1\nM3 S1200\nG4 P1\nG1 X900\nM5\n")
    done = run("cut", "bad.nc", "--dry-run", "--json")
    assert done.returncode == 1
    named = [finding["code"] for finding in json.loads(done.stdout)["findings"]]
    assert named == ["m3", "bounds", "dwell", "power"]
    assert "--dry-run" in sentence(run("cut", "job", "--quiet"), 2)


def test_an_interrupted_sheet_is_resumed_from_its_journal(run, job):
    whole = json.loads(run("cut", "job/sheet-01.nc", "--port", "virtual", "--json").stdout)
    journal = job / "sheet-01.journal"
    assert '"ended": "done"' in journal.read_text()
    assert "interrupted" in sentence(
        run("cut", "job", "--port", "virtual", "--resume", "--at", "0,0", "--quiet"), 2
    )
    # What a power loss leaves: a journal that breaks off.
    head, _, rest = journal.read_text().lstrip().partition("\n")
    cut_off = [line for line in rest.splitlines() if '"taken"' in line][60]
    journal.write_text(f"\n{head}\n{cut_off}\n")
    arguments = ("cut", "job", "--port", "virtual", "--resume")
    assert "--at 0,0" in sentence(run(*arguments, "--quiet"), 2)
    done = run(*arguments, "--at", "0,0", "--json")
    assert done.returncode == 0, done.stderr
    (sheet,) = json.loads(done.stdout)["sheets"]
    (finding,) = sheet["findings"]
    assert finding["code"] == "resumed"
    assert "goes on at stroke" in finding["sentence"]
    assert "may be burnt twice" in finding["sentence"]
    assert 0 < sheet["seconds"] < whole["sheets"][0]["seconds"]


@pytest.fixture
def three_sheets(job):
    """The job directory, its sheet three times."""
    layout = json.loads((job / "layout.json").read_text())
    (first,) = layout["sheets"]
    layout["sheets"] += [{**first, "name": f"sheet-0{n}", "placements": []} for n in (2, 3)]
    (job / "layout.json").write_text(json.dumps(layout))
    for n in (2, 3):
        (job / f"sheet-0{n}.nc").write_bytes((job / "sheet-01.nc").read_bytes())
    seal(job)
    return job


def test_machines_share_the_sheets_and_one_failing_hurts_no_other(run, three_sheets):
    done = run("cut", "job", "--port", "virtual", "--port", "/dev/no-such-port", "--json")
    assert done.returncode == 3
    answer = json.loads(done.stdout)
    failed = [sheet for sheet in answer["sheets"] if not sheet["done"]]
    assert [sheet["port"] for sheet in failed] == ["/dev/no-such-port"]
    assert "/dev/no-such-port" in failed[0]["why"]
    assert sum(sheet["port"] == "virtual" for sheet in answer["sheets"]) == 2


def test_machines_go_on_with_what_each_had(run, three_sheets):
    arguments = ("cut", "job", "--port", "virtual", "--port", "virtual")
    assert "interrupted" in sentence(run(*arguments, "--resume", "--at", "0,0", "--quiet"), 2)
    assert "first trace it at each" in sentence(run(*arguments, "--frame", "--quiet"), 2)
    whole = run(*arguments, "--sheet", "1", "--sheet", "2", "--json")
    assert whole.returncode == 0, whole.stderr
    journal = three_sheets / "sheet-01.journal"
    head, _, rest = journal.read_text().lstrip().partition("\n")
    cut_off = [line for line in rest.splitlines() if '"taken"' in line][3]
    journal.write_text(f"\n{head}\n{cut_off}\n".replace("virtual", "/dev/elsewhere"))
    elsewhere = sentence(run(*arguments, "--resume", "--at", "0,0", "--quiet"), 2)
    assert "sheet-01 was interrupted at a machine that is not named now" in elsewhere
    journal.write_text(f"\n{head}\n{cut_off}\n")
    done = run(*arguments, "--resume", "--at", "0,0", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert [sheet["sheet"] for sheet in answer["sheets"]] == ["sheet-01", "sheet-03"]
    assert all(sheet["done"] for sheet in answer["sheets"])
    assert '"from_line": 1,' not in journal.read_text().rpartition("miurafab-journal")[2]


@pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_every_machine_is_stopped_with_the_command(how, three_sheets):
    from machine.benches import Bench

    first, second = benches = Bench(), Bench()

    def both(until):
        def step():
            once = iter((False, True))
            second.run(lambda: next(once))
            return until()

        first.run(step, 60)

    command = [sys.executable, "-m", "miurafab", "cut", str(three_sheets), "--quiet"]
    ports = [word for bench in benches for word in ("--port", bench.wire.address)]
    with subprocess.Popen([*command, *ports], stderr=subprocess.PIPE, text=True) as process:
        both(lambda: all(bench.device.beam_on for bench in benches))
        process.send_signal(how)
        both(lambda: all(b"\x18" in bench.bytes_came for bench in benches))
        dark = [bench.came[-1][1] for bench in benches]
        both(lambda: process.poll() is not None)
        if how == signal.SIGINT:
            assert process.returncode == 130
            assert "was stopped by Ctrl-C on every machine." in process.stderr.read()
    for bench, at in zip(benches, dark, strict=True):
        bench.assert_dark_from(at)
        bench.wire.close()


def test_a_frame_is_traced(run, job):
    done = run("machine", "frame", "job", "--port", "virtual", "--pointer", "2", "--json")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["bounds_mm"]) == 4
    assert json.loads(done.stdout)["ports"] == ["virtual"]
    refused = run("machine", "frame", "job", "--port", "virtual", "--pointer", "9", "--quiet")
    assert "it must be between 0 % and 5 %" in sentence(refused, 2)
    marks = ("--align", "0,0=10,20", "--align", "100,100=110,120")  # given twice, read as two
    moved = run("machine", "frame", "job", "--port", "virtual", *marks, "--json")
    x0, y0, x1, y1 = json.loads(done.stdout)["bounds_mm"]
    wanted = [x0 + 10, y0 + 20, x1 + 10, y1 + 20]
    assert json.loads(moved.stdout)["bounds_mm"] == pytest.approx(wanted)
    assert "shifted by X10.000 Y20.000" in json.loads(moved.stdout)["findings"][0]["sentence"]


@pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
def test_a_frame_is_traced_at_each_machine_in_turn(job):
    from machine.benches import Bench

    first, second = Bench(speed=10), Bench(speed=10)
    ports = [word for bench in (first, second) for word in ("--port", bench.wire.address)]
    command = [sys.executable, "-m", "miurafab", "machine", "frame", str(job), *ports, "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        first.run(lambda: b"G0X0.000Y0.000\n" in first.bytes_came, 40)
        assert second.bytes_came == b""
        while process.poll() is None:
            for bench in (first, second):
                once = iter((False, True))
                bench.run(lambda o=once: next(o))
        answer = json.loads(process.stdout.read())
    assert process.returncode == 0
    assert answer["ports"] == [first.wire.address, second.wire.address]
    traced = [
        [line for line in b.commands.split(b"\n") if line.startswith(b"G1")]
        for b in (first, second)
    ]
    assert len(traced[0]) == 4
    assert traced[0] == traced[1]
    for bench in (first, second):
        assert bench.device.beam_log == []
        bench.wire.close()


@pytest.mark.skipif(os.name != "posix", reason="a device is a file on POSIX")
def test_a_port_that_does_not_exist_is_said_before_anything_is_made(run, tmp_path):
    done = run("cut", "hypar", "--facets", "100x100", "--port", "/dev/no-such-port")
    assert "The port /dev/no-such-port does not exist" in sentence(done, 3)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(PortError, match="no-such-port does not exist"):
        miurafab.cut("hypar", "/dev/no-such-port", facets=(100, 100))


def test_check_mode_lists_every_line_that_the_controller_refuses(run, tmp_path):
    (tmp_path / "own.nc").write_text("G21\nG90\nM4 S0\nM6\nG0 X1\nG1 X9 S100 F600\nM62 P1\nM5\n")
    done = run("cut", "own.nc", "--check-mode", "--port", "virtual")
    assert done.returncode == 1
    for line in ("own, line 4 ('M6')", "own, line 7 ('M62P1')"):
        assert f"{line}: " in done.stdout
    done = run("cut", "own.nc", "--check-mode", "--port", "virtual", "--json")
    (sheet,) = json.loads(done.stdout)["sheets"]
    assert [refused["line"] for refused in sheet["refusals"]] == [4, 7]


def test_the_end_of_the_input_is_no_person(run, three_sheets, monkeypatch):
    """It said nothing about fresh material, so sheet 2 is not burnt onto sheet 1."""
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    done = run("cut", "job", "--port", "virtual", "--pause", "--quiet")
    assert "Nobody pressed Enter" in sentence(done, 5)
    assert [path.name for path in three_sheets.glob("*.journal")] == ["sheet-01.journal"]


class Typing:
    """Keys that come one at a look."""

    def __init__(self, *keys):
        self.left = [*keys]

    def pressed(self):
        return self.left.pop(0) if self.left else ""


def test_a_job_in_memory_is_written_and_is_then_one_of_a_directory(tmp_path):
    made = miurafab.sheets(regular(3, 3))
    prepared = cut_module.prepare(made, out=tmp_path / "own")
    assert (prepared.folder, len(prepared.jobs)) == (tmp_path / "own", 1)
    assert (tmp_path / "own" / "sheet-01.nc").is_file()


@pytest.mark.parametrize("enter", ["\n", "\r"])
def test_enter_is_looked_for_where_the_keyboard_can_be_looked_at(monkeypatch, capsys, enter):
    """On Windows no signal ends a reading."""
    waiting, typed = iter((True, False, True, False)), list(f"x{enter}q")
    monkeypatch.setattr(cut, "_LOOK_S", 0.0)
    cut._wait(Console(), ConsoleKeys(lambda: next(waiting), lambda: typed.pop(0)), "Press Enter.")
    assert typed == ["q"]
    assert capsys.readouterr().err == "Press Enter.\n"


def test_what_was_typed_while_a_sheet_was_cut_is_no_answer(run, three_sheets, monkeypatch, capsys):
    """Enter that was pressed twice, or in impatience, would burn on the sheet of before."""
    typed = Typing("\n\n", "x", "\n", "left")
    monkeypatch.setattr(cut, "_LOOK_S", 0.0)
    cut._wait(Console(), typed, "Press Enter.")
    assert typed.left == ["left"]

    keys = Typing("\n", "x", "\n", "left")

    def share(prepared, ports, *_, before_sheet, **how):
        before_sheet(2, ports[1], lambda: False)
        return (Shared("sheet-01", ports[0], True, ""),)

    monkeypatch.setattr("miurafab.machine.keys.terminal_keys", lambda: nullcontext(keys))
    monkeypatch.setattr("miurafab.workflow.multi_machine.share_sheets", share)
    run("cut", "job", "--port", "virtual", "--port", "virtual")
    assert keys.left == ["left"]


@pytest.mark.parametrize("lost", [False, True])
def test_machines_that_share_a_job_ask_for_enter_in_the_terminal(
    run, three_sheets, monkeypatch, lost
):
    keys, asked = Typing("", "q", "" if lost else "\r"), []

    def share(prepared, ports, *_, before_sheet, **how):
        asked.append(before_sheet(2, ports[1], lambda: lost and not keys.left))
        return tuple(Shared(f"sheet-0{n}", ports[0], True, "") for n in (1, 2, 3))

    monkeypatch.setattr(cut, "_LOOK_S", 0.0)
    monkeypatch.setattr("miurafab.machine.keys.terminal_keys", lambda: nullcontext(keys))
    monkeypatch.setattr("miurafab.workflow.multi_machine.share_sheets", share)
    done = run("cut", "job", "--port", "virtual", "--port", "virtual")
    assert (done.returncode, asked) == (0, [not lost])
    assert "Sheet 2 of 3 at virtual: put in fresh material there, press Enter." in done.stderr
