"""Tables that a study writes into a page, from ``<!-- COMMAND: NAME -->`` to ``<!-- end -->``."""

from __future__ import annotations

import re
from pathlib import Path

from miurafab.files import write_text

Rows = list[tuple[str, ...]]


def markdown(head: tuple[str, ...], rows: Rows, texts: int | None = None) -> str:
    """A table of a page, whose columns behind the first ``texts`` are figures."""
    texts = len(head) if texts is None else texts
    lines = [head, ("---",) * texts + ("---:",) * (len(head) - texts), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def write_tables(page: Path | None, command: str, tables: dict[str, str]) -> None:
    """Put each of ``tables`` into its place in ``page``; without a page, print them."""
    if page is None:
        print("\n".join(tables.values()))
        return
    text = page.read_text(encoding="utf-8")
    for name, table in tables.items():
        place = re.compile(rf"(<!-- {command}: {name} -->\n).*?(?=<!-- end -->)", re.DOTALL)
        assert place.search(text), f"{page} has no place for {name}"
        text = place.sub(lambda match, table=table: f"{match[1]}\n{table}\n", text)
    write_text(page, text)
