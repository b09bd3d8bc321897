"""The pages in print and the blocks of code in them.

A page is a Markdown file. Its fenced blocks are examples:

``sh``      commands, run line by line in the page's folder
``text``    directly after ``sh`` or ``python``: what the last command or all of the block prints;
            ``...`` stands for anything
``python``  run in one namespace for the page, in the page's folder
``usage``   how a command is called; each word of it must be known to the command line
``console`` what a terminal shows, made by ``tables.py``
``toml``    with ``<!-- file: NAME -->`` before it: put into the page's folder under that name;
            ``csv`` and ``yaml`` likewise

A comment before a block directs it: ``<!-- file: NAME -->``, ``<!-- exit 1 -->`` for commands that
end with another code than 0, and ``<!-- not run: REASON -->``.
"""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]

_FENCE = re.compile(r"^ *```(\w*)$")
_DIRECTIVE = re.compile(r"^ *<!-- *(file|exit|not run)[: ]+(.*?) *-->$")


@dataclass(frozen=True)
class Block:
    """A fenced block: ``line`` is where its text begins, ``shown`` what its commands print."""

    page: Path
    line: int
    language: str
    text: str
    directives: dict[str, str]
    shown: str | None = None

    def __str__(self):
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks_of(page):
    """The fenced blocks of ``page`` in order; the output of commands is with its commands."""
    found = []
    lines = page.read_text(encoding="utf-8").splitlines()
    directives, number, since = {}, 0, None
    while number < len(lines):
        directive, fence = _DIRECTIVE.match(lines[number]), _FENCE.match(lines[number])
        if directive:
            directives[directive[1]] = directive[2]
        elif fence:
            end = next(k for k in range(number + 1, len(lines)) if lines[k].strip() == "```")
            text = "\n".join(lines[number + 1 : end]) + "\n"
            block = Block(page, number + 2, fence[1], text, directives)
            if block.language == "text" and found and since == found[-1]:
                found[-1] = Block(**{**vars(found[-1]), "shown": text})
            else:
                found.append(block)
            number, directives, since = end, {}, found[-1]
        elif lines[number].strip():
            directives, since = {}, None
        number += 1
    return found


def indented_code(page):
    """Lines of ``page`` that Markdown takes for code because they are indented, by number."""
    lines = page.read_text(encoding="utf-8").splitlines()
    fenced, within_list, wrong = False, False, []
    for number, line in enumerate(lines, start=1):
        if _FENCE.match(line):
            fenced = not fenced
        if fenced or not line.strip():
            continue
        if not line.startswith(" "):
            within_list = bool(re.match(r"([-*]|\d+\.) ", line))
        elif line.startswith("    ") and not within_list:
            wrong.append(number)
    return wrong


def prose_of(page):
    """The text of ``page`` outside its fenced blocks."""
    fenced, kept = False, []
    for line in page.read_text(encoding="utf-8").splitlines():
        if _FENCE.match(line):
            fenced = not fenced
        elif not fenced:
            kept.append(line)
    return "\n".join(kept)


def matches(shown, printed):
    """Whether ``printed`` is as ``shown``, where ``...`` stands for any text."""
    parts = [re.escape(part) for part in _plain(shown).split("...")]
    return re.fullmatch(".*?".join(parts), _plain(printed), re.DOTALL) is not None


def _plain(text):
    return "\n".join(line.rstrip() for line in text.strip().splitlines())
