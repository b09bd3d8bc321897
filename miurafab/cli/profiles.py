"""``miurafab profiles`` and ``miurafab materials``: list, show, validate and add TOML files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option
from miurafab.errors import DONE
from miurafab.options import File, Text, declared
from miurafab.profiles.beam import Laser
from miurafab.profiles.machine import Controller
from miurafab.profiles.material import KERF

_BAUD = declared(Controller)["baud"]
_LASER = declared(Laser)
NameArgument = Annotated[
    str | None, argument("NAME", "A shipped name or a TOML file; without it, all are listed.")
]

PROFILES_EXAMPLES = ("miurafab profiles", "miurafab profiles grbl-laser-400")


def profiles(name: NameArgument = None, /, *, console: Console = Console()) -> int:
    """List the machine profiles, or show and validate one."""
    return _list_or_show(console, "firmware_profiles", miurafab.load_machine, name)


def show_material(name: NameArgument = None, /, *, console: Console = Console()) -> int:
    """List the materials, or show and validate one."""
    return _list_or_show(console, "materials", miurafab.load_material, name)


def add_machine(
    name: Annotated[str, argument("NAME", "The new machine, known by this name from then on.")],
    /,
    *,
    port: Annotated[str | None, option(Text("PORT"), "The port of the board.")] = None,
    settings: Annotated[
        Path | None, option(File("FILE"), "What '$$' printed, in place of a port.")
    ] = None,
    like: Annotated[
        str | None,
        option(
            Text("MACHINE"),
            "The profile that gives what settings do not tell.",
            default_text="the default machine",
        ),
    ] = None,
    title: Annotated[str | None, option(Text(), "The machine's title in lists.")] = None,
    baud: Annotated[
        int | None,
        option(
            _BAUD.kind, "Speed of the port in baud.", default_text="as the profile like it says"
        ),
    ] = None,
    beam: Annotated[str | None, option(_LASER["beam"].kind, "Kind of laser.")] = None,
    power: Annotated[float | None, option(_LASER["power"].kind, _LASER["power"].help)] = None,
    wavelength: Annotated[
        float | None, option(_LASER["wavelength"].kind, _LASER["wavelength"].help)
    ] = None,
    console: Console = Console(),
) -> int:
    """Write a machine profile of your own from the settings of the board.

    A laser needs its beam and the power of its light, which no board tells.
    """
    path, made = miurafab.add_machine(
        name,
        port=port,
        settings=settings,
        like=like,
        title=title,
        baud=baud,
        beam=beam,
        power=power,
        wavelength=wavelength,
    )
    console.answer(
        {"file": str(path), "machine": asdict(made)},
        lambda: console.line(f"Wrote {path}. 'miurafab use {name}' makes it the default."),
    )
    return DONE


def add_material(
    name: Annotated[str, argument("NAME", "The new material; NAME.toml is written.")],
    /,
    *,
    source: Annotated[
        Path, option(File("FOLDER"), "The job directory of the calibration sheet.", "--from")
    ],
    cell: Annotated[str | None, option(Text("LABEL"), "The flap that folds best, as B4.")] = None,
    cut: Annotated[
        str | None, option(Text("LABEL"), "The first square that falls out, as X3.")
    ] = None,
    score: Annotated[
        str | None, option(Text("LABEL"), "The scored flap that folds best, as S2.")
    ] = None,
    kerf: Annotated[float | None, option(KERF, "What the kerf gauges read.")] = None,
    title: Annotated[str | None, option(Text(), "The material's title in lists.")] = None,
    console: Console = Console(),
) -> int:
    """Write a material of your own from your choices on a calibration sheet."""
    path, made = miurafab.add_material(
        name, source, cell=cell, cut=cut, score=score, kerf=kerf, title=title
    )
    answer = {"file": str(path), "material": asdict(made)}

    def show() -> None:
        console.line(f"Wrote {path}. Use it with --material {path}.")

    console.answer(answer, show)
    return DONE


PROFILES_HELP = "List the machine profiles, show and validate one, or add one from a board."
PROFILES_ACTIONS: dict[str, tuple[Callable[..., int], tuple[str, ...]]] = {
    "show": (profiles, ("miurafab profiles show grbl-laser-400",)),
    "add": (
        add_machine,
        ("miurafab profiles add k40 --port COM3 --beam co2 --power 38W",),
    ),
}
MATERIALS_HELP = "List the materials, show and validate one, or add one from a calibration."
MATERIALS_EXAMPLES = ("miurafab materials", "miurafab materials card-250")
MATERIALS_ACTIONS: dict[str, tuple[Callable[..., int], tuple[str, ...]]] = {
    "show": (show_material, ("miurafab materials show card-250",)),
    "add": (
        add_material,
        ("miurafab materials add my-card --from trial --cell B4 --kerf 0.15mm",),
    ),
}
"""Each action with its examples."""


def _list_or_show(
    console: Console,
    kind: Literal["firmware_profiles", "materials"],
    load: Callable[[str], Any],
    name: str | None,
) -> int:
    if name is not None:
        console.answer(asdict(load(name)))
        return DONE
    from miurafab.profiles import known_names

    titles = {stem: load(stem).title for stem in known_names(kind)}
    console.answer(
        {kind: [{"name": stem, "title": title} for stem, title in titles.items()]},
        lambda: console.rows(("name", "title"), list(titles.items())),
    )
    return DONE
