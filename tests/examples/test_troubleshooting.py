"""The messages that the troubleshooting page quotes are those of the program."""

import re

from pages import ROOT

from miurafab.grbl.codes import alarm_codes, error_codes
from miurafab.grbl.events import Alarm, Error
from miurafab.grbl.streamer import alarm_words, error_words

PAGE = ROOT / "docs" / "troubleshooting.md"


def _source():
    """All string literals of the package, run together where a literal goes on in the next line."""
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "miurafab").rglob("*.py")]
    return re.sub(r'"\s*f?"', "", "\n".join(texts))


def test_each_message_is_in_the_program():
    rows = re.findall(
        r"^\| (`(?!ALARM:|error:)[^|]*`) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(rows) > 35
    source = _source()
    parts = [part for row in rows for part in re.findall(r"`([^`]+)`", row)]
    assert [part for part in parts if part not in source] == []


def _coded(prefix):
    """The names of the rows of ``ALARM:`` or ``error:`` codes, by number."""
    found = re.findall(rf"^\| `{prefix}(\d+)` \| ([^|]+) \|", PAGE.read_text("utf-8"), re.MULTILINE)
    return {int(number): name for number, name in found}


def test_each_alarm_has_its_row_and_its_name():
    assert _coded("ALARM:") == {code.number: code.name for code in alarm_codes().values()}
    for number in _coded("ALARM:"):
        assert alarm_words(Alarm(number, "")).startswith(f"ALARM:{number}, ")


def test_the_errors_have_their_names():
    rows = _coded("error:")
    assert len(rows) > 10
    assert rows == {number: error_codes()[number].name for number in rows}
    for number in rows:
        assert error_words(Error(number, "")).startswith(f"error:{number}, ")
