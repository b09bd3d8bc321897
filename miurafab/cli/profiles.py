"""``miurafab profiles`` and ``miurafab materials``: list, show and validate the TOML files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Annotated, Any

import typer

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


def materials(
    name: NameArgument = None, as_json: JsonOption = False, quiet: QuietOption = False
) -> None:
    """List the materials, or show and validate one."""
    _list_or_show(Console(as_json, quiet), "materials", load_material, name)


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
