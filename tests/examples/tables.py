"""What the pages have from the program: tables of options, keys and findings, and the reference.

    python tests/examples/tables.py     writes them anew

Each stands between ``<!-- table: NAME -->`` and ``<!-- end -->``.
"""

import contextlib
import html
import inspect
import io
import re

from pages import PAGES
from rich.console import Console

import miurafab
from miurafab.cli.program import COMMANDS, app
from miurafab.errors import EXIT_CODES, spell_options
from miurafab.fabrication.options import LayoutOptions
from miurafab.findings import RULES
from miurafab.options import declared
from miurafab.origami.fitting.request import FitOptions
from miurafab.profiles.beam import Laser, Meant, Operation
from miurafab.profiles.machine import Bed, Controller, Knife, MotionLimits, ZAxis
from miurafab.profiles.material import CreaseStiffness, Perforation, TabRule
from miurafab.workflow.cut_options import CutOptions

_PLACE = re.compile(r"(<!-- table: (\w+) -->\n).*?(?=<!-- end -->)", re.DOTALL)
WIDTH = 80
"""Columns of the terminal in which the commands show their help."""


def _flag(name):
    """An option as the command line writes it."""
    return f"--{name.replace('_', '-')}"


def _options(cls):
    """The options of ``cls``: a line a group, a line an option."""
    options = list(declared(cls).values())
    order = list(dict.fromkeys(option.group for option in options))
    rows, group = [], None
    for option in sorted(options, key=lambda option: order.index(option.group)):
        if option.group != group:
            group = option.group
            rows.append((f"**{group}**", "", ""))
        written = f"{_flag(option.name)} {option.kind.metavar}".strip()
        meaning = spell_options(option.help, lambda name: f"`{_flag(name)}`")
        rows.append((f"`{written}`", meaning, option.default_text))
    return ("option", "meaning", "default"), rows


def _keys(**tables):
    """The keys of the TOML ``tables``, each declared by classes."""
    rows = []
    for table, classes in tables.items():
        for key in (key for cls in classes for key in declared(cls).values()):
            rows.append((table, f"`{key.name}`", key.help, key.kind.accepts, key.default_text))
    shown = [
        (f"`[{row[0]}]`" if at == 0 or rows[at - 1][0] != row[0] else "", *row[1:])
        for at, row in enumerate(rows)
    ]
    return ("table", "key", "meaning", "accepted", "default"), shown


def _findings():
    rows = [
        (f"`{code}`", rule.severity, rule.meaning, "yes" if rule.forceable else "")
        for code, rule in RULES.items()
    ]
    return ("code", "severity", "meaning", "`--force`"), rows


def _checks():
    rows = [(f"`{code}`", rule.meaning) for code, rule in RULES.items() if rule.forceable]
    return ("code", "refused unless forced"), rows


def _exits():
    return ("code", "meaning"), [(str(code), meaning) for code, meaning in EXIT_CODES.items()]


def _help(words):
    shown = io.StringIO()
    console = Console(file=shown, width=WIDTH, color_system=None)
    with contextlib.suppress(SystemExit):
        app.help_print(words, console=console)
    return shown.getvalue().strip()


def _commands():
    """Every command under its group, with the help that the terminal shows."""
    groups = dict.fromkeys(command.group for command in COMMANDS.values())
    parts = []
    for group in groups:
        parts.append(f"## {group.name}")
        for name, command in COMMANDS.items():
            if command.group is group:
                parts += [f"### miurafab {name}", _console([name])]
                for action in command.actions:
                    parts += [f"#### miurafab {name} {action}", _console([name, action])]
    return "\n\n".join(parts) + "\n"


def _console(words):
    return f"```console\n{_help(words)}\n```"


def _names():
    """Every public name of the package, as mkdocstrings asks for it."""
    kinds = {"Functions": [], "Values": [], "Exceptions": []}
    for name in miurafab.__all__:
        value = getattr(miurafab, name)
        if inspect.isfunction(value):
            kinds["Functions"].append(name)
        elif inspect.isclass(value) and issubclass(value, BaseException):
            kinds["Exceptions"].append(name)
        elif inspect.isclass(value):
            kinds["Values"].append(name)
    return "\n".join(
        f"## {kind}\n\n" + "".join(f"::: miurafab.{name}\n\n" for name in names)
        for kind, names in kinds.items()
    )


TABLES = {
    "api": _names,
    "commands": _commands,
    "FitOptions": lambda: _options(FitOptions),
    "LayoutOptions": lambda: _options(LayoutOptions),
    "CutOptions": lambda: _options(CutOptions),
    "machine": lambda: _keys(
        bed=[Bed], motion=[MotionLimits], z=[ZAxis], controller=[Controller], tool=[Laser, Knife]
    ),
    "material": lambda: _keys(
        perforation=[Perforation],
        folding=[CreaseStiffness],
        tabs=[TabRule],
        **{"beams.BEAM": [Meant]},
        operations=[Operation],
    ),
    "checks": _checks,
    "findings": _findings,
    "exits": _exits,
}


def _markdown(made):
    if isinstance(made, str):
        return made
    head, rows = made
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(map(_cell, line)) + " |\n" for line in lines)


def _cell(text):
    """``text`` in a table, where a bar ends a cell. Readers differ on its escape in backticks."""
    barred = re.sub(
        r"`([^`]*\|[^`]*)`", lambda code: f"<code>{html.escape(code[1], quote=False)}</code>", text
    )
    return barred.replace("|", "&#124;")


def with_tables(text):
    """``text`` of a page with each of its tables as the program has it."""
    return _PLACE.sub(lambda match: f"{match[1]}\n{_markdown(TABLES[match[2]]())}\n", text)


def tables_in(text):
    """The names of the tables in ``text``."""
    return {name for _, name in _PLACE.findall(text)}


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(with_tables(page.read_text(encoding="utf-8")), encoding="utf-8")
