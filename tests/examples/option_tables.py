"""The tables of options in the pages, made from the declarations.

    python tests/examples/option_tables.py     writes them anew

A table stands between ``<!-- options of CLASS -->`` and ``<!-- end -->``.
"""

import re

from pages import PAGES

from miurafab.errors import spell_options
from miurafab.fabrication.options import LayoutOptions
from miurafab.options import declared
from miurafab.origami.fitting.request import FitOptions
from miurafab.workflow.cut_sheets import CutOptions

CLASSES = {each.__name__: each for each in (FitOptions, LayoutOptions, CutOptions)}

TABLE = re.compile(r"(<!-- options of (\w+) -->\n).*?(?=<!-- end -->)", re.DOTALL)


def flag(name):
    """An option as the command line writes it."""
    return f"--{name.replace('_', '-')}"


def table(cls):
    """The options of ``cls`` as a table in Markdown: a line a group, a line an option."""
    lines = ["| option | meaning | default |", "|---|---|---|"]
    group = None
    options = list(declared(cls).values())
    order = list(dict.fromkeys(option.group for option in options))
    for option in sorted(options, key=lambda option: order.index(option.group)):
        if option.group != group:
            group = option.group
            lines.append(f"| **{group}** | | |")
        cells = (
            f"`{f'{flag(option.name)} {option.kind.metavar}'.strip()}`",
            spell_options(option.help, lambda name: f"`{flag(name)}`"),
            option.default_text,
        )
        lines.append("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def with_tables(text):
    """``text`` of a page with each of its tables as the declarations have it."""
    return TABLE.sub(lambda match: f"{match[1]}\n{table(CLASSES[match[2]])}\n", text)


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")
