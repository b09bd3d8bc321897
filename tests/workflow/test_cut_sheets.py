"""Time left that holds, journals beside what was cut, and further sheets from where the head is."""

import pytest
from sealing import seal
from small_jobs import dashes, known_toolpath, write_job, write_nc

import miurafab
from miurafab.errors import GcodeError, InputError
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import cut_prepared, frame
from miurafab.workflow.sheet_plans import rehearsed


@pytest.fixture(scope="module")
def pattern(tmp_path_factory):
    """A small pattern on disk."""
    path = tmp_path_factory.mktemp("pattern") / "s.fold"
    wanted = miurafab.design("hypar", facets="6x5", size="70mm")
    miurafab.fit(wanted).pattern.save(path, title="small")
    return path


@pytest.fixture
def folder(pattern, tmp_path):
    """A job directory with three sheets, all alike."""
    return write_job(tmp_path / "job", 3, pattern)


@pytest.mark.parametrize("toolpath", [known_toolpath(), dashes(1500)])
def test_the_time_left_holds(tmp_path, toolpath):
    prepared = prepare(str(write_nc(tmp_path, toolpath)))
    seen = []
    (sheet,) = cut_prepared(prepared, port="virtual", on_progress=seen.append)
    total = sheet.result.seconds
    for now in seen:
        # A planner's worth of moves either way, and the rounding of the poll.
        assert now.stream.seconds_elapsed + now.seconds_left == pytest.approx(
            total, rel=0.03, abs=2.5
        )
        over = now.stream.seconds_elapsed / total
        assert now.share == pytest.approx(over, abs=0.03 + 2.5 / total)
    assert [now.stroke for now in seen] == sorted(now.stroke for now in seen)
    assert seen[-1].stroke == seen[-1].strokes
    assert seen[-1].seconds_left == pytest.approx(0, abs=0.1)
    assert seen[-1].share == pytest.approx(1)


def test_a_plain_file_has_its_journal_beside_it(tmp_path):
    path = write_nc(tmp_path, known_toolpath())
    cut_prepared(prepare(str(path)), port="virtual")
    (run,) = read_journal(path.with_suffix(".journal"))
    assert run.ended == "done"
    assert path.with_suffix(".transcript").is_file()


def test_check_mode_leaves_no_journal_to_resume(tmp_path):
    path = write_nc(tmp_path, known_toolpath())
    prepared = prepare(str(path))
    cut_prepared(prepared, port="virtual", options=CutOptions(send=SendOptions(check_mode=True)))
    assert not path.with_suffix(".journal").exists()


def test_a_further_sheet_is_told_where_the_head_was_left(folder):
    for name in ("sheet-01", "sheet-02"):
        file = folder / f"{name}.nc"
        file.write_text(file.read_text() + "G0 X7 Y9\n", newline="\n")
    seal(folder)
    prepared = prepare(str(folder))
    cut_prepared(prepared, port="virtual", options=CutOptions(send=SendOptions(at=(3.0, 4.0))))
    for name, where in (("sheet-01", "X3.000Y4.000"), ("sheet-02", "X7.000Y9.000")):
        assert f"G92{where}" in (folder / f"{name}.transcript").read_text()


def test_only_what_was_interrupted_or_never_begun_is_resumed(folder):
    prepared = prepare(str(folder))
    cut_prepared(prepared, port="virtual", sheets=[1, 2])
    journal = folder / "sheet-02.journal"
    journal.write_text(journal.read_text().partition('{"taken"')[0])
    options = CutOptions(send=SendOptions(at=(0.0, 0.0)), resume=True)
    seen, status, notes = rehearsed(prepared, None, options)
    done = cut_prepared(prepared, port="virtual", options=options)
    assert [(each.name, each.cut_mm) for each in seen.dry_runs] == [
        (each.name, each.cut_mm) for each in done
    ]
    assert (status, notes) == ("ready", done[0].findings)
    assert [sheet.name for sheet in done] == ["sheet-02", "sheet-03"]
    assert [finding.code for finding in done[0].findings] == ["resumed"]
    assert done[1].findings == ()
    with pytest.raises(InputError, match="was interrupted"):
        cut_prepared(prepared, port="virtual", options=options)
    with pytest.raises(InputError, match="was interrupted"):
        rehearsed(prepared, None, options)
    seen, _, _ = rehearsed(prepared, [3], CutOptions())
    assert [each.name for each in seen.dry_runs] == ["sheet-03"]


def test_what_the_material_does_not_take_is_found(folder):
    file = folder / "sheet-01.nc"
    file.write_text(file.read_text() + "M4 S950\nG1 X9 F600\nM5\n", newline="\n")
    seal(folder)
    prepared = prepare(str(folder))
    (finding,) = [each for sheet in prepared.dry_runs for each in sheet.findings]
    assert (finding.code, finding.where.split(":")[0]) == ("material", "sheet-01.nc")
    assert "S900" in finding.sentence
    assert miurafab.preview(folder).sheets[0].findings == (finding,)
    with pytest.raises(GcodeError, match="S900"):
        cut_prepared(prepared, port="virtual")


def test_an_edited_job_is_cut_only_if_that_is_forced(folder):
    file = folder / "sheet-02.nc"
    file.write_text(file.read_text() + "G0 X7 Y9\n", newline="\n")
    prepared = prepare(str(folder))
    (found,) = prepared.findings
    assert (found.code, found.where) == ("edited", "sheet-02.nc")
    assert miurafab.preview(folder).as_dict()["status"] == "refused"
    assert miurafab.preview(prepared.directory).as_dict()["status"] == "refused"
    with pytest.raises(GcodeError, match=r"sheet-02\.nc has changed .*'force' edited overrides"):
        cut_prepared(prepared, port="virtual")
    options = CutOptions(send=SendOptions(force=frozenset({"edited"})))
    done = cut_prepared(prepared, port="virtual", sheets=[1], options=options)
    assert [each.code for each in done[0].findings] == ["edited"]
    (folder / "manifest.json").unlink()
    assert "holds no manifest" in prepare(str(folder)).findings[0].sentence


def test_a_frame_burns_nothing(tmp_path):
    path = write_nc(tmp_path, known_toolpath())
    prepared = prepare(str(path))
    assert frame(prepared, 1, port="virtual").seconds > 5
    (tmp_path / "dark.nc").write_text("G0 X5\n")
    with pytest.raises(InputError, match="burns nothing"):
        frame(prepare(str(tmp_path / "dark.nc")), 1, port="virtual")
    assert not list(tmp_path.glob("*frame*"))
