"""``miurafab profiles`` and ``miurafab materials``: list, show, validate and add TOML files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.profiles import load_machine, load_material, shipped_names
from miurafab.profiles.shipped import Kind

NameArgument = Annotated[
    str | None, typer.Argument(help="A shipped name or a TOML file; without it, list all.")
]


def profiles(
    name: NameArgument = None, as_json: JsonOption = False, quiet: QuietOption = False
) -> None:
    """List the machine profiles, or show and validate one."""
    _list_or_show(Console(as_json, quiet), "firmware_profiles", load_machine, name)


class _MaterialsGroup(typer.core.TyperGroup):
    """``materials`` alone, or with a name or options, means ``materials show``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if not args or (args[0] not in self.commands and args[0] != "--help"):
            args = ["show", *args]
        return super().parse_args(ctx, args)


materials = typer.Typer(
    cls=_MaterialsGroup,
    help="List the materials, show and validate one, or add one from a calibration.",
    rich_markup_mode=None,
)


@materials.command("show")
def show_material(
    name: NameArgument = None, as_json: JsonOption = False, quiet: QuietOption = False
) -> None:
    """List the materials, or show and validate one ('show' may be left out)."""
    _list_or_show(Console(as_json, quiet), "materials", load_material, name)


@materials.command("add")
def add_material(
    name: Annotated[str, typer.Argument(help="The new material; NAME.toml is written.")],
    source: Annotated[
        Path, typer.Option("--from", help="The job directory of the calibration sheet.")
    ],
    cell: Annotated[str | None, typer.Option(help="The flap that folds best, such as B4.")] = None,
    cut: Annotated[
        str | None, typer.Option(help="The first square that falls out, such as X3.")
    ] = None,
    kerf: Annotated[str | None, typer.Option(help="What the kerf gauge says, as 0.15mm.")] = None,
    title: Annotated[str | None, typer.Option(help="What the material is called in lists.")] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Write a material of your own from what was chosen on a calibration sheet."""
    console = Console(as_json, quiet)
    path, made = miurafab.add_material(name, source, cell=cell, cut=cut, kerf=kerf, title=title)
    answer = {"file": str(path), "material": asdict(made)}

    def show() -> None:
        console.line(f"Wrote {path}. Use it with --material {path}.")

    console.answer(answer, show)


def _list_or_show(
    console: Console, kind: Kind, load: Callable[[str], Any], name: str | None
) -> None:
    if name is not None:
        console.answer(asdict(load(name)))
        return
    found = {stem: load(stem).title for stem in shipped_names(kind)}
    console.answer(
        {kind: [{"name": stem, "title": title} for stem, title in found.items()]},
        lambda: console.rows(("name", "title"), list(found.items())),
    )
