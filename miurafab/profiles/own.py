"""A person's own profiles and defaults: the configuration folder.

It holds ``machines/NAME.toml`` and ``materials/NAME.toml``, which are known by their names as the
shipped ones are, and ``defaults.toml``: the machine, the material and the port that hold where none
is named. The folder is ``$XDG_CONFIG_HOME/miurafab``, ``~/.config/miurafab`` without that variable
(XDG Base Directory Specification), and ``%APPDATA%\\miurafab`` on Windows.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from pathlib import Path

from miurafab.files import write_text
from miurafab.options import Text
from miurafab.profiles.table import Table, read_toml, toml_text


@dataclass(frozen=True)
class OwnDefaults:
    """What holds where none is named; None: the usual one, and no port."""

    machine: str | None = None
    material: str | None = None
    port: str | None = None


def configuration_folder() -> Path:
    """Where this person's files are; it need not exist."""
    home = os.environ.get("XDG_CONFIG_HOME") or os.environ.get("APPDATA")
    return Path(home or Path.home() / ".config") / "miurafab"


def defaults_file() -> Path:
    """The file of :func:`own_defaults`."""
    return configuration_folder() / "defaults.toml"


def own_defaults() -> OwnDefaults:
    """The defaults that ``miurafab use`` wrote; raises ``ProfileError`` for a file that is none."""
    path = defaults_file()
    if not path.is_file():
        return OwnDefaults()
    table = Table(read_toml(path), str(path))
    found = {each.name: table.value(each.name, Text(), None) for each in fields(OwnDefaults)}
    table.finish()
    return OwnDefaults(**found)


def write_defaults(defaults: OwnDefaults) -> Path:
    """Write ``defaults`` in place of those before; returns the file."""
    path = defaults_file()
    values = {each.name: getattr(defaults, each.name) for each in fields(OwnDefaults)}
    text = toml_text({name: value for name, value in values.items() if value is not None})
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)
    return path
