"""Height maps by their file: ``dem.png:height=20,spacing=0.5`` and the same in a design file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from miurafab.errors import TargetError
from miurafab.geometry.arrays import Floats
from miurafab.options import length, read_value
from miurafab.surfaces.catalogue import parse_target
from miurafab.surfaces.height_field import IMAGE_SUFFIXES, read_image

PARAMETERS: Mapping[str, str] = {
    "height": "how high white is above black",
    "spacing": "distance between pixels",
}
_FARTHEST_MM = 1e6


def image_named(target: str) -> tuple[Path, dict[str, str]] | None:
    """The image that ``target`` names, and its parameters; None for another target."""
    file, _, rest = target.rpartition(":") if "=" in target else (target, "", "")
    if Path(file).suffix.lower() not in IMAGE_SUFFIXES:
        return None
    return Path(file), parse_target(f":{rest}")[1]


def heights_in(path: Path, values: Mapping[str, Any]) -> tuple[Floats, float]:
    """The heights in the image ``path`` (rows, columns), and their spacing.

    ``values`` are the ``height`` of white above black and the ``spacing`` of the pixels, 1 mm
    unless given. Raises :class:`~miurafab.errors.TargetError` for another parameter and for a file
    that cannot be read, :class:`~miurafab.errors.OptionError` for a value that is no length.
    """
    for name in values:
        if name not in PARAMETERS:
            known = " and ".join(f"'{each}'" for each in PARAMETERS)
            raise TargetError(f"The image {path.name} has no parameter '{name}'; it has {known}.")
    height = values.get("height")
    if height is not None:
        height = read_value("height", length(-_FARTHEST_MM, _FARTHEST_MM), height)
    spacing = read_value("spacing", length(above=True), values.get("spacing", 1.0))
    return read_image(path, height), spacing
