"""``miurafab use``: one's own machine, material and port, named once."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option
from miurafab.errors import DONE
from miurafab.options import Flag
from miurafab.profiles.own import OwnDefaults, defaults_file, own_defaults, write_defaults

EXAMPLES = (
    "miurafab use grbl-laser-400 card-250 /dev/ttyUSB0",
    "miurafab use",
    "miurafab use --forget",
)


def use(
    machine: Annotated[
        str | None, argument("MACHINE", "A machine profile; without it, the defaults are shown.")
    ] = None,
    material: Annotated[str | None, argument("MATERIAL", "A material.")] = None,
    port: Annotated[str | None, argument("PORT", "The port that 'cut' opens.")] = None,
    /,
    *,
    forget: Annotated[bool, option(Flag(), "Forget the defaults.")] = False,
    console: Console = Console(),
) -> int:
    """Name the machine, material and port that hold where a command names none.

    Profiles of your own are known by their names if they lie in the configuration folder, in
    machines/ and materials/.
    """
    from miurafab.profiles import load_machine, load_material

    if forget:
        write_defaults(OwnDefaults())
    elif machine is not None:
        profile = load_machine(machine)
        new = replace(own_defaults(), machine=_from_anywhere(machine))
        if material is not None:
            load_material(material).on(profile)
            new = OwnDefaults(new.machine, _from_anywhere(material), port)
        write_defaults(new)
    console.answer({**asdict(own_defaults()), "file": str(defaults_file())})
    return DONE


def _from_anywhere(name: str) -> str:
    """A name as it is, a file by its whole path: it is read from other folders."""
    return str(Path(name).resolve()) if Path(name).is_file() else name
