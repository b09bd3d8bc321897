"""Every option stands once: the command line, TOML files and the page have what is declared.

The tables in the pages are compared with the declarations in tests/examples/test_pages.py.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from functools import cache
from html.parser import HTMLParser
from importlib import resources

import numpy as np
import pytest

from miurafab.errors import OptionError, spell_options
from miurafab.fabrication.options import Borders, LayoutOptions
from miurafab.options import (
    Choice,
    Declared,
    Either,
    File,
    Flag,
    Kind,
    Pair,
    Quantity,
    Several,
    Whole,
    declared,
    read_options,
)
from miurafab.origami.fitting.kinds import CutColumns, FlatFoldability, Pieces, Poles
from miurafab.origami.fitting.request import FitOptions
from miurafab.studio.form import FIT, LAYOUT, filled
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.design import design
from miurafab.workflow.energy_options import EnergyOptions
from miurafab.workflow.fold_options import FoldOptions
from miurafab.workflow.tradeoff_options import TradeoffOptions

COMMANDS = {
    FitOptions: "fit",
    LayoutOptions: "sheets",
    CutOptions: "cut",
    FoldOptions: "fold",
    EnergyOptions: "energy",
    TradeoffOptions: "tradeoff",
}
OPTIONS = [(cls, option) for cls in COMMANDS for option in declared(cls).values()]

every_option = pytest.mark.parametrize(
    ("cls", "option"), OPTIONS, ids=[f"{cls.__name__}-{option.name}" for cls, option in OPTIONS]
)


@every_option
def test_yes_is_no_number_and_no_name(cls, option):
    """In Python True is 1, and no option means that: each that is not yes or no names its value."""
    if isinstance(option.kind, Flag):
        assert option.kind.read(True) is True
        return
    for yes in (True, np.True_, (True, True), 6 * (True,)):
        with pytest.raises(OptionError, match=r"True(?!rad)"):
            read_options(cls, {option.name: yes})


def flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def example(kind: Kind) -> str:
    """A value that is not the default, as a person writes it."""
    if isinstance(kind, Quantity):
        return f"{min(max(kind.low, 0) + 1, kind.high):g}{kind.unit.replace(' %', '').strip()}"
    if isinstance(kind, Pair):
        return kind.separator.join([example(kind.kind)] * 2)
    if isinstance(kind, Several):
        return example(kind.kind)
    if kind.metavar == "N,N,...":  # the sides of a trade-off
        return "4,6,8"
    return {
        Whole: lambda: str(max(kind.low, 3)),
        Choice: lambda: kind.names[-1],
        Either: lambda: kind.choice.names[-1],
        Flag: lambda: "true",
        File: lambda: "stock.toml",
        FlatFoldability: lambda: "0.9deg",
        Pieces: lambda: "3",
        Borders: lambda: "1,2",
        CutColumns: lambda: "1,2",
        Poles: lambda: "0,0,-1,0,0,1",
    }.get(type(kind), lambda: "0.1,0.9,0.2,0.8")()


@cache
def help_of(command: str) -> str:
    words = [sys.executable, "-m", "miurafab", command, "--help"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


@every_option
def test_the_command_line_has_it_in_the_words_of_the_declaration(
    cls: type, option: Declared
) -> None:
    default = f" [default: {option.default_text}]" if option.default_text else ""
    words = f"{flag(option.name)} {option.kind.metavar} {option.help}{default}"
    assert " ".join(spell_options(words, flag).split()) in " ".join(help_of(COMMANDS[cls]).split())


@every_option
def test_a_toml_file_has_it_in_its_own_words(cls: type, option: Declared) -> None:
    value = example(option.kind)
    beside = {"bridges": 3} if option.name == "bridge" else {}  # a length of bridges needs some
    with_it = read_options(cls, tomllib.loads(f'{option.name} = "{value}"') | beside)
    assert with_it != read_options(cls, beside)
    assert with_it == read_options(cls, beside, over={option.name: value})
    with pytest.raises(OptionError, match=rf"^x\.toml: '{option.name}'"):
        read_options(cls, {option.name: object()}, where="x.toml")


MESH_ONLY = ("edge", "side", "holes", "poles", "polar_hole")
"""The options that a design of a named surface refuses."""


def test_a_design_file_takes_every_option_of_a_fit_and_of_a_layout(tmp_path) -> None:
    # a barrier is for a sheet of one piece without limits
    fits = {name: each for name, each in declared(FitOptions).items()
            if name not in ("region", "rotate", "close", "barrier", *MESH_ONLY)}  # fmt: skip
    lines = [f'{name} = "{example(each.kind)}"' for name, each in fits.items()]
    lines += ["[target]", 'surface = "hyperboloid"', "[layout]", 'machine = "grbl-laser-400"']
    layout = {name: example(each.kind) for name, each in declared(LayoutOptions).items()}
    layout["marks"] = "back"  # ticks are marks, which `none` leaves out
    del layout["full_facet"]  # tabs so large are glued to the facet, and not joined in pairs
    lines += [f'{name} = "{value}"' for name, value in layout.items()]
    file = tmp_path / "all.toml"
    file.write_text("\n".join(lines))
    made = design(str(file))
    for name, each in fits.items():
        assert getattr(made.request, each.field) == each.kind.read(example(each.kind)), name
    assert made.layout is not None
    assert made.layout.nesting.stock == tmp_path / "stock.toml"


class Form(HTMLParser):
    """The inputs of a page by their names, and all its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.fields: dict[str, dict[str, str | None]] = {}
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag in ("input", "select") and "name" in given:
            self.fields[given["name"]] = given

    def handle_data(self, data):
        self.text += data


def test_what_nobody_chose_on_the_page_is_not_sent() -> None:
    """A list shows its first choice until another is taken, so that one has the empty value."""
    page = resources.files("miurafab.studio").joinpath("page/studio.html").read_text("utf-8")
    chosen = {name for name, each in (FIT | LAYOUT).items() if isinstance(each.kind, Choice)}
    unset = re.findall(r'<select id="(\w+)"[^>]*><option value="">', filled(page).replace("\n", ""))
    assert {"prefer", "marks", "close"} <= chosen == set(unset)


def test_the_page_has_the_fields_that_are_declared_for_it() -> None:
    page = resources.files("miurafab.studio").joinpath("page/studio.html").read_text("utf-8")
    form = Form(filled(page))
    assert form.fields.keys() == {*FIT, *LAYOUT}
    for name, option in (FIT | LAYOUT).items():
        assert option.help.split("`")[0] in form.text
        if not isinstance(option.kind, Flag | Choice):
            assert form.fields[name]["placeholder"] == option.default_text
