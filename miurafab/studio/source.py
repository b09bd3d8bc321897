"""A file that the studio was given, and what can be done with it by its ending."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from miurafab.errors import InputError
from miurafab.fabrication.stock import read_stock
from miurafab.studio.names import safe_stem
from miurafab.surfaces.height_field import IMAGE_SUFFIXES
from miurafab.surfaces.mesh_files import mesh_suffix

PATTERN_SUFFIX, DESIGN_SUFFIX = ".fold", ".toml"


@dataclass(frozen=True)
class Source:
    """A file to fit or to open: a ``mesh``, an ``image``, a ``pattern`` or a ``design``; or a
    ``stock`` of sheets.

    ``ours`` says that the command line named the file; ``shown`` is its name in command lines.
    """

    id: str
    kind: str
    path: Path
    shown: str
    ours: bool = False

    @property
    def name(self) -> str:
        """The name of what is made of it."""
        return safe_stem(self.path.name)


def kind_of(path: Path) -> str | None:
    """The kind of the file ``path`` by its ending, None for one that is not known here."""
    suffix = path.suffix.lower()
    if mesh_suffix(path):
        return "mesh"
    if suffix in IMAGE_SUFFIXES:
        return "image"
    return {PATTERN_SUFFIX: "pattern", DESIGN_SUFFIX: "design"}.get(suffix)


def require_stock(path: Path) -> None:
    """Raise ``InputError`` for a file that holds no sheets, and remove it with its folder."""
    try:
        read_stock(path)
    except InputError as fault:
        shutil.rmtree(path.parent)
        raise InputError(fault.sentence.replace(str(path), path.name)) from None
