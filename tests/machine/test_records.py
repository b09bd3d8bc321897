"""Journal, transcript and the file below them: what is on the disk, and what a fault does."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from disk import killed_at

from miurafab.errors import InputError, MachineError
from miurafab.gcode.job import Job
from miurafab.machine.append_log import DurableFile
from miurafab.machine.journal import Journal, read_journal
from miurafab.machine.transcript import Transcript

JOB = Job("sheet-01.nc", "G0X1\nG0X2\n")


def journal(path: Path) -> Journal:
    return Journal(path, JOB, "laser", "/dev/ttyUSB0", 2)


def test_all_that_is_appended_is_written_in_order(tmp_path: Path) -> None:
    file = DurableFile(tmp_path / "f", "journal", b"head\n", append=False)
    pieces = [b"%d\n" % n for n in range(5000)]
    for piece in pieces:
        file.append(piece)
    file.close()
    assert (tmp_path / "f").read_bytes() == b"head\n" + b"".join(pieces)


def test_the_header_is_on_the_disk_before_anything_else(tmp_path: Path) -> None:
    file = DurableFile(tmp_path / "f", "journal", b"head\n", append=False)
    assert (tmp_path / "f").read_bytes() == b"head\n"
    file.close()


def test_a_fault_while_writing_is_kept_until_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = DurableFile(tmp_path / "f", "journal", b"", append=False)

    def full(data: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(file, "_put", full)
    file.check()
    file.append(b"x")
    file.close()
    with pytest.raises(MachineError, match=r"journal .*/f can no longer be written: No space left"):
        file.check()


def test_a_journal_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "j"
    book = journal(path)
    book.taken(1, 1, 0.0)
    book.taken(2, 2, 0.1)
    book.ended("done", "all of it")
    book.close()
    (run,) = read_journal(path)
    assert (run.taken, run.line, run.seconds) == (2, 2, 0.1)
    assert (run.ended, run.why) == ("done", "all of it")
    assert (run.job, run.sha256, run.lines) == ("sheet-01.nc", JOB.sha256, 2)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_no_record_waits_for_a_reader_of_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "sheet-01.journal"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # so that a fault here does not wait
    with pytest.raises(InputError, match=r"The journal .*sheet-01.journal is a pipe; remove it"):
        DurableFile(pipe, "journal", b"head", append=True)
    os.close(reader)


def test_records_come_four_times_a_second_at_most(tmp_path: Path) -> None:
    book = journal(tmp_path / "j")
    for n in range(1000):
        book.taken(n, n, n / 100)
    book.close()
    records = (tmp_path / "j").read_text().splitlines()
    assert 38 <= len(records) <= 43


@pytest.mark.parametrize("cut", [1, 5, 20, 35])
def test_a_torn_end_loses_only_itself(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "j"
    book = journal(path)
    book.taken(1, 1, 0.0)
    book.close()
    whole = path.read_bytes()
    path.write_bytes(whole + json.dumps({"taken": 2, "line": 2, "seconds": 1.25}).encode()[:cut])
    (run,) = read_journal(path)
    assert (run.taken, run.ended) == (1, None)
    again = journal(path)
    again.taken(2, 2, 0.0)
    again.close()
    assert [run.taken for run in read_journal(path)] == [1, 2]


def test_a_new_file_comes_into_being_with_its_whole_first_line(tmp_path: Path) -> None:
    """Killed at each call of its making, a journal or transcript is whole or not there."""
    if not hasattr(os, "fork"):
        pytest.skip("a process is killed here by its double")
    makers = (
        lambda path: DurableFile(path, "journal", b"\nhead of it\n", append=True),
        lambda path: Transcript(path, "a job"),
    )
    for make, head in zip(makers, (b"\nhead of it\n", b"# a job\n"), strict=True):
        for last in range(1, 40):
            path = tmp_path / f"{head[:3]!r}-{last}"
            if not killed_at(last, lambda make=make, path=path: make(path)):
                break
            assert not path.exists() or path.read_bytes() == head
        assert last > 4
        assert path.read_bytes() == head


@pytest.mark.parametrize("text", ["", "hello\n", '{"taken": 3}\n', "[1]\n"])
def test_what_is_no_journal_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "j"
    path.write_text(text)
    with pytest.raises(InputError, match="holds no run"):
        read_journal(path)
    with pytest.raises(InputError, match="does not exist"):
        read_journal(tmp_path / "gone")


@pytest.mark.parametrize(
    ("record", "why"),
    [
        ({"why": ["storm"]}, "in place of a text"),
        ({"taken": -1}, "in place of a whole number"),
        ({"line": True}, "in place of a whole number"),
        ({"seconds": "1"}, "in place of a time"),
        ({"seconds": 1e999}, "in place of a time"),
        ({"overrides": [100, 100]}, "other overrides than those of feed, rapids and power"),
        ({"overrides": 100}, "other overrides than those"),
        ({"beam": 1}, "unexpected keyword argument 'beam'"),
    ],
)
def test_a_journal_of_other_kinds_is_no_journal(
    tmp_path: Path, record: dict[str, object], why: str
) -> None:
    """From it a job is gone on with: what it says is checked before."""
    path = tmp_path / "j"
    journal(path).close()
    path.write_bytes(path.read_bytes() + json.dumps(record).encode() + b"\n")
    with pytest.raises(InputError, match=rf"j is not a journal of this version.*{why}"):
        read_journal(path)


def test_a_place_that_cannot_be_written_is_told_before_anything_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def begun(path: Path, *, append: bool = True) -> None:
        DurableFile(path, "journal", b"head\n", append=append)

    (tmp_path / "taken").write_text("x")
    for below in (tmp_path / "taken" / "j", tmp_path / "taken" / "today" / "j"):
        with pytest.raises(InputError, match=r"^The journal .*/j cannot .*/taken is not a folder"):
            begun(below)
    with pytest.raises(InputError, match=r"^The journal .* cannot be written: .*directory"):
        begun(tmp_path)
    (tmp_path / "link").symlink_to(tmp_path / "taken")
    with pytest.raises(InputError, match=r"^The journal .*/link is a link; remove it\."):
        begun(tmp_path / "link")

    def full(self: DurableFile, data: bytes) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(DurableFile, "_put", full)
    with pytest.raises(InputError, match=r"/taken cannot be written: No space left on device\."):
        begun(tmp_path / "taken")
    assert (tmp_path / "taken").read_text() == "x"


def test_a_transcript_shows_both_ways_with_the_time(tmp_path: Path) -> None:
    path = tmp_path / "t"
    script = Transcript(path, "a job")
    script.sent(0.0, b"G0X1\nG0X2\n")
    script.came(0.001, b"\r\nGrbl 1.1h\r\no")
    script.sent(0.002, b"\x18")
    script.came(0.0035, b"k\r\n\x80")
    script.close()
    assert path.read_text() == (
        "# a job\n"
        "0.000000 > G0X1\\nG0X2\\n\n"
        "0.001000 < \\r\\n\n"
        "0.001000 < Grbl 1.1h\\r\\n\n"
        "0.002000 > \\x18\n"
        "0.003500 < ok\\r\\n\n"
        "0.003500 < \\x80\n"
    )
