"""The messages that the troubleshooting page quotes are those of the program."""

import re

from pages import ROOT

PAGE = ROOT / "docs" / "troubleshooting.md"


def _source():
    """All string literals of the package, run together where a literal goes on in the next line."""
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "miurafab").rglob("*.py")]
    return re.sub(r'"\s*f?"', "", "\n".join(texts))


def test_each_message_is_in_the_program():
    rows = re.findall(r"^\| (`[^|]*`) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) > 15
    source = _source()
    parts = [part for row in rows for part in re.findall(r"`([^`]+)`", row)]
    assert [part for part in parts if part not in source] == []
