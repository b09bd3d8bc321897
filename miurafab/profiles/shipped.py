"""Where the files that come with miurafab are: machine profiles, materials, patterns.

In a checkout they are at the top level, where people edit them; in a wheel they are in
``miurafab/shipped``.
"""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Literal

from miurafab.errors import InputError, ProfileError
from miurafab.files import AnyPath, as_path
from miurafab.profiles.own import configuration_folder, own_defaults

DEFAULT_MACHINE = "grbl-laser-400"
DEFAULT_MATERIAL = "card-250"
"""The profiles that hold where nobody names any."""

Kind = Literal["firmware_profiles", "materials", "patterns"]
_PACKAGE = Path(__file__).resolve().parent.parent
_NOUN = {"firmware_profiles": "machine", "materials": "material", "patterns": "pattern"}


def shipped_directory(kind: Kind) -> Path:
    """The directory with the shipped files of one kind."""
    inside = _PACKAGE / "shipped" / kind
    return inside if inside.is_dir() else _PACKAGE.parent / kind


def shipped_names(kind: Kind, suffix: str = ".toml") -> list[str]:
    """The names (file stems) of the shipped files of one kind, sorted."""
    return sorted(path.stem for path in shipped_directory(kind).glob(f"*{suffix}"))


def own_directory(kind: Kind) -> Path:
    """Where a person keeps files of one kind; it need not exist."""
    return configuration_folder() / f"{_NOUN[kind]}s"


def known_names(kind: Kind, suffix: str = ".toml") -> list[str]:
    """The names of the shipped files and of the person's own, sorted."""
    own = {path.stem for path in own_directory(kind).glob(f"*{suffix}")}
    return sorted(own.union(shipped_names(kind, suffix)))


def find_profile(kind: Kind, given: AnyPath | None) -> Path:
    """The file of a machine or material, for None the person's own default, else the usual one.

    Raises ``ProfileError``.
    """
    if given is None and kind == "firmware_profiles":
        given = own_defaults().machine or DEFAULT_MACHINE
    elif given is None:
        given = own_defaults().material or DEFAULT_MATERIAL
    name = given if isinstance(given, str) else str(as_path(given, f"The {_NOUN[kind]}"))
    return find_file(kind, name)


def find_file(
    kind: Kind, name: str, suffix: str = ".toml", error: type[InputError] = ProfileError
) -> Path:
    """The file that ``name`` means: a path, or a known name with or without ``suffix``.

    The person's own come before the shipped ones. Raises ``error`` if there is none, with the
    nearest known name.
    """
    own = Path(name)
    if own.is_file():
        return own
    if len(own.parts) > 1:
        raise error(f"{name} does not exist.")
    asked, name = name, name.removesuffix(suffix)
    for folder in (own_directory(kind), shipped_directory(kind)):
        if (folder / f"{name}{suffix}").is_file():
            return folder / f"{name}{suffix}"
    names = known_names(kind, suffix)
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean '{near[0]}'" if near else f"there are {', '.join(names)}"
    noun = _NOUN[kind]
    raise error(f"'{asked}' is not a known {noun}; {hint}, or give the path of a {suffix} file.")
