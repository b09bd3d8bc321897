"""A material of one's own: that of a calibration sheet, with the settings chosen on it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from miurafab.errors import InputError, ProfileError
from miurafab.fabrication.perforation import MIN_STROKE_MM
from miurafab.files import AnyPath, Reading, as_path, file_name, parse_json, read_text, write_text
from miurafab.options import read_value
from miurafab.options.verbs import verb
from miurafab.profiles import Material, find_file, load_material, read_toml
from miurafab.profiles.material import KERF
from miurafab.profiles.table import toml_text
from miurafab.workflow.calibrate import CHOICES, SCHEMA, written_operation
from miurafab.workflow.job_files import settle_job

_KEYS = ("machine", "material", "beam", "power", "wavelength", "cells", "scores", "squares")
_KIND = "a calibration that 'miurafab calibrate' wrote; make it again"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@verb
def add_material(
    name: AnyPath,
    directory: AnyPath,
    *,
    cell: str | None = None,
    cut: str | None = None,
    score: str | None = None,
    kerf: str | float | None = None,
    title: str | None = None,
) -> tuple[Path, Material]:
    """Write ``NAME.toml``: the material of a calibration with the settings that were chosen.

    Parameters
    ----------
    name : str or os.PathLike
        What the material is called, or the path of its file. A file is not overwritten.
    directory : str or os.PathLike
        The job directory of the calibration sheet.
    cell : str, optional
        The label of a flap: its dash and gap then hold for all creases, and its power or force and
        its feed for perforating.
    cut : str, optional
        The label of a square: its settings then hold for cutting.
    score : str, optional
        The label of a scored flap: its settings then hold for scoring.
    kerf : str or float, optional
        The width of the cut, mm.
    title : str, optional
        What lists call the material.

    Returns
    -------
    (Path, Material)

    Raises
    ------
    InputError
        For a label that is not on the sheet, and for a name that cannot be one.
    ProfileError
        Where the choices do not make a material.

    Examples
    --------
    >>> import miurafab as mf
    >>> _ = mf.calibrate("test-sheet")
    >>> path, material = mf.add_material("my-card", "test-sheet", kerf="0.2mm")
    >>> material.kerf_mm
    0.2
    """
    name = str(as_path(name, "The material"))
    directory = as_path(directory, "The job directory")
    path = Path(name) if name.endswith(".toml") else Path(f"{name}.toml")
    if not _NAME.fullmatch(path.stem):
        raise InputError(f"'{path.stem}' cannot name a material; use letters, digits, '-' and '_'.")
    if path.exists():
        raise InputError(f"{path} exists already; choose another name or remove it.")
    if cell is None and cut is None and score is None and kerf is None:
        raise InputError("Nothing was chosen; give a `cell`, a `cut`, a `score` or a `kerf`.")
    settle_job(directory)
    choices = _choices(directory)
    own = directory / f"{choices['material']}.toml"
    base = own if own.is_file() else find_file("materials", str(choices["material"]))
    values = read_toml(base)
    values["title"] = title or f"{values['title']}, calibrated"
    with Reading(directory / CHOICES, _KIND, InputError):
        entry = _of_beam(values, choices)
        if kerf is not None:
            values["kerf"] = _mm(read_value("kerf", KERF, kerf))
        if cell is not None:
            chosen = _labelled(choices["cells"], cell, directory)
            _take_dashes(values, chosen["perforation"])
            entry["operations"]["perforate"] |= written_operation(chosen["operation"])
        for label, group, operation in ((cut, "squares", "cut"), (score, "scores", "score")):
            if label is not None:
                chosen = _labelled(choices[group], label, directory)
                entry["operations"][operation] |= written_operation(chosen["operation"])
    said = ", ".join(
        f"{what} {value}"
        for what, value in (("flap", cell), ("square", cut), ("score", score), ("kerf", kerf))
        if value is not None
    )
    head = f"# {choices['material']} calibrated on {choices['machine']}: {said}.\n"
    write_text(path, head + toml_text(values))
    try:
        material = load_material(path)
        _drawable(material)
    except ProfileError:
        path.unlink()
        raise
    return path, material


def _choices(directory: Path) -> dict[str, Any]:
    file = directory / CHOICES
    if not file.is_file():
        raise InputError(
            f"{directory} holds no calibration ({CHOICES} is missing); make one with "
            "'miurafab calibrate'."
        )
    text = read_text(file, InputError, _KIND)
    with Reading(file, _KIND, InputError):
        found = parse_json(text)
        if found["schema"] != SCHEMA:
            raise InputError(f"{file} has schema {found['schema']!r}; this reads '{SCHEMA}'.")
        for key in ("machine", "material"):
            file_name(found[key], str(file))
        return {key: found[key] for key in _KEYS}


def _of_beam(values: dict[str, Any], choices: Mapping[str, Any]) -> dict[str, Any]:
    """The entry of the beam that was tried, the only one that is left in ``values``: kerf and
    dashes are of that beam, too. It is meant for the machine that it was tried on.
    """
    beam = str(choices["beam"])
    entry: dict[str, Any] = values["beams"][beam]
    if choices["power"] is not None:
        entry["lasers"] = [f"{choices['power']:g}W"] * 2
    else:
        entry["forces_of"] = choices["machine"]
    if choices["wavelength"] is not None:
        entry["wavelength"] = choices["wavelength"]
    values["beams"] = {beam: entry}
    return entry


def _labelled(entries: list[dict[str, Any]], label: str, directory: Path) -> dict[str, Any]:
    for entry in entries:
        if entry["label"] == label.upper():
            return entry
    if not entries:
        raise InputError(f"'{label}' is not on the sheet in {directory}, which has none such.")
    raise InputError(
        f"'{label}' is not on the sheet in {directory}, where there are "
        f"{entries[0]['label']} to {entries[-1]['label']}."
    )


def _take_dashes(values: dict[str, Any], rule: Mapping[str, Any]) -> None:
    """Put the dashes of ``rule`` in place of all others, whatever kind of crease they are for."""
    names = {"cut": "cut_mm", "gap": "gap_mm", "min_end": "min_end_mm"}
    values["perforation"].update({key: _mm(rule[name]) for key, name in names.items()})
    for kind in values.get("creases", {}).values():
        for key in names:
            kind.pop(key, None)


def _mm(length: float) -> str:
    return f"{length:g}mm"


def _drawable(material: Material) -> None:
    least = material.kerf_mm + MIN_STROKE_MM
    if material.perforation.cut_mm < least:
        raise ProfileError(
            f"With a kerf of {material.kerf_mm:g} mm, dashes of {material.perforation.cut_mm:g} mm "
            f"cannot be drawn; choose a cell with dashes of at least {least:g} mm."
        )
