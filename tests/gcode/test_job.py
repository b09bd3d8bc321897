"""A job's lines as they are sent: nothing skipped, nothing changed, nothing dangerous."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.errors import GcodeError
from miurafab.gcode.job import Job, SendLine

harmless = st.text(alphabet="GXYSF019.-+ \t()/;abcé!\n\r", max_size=60)


def firmware_filter(line: str) -> str:
    """What GRBL's own reader keeps of a line, slashes and case aside (``protocol.c``)."""
    kept, skipping = "", ""
    for character in line:
        if skipping:
            if character == ")" and skipping == "(":
                skipping = ""
        elif character in "(;":
            skipping = character
        elif character > " ":
            kept += character
    return kept


@given(harmless)
def test_what_is_sent_is_what_the_firmware_would_keep(text: str) -> None:
    job = Job("j", text)
    kept = [(n, firmware_filter(line)) for n, line in enumerate(job.iter_lines(), 1)]
    kept = [(n, code) for n, code in kept if code]
    if any(set(code) & set("!é") for _, code in kept):
        with pytest.raises(GcodeError, match=r"line \d+"):
            list(job.send_lines())
    else:
        assert [*job.send_lines()] == [SendLine(n, code.encode()) for n, code in kept]


@given(harmless)
def test_lines_one_at_a_time_are_the_lines(text: str) -> None:
    job = Job("j", text)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    assert [*job.iter_lines()] == (lines if lines[-1] else lines[:-1])
    assert job.line_count == len([*job.iter_lines()])


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("G0 X1!", "'!' is the feed hold"),
        ("?", "the status query"),
        ("G1~", "the cycle start"),
        ("G0\x18", "0x18 resets the controller"),
        ("G0 X1 µ", "'µ' is not ASCII"),
        ("G0\x07", "0x07 is not printable"),
        ("G1" + "0" * 78, "80 characters without comments and blanks are more than"),
    ],
)
def test_what_must_not_be_sent_is_named_with_its_line(line: str, words: str) -> None:
    with pytest.raises(GcodeError, match=r"^cut\.nc, line 3: .*\.$") as caught:
        list(Job("cut.nc", f"G21\n(fine)\n{line}\nG90\n").send_lines())
    assert words in str(caught.value)


def test_comments_may_hold_anything() -> None:
    job = Job("j", "G0 (ä! ~?\x18) X1 ; Ü!\n(unclosed ! G1\nG1 X2\n")
    assert [*job.send_lines()] == [SendLine(1, b"G0X1"), SendLine(3, b"G1X2")]


def test_the_line_buffer_counts_code_only() -> None:
    line = "G1 " + "0" * 77
    job = Job("j", line + " " * 50 + "(long)")
    assert [*job.send_lines()] == [SendLine(1, b"G1" + b"0" * 77)]
    assert len([*Job("j", "G1" + "0" * 200).send_lines(line_chars=256)]) == 1


def test_lines_are_prepared_as_they_are_asked_for() -> None:
    lines = Job("j", "G1 X0\nG1 X1\n!\n").send_lines()
    assert [next(lines).data, next(lines).data] == [b"G1X0", b"G1X1"]
    with pytest.raises(GcodeError, match=r"line 3\b"):
        next(lines)
