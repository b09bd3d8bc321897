"""Calibration: a sheet that tries settings out, and the material made of the ones chosen.

The sheet is a job directory like any other; ``calibration.json`` in it says what each label on it
stands for, so that a choice can be named by its label.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from miurafab.display import Shown
from miurafab.errors import InputError, ProfileError
from miurafab.fabrication.calibration import (
    SHEET,
    STRIPS,
    CalibrationSheet,
    calibration_sheet,
)
from miurafab.fabrication.drawing.calibration_guide import calibration_guide
from miurafab.fabrication.drawing.svg import sheet_svg
from miurafab.fabrication.layout import write_layout
from miurafab.fabrication.perforation import MIN_STROKE_MM
from miurafab.fabrication.sheets import Layout, Sheet, Totals
from miurafab.files import (
    AnyPath,
    Reading,
    as_path,
    file_name,
    parse_json,
    read_text,
    write_draft,
    write_text,
)
from miurafab.options import read_value
from miurafab.options.verbs import verb
from miurafab.origami.formats.fold import fold_text
from miurafab.posting.sections import post_sections
from miurafab.profiles import (
    Material,
    find_file,
    find_profile,
    load_machine,
    load_material,
    read_toml,
)
from miurafab.profiles.material import KERF
from miurafab.profiles.shipped import Kind
from miurafab.profiles.table import toml_text
from miurafab.workflow.dry_run import dry_run
from miurafab.workflow.job_directory import JobDirectory
from miurafab.workflow.job_files import job_files, keep_profiles, settle_job
from miurafab.workflow.manifest import LAYOUT, write_manifest

CHOICES = "calibration.json"
GUIDE = "calibration.pdf"
SCHEMA = "miurafab-calibration/1"
_COUPON = "coupon.fold"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclasses.dataclass(frozen=True, repr=False)
class Calibration(Shown):
    """A calibration sheet and the job directory that it was written to.

    Attributes
    ----------
    job : JobDirectory
        What :func:`preview` and :func:`cut` take.
    sheet : CalibrationSheet
        The flaps, the squares and their labels.
    """

    job: JobDirectory
    sheet: CalibrationSheet

    def _summary(self) -> str:
        return f"{self.job.path}: {len(self.sheet.cells)} flaps, {len(self.sheet.squares)} squares"


@verb
def calibrate(
    directory: AnyPath,
    machine: AnyPath | None = None,
    material: AnyPath | None = None,
) -> Calibration:
    """Write the job directory of a test sheet: dashes against power and feed, kerf gauge, coupon.

    Parameters
    ----------
    directory : str or os.PathLike
        The job directory. It is made if need be.
    machine : str or os.PathLike, optional
        A laser: a shipped name or a TOML file, grbl-laser-400 by default.
    material : str or os.PathLike, optional
        The material to begin with: a shipped name or a TOML file, card-250 by default.

    Returns
    -------
    Calibration

    Raises
    ------
    ProfileError
        For a machine that is no laser.
    LayoutError
        For a bed that is too small.
    InputError
        For a directory that holds something else.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.calibrate("test-sheet", material="card-250")
    <Calibration test-sheet: 24 flaps, 6 squares>
    """
    directory = as_path(directory, "The job directory")
    machine_file = find_profile("firmware_profiles", machine)
    material_file = find_profile("materials", material)
    profile, stock = load_machine(machine_file), load_material(material_file)
    sheet = calibration_sheet(profile, stock)
    toolpath = sheet.toolpath
    job = post_sections(sheet.sections, profile, patch_labels=sheet.labels)
    with job_files(directory) as staging:
        keep_profiles(machine_file, material_file, directory, staging)
        size = (sheet.width_mm, sheet.height_mm)
        timed = dry_run(SHEET, job, profile, size, stock.max_power)
        write_draft(staging / f"{SHEET}{profile.job_suffix}", job.text)
        write_draft(staging / f"{SHEET}.svg", sheet_svg(toolpath))
        guide = calibration_guide(sheet, profile, stock, directory.name or str(directory))
        write_draft(staging / GUIDE, guide)
        coupon = fold_text(sheet.coupon, "Fold coupon")
        write_draft(staging / _COUPON, coupon)
        choices = {
            "schema": SCHEMA,
            "machine": profile.name,
            "material": stock.name,
            "cells": [dataclasses.asdict(cell) for cell in sheet.cells],
            "squares": [dataclasses.asdict(square) for square in sheet.squares],
            "kerf_gauge": {"strips": STRIPS},
        }
        write_draft(staging / CHOICES, json.dumps(choices, indent=1) + "\n")
        layout = Layout(
            machine=profile.name,
            material=stock.name,
            patches=(),
            sheets=(Sheet(SHEET, sheet.width_mm, sheet.height_mm, ()),),
            totals=Totals(
                patches=0,
                sheets=1,
                seam_mm=0.0,
                tabs=0,
                density=0.0,
                cut_mm=toolpath.length_of("cut"),
                perforated_mm=toolpath.length_of("perforate"),
                travel_mm=toolpath.travel_mm,
                seconds=round(timed.seconds, 1),
            ),
        )
        digest = hashlib.sha256(coupon.encode("utf-8")).hexdigest()
        write_draft(staging / LAYOUT, write_layout(layout, _COUPON, digest))
        profiles: dict[Kind, Path] = {
            "firmware_profiles": machine_file,
            "materials": material_file,
        }
        write_manifest(staging, (), {}, profiles)
    made = JobDirectory(directory, layout, profile, stock.max_power, (job,), (timed,))
    return Calibration(made, sheet)


@verb
def add_material(
    name: AnyPath,
    directory: AnyPath,
    *,
    cell: str | None = None,
    cut: str | None = None,
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
        The label of a flap: its dash and gap then hold for all creases, and its power and feed for
        perforating.
    cut : str, optional
        The label of a square: its power and feed then hold for cutting.
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
    if cell is None and cut is None and kerf is None:
        raise InputError("Nothing was chosen; give a `cell`, a `cut` or a `kerf`.")
    settle_job(directory)
    choices = _choices(directory)
    own = directory / f"{choices['material']}.toml"
    base = own if own.is_file() else find_file("materials", str(choices["material"]))
    values = read_toml(base)
    values["title"] = title or f"{values['title']}, calibrated"
    if kerf is not None:
        values["kerf"] = _mm(read_value("kerf", KERF, kerf))
    if cell is not None:
        chosen = _labelled(choices["cells"], cell, directory)
        _take_dashes(values, chosen["perforation"])
        values["operations"]["perforate"] = _written(chosen["operation"])
    if cut is not None:
        chosen = _labelled(choices["squares"], cut, directory)
        values["operations"]["cut"] = _written(chosen["operation"])
    said = ", ".join(
        f"{what} {value}"
        for what, value in (("flap", cell), ("square", cut), ("kerf", kerf))
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
    kind = "a calibration that 'miurafab calibrate' wrote; make it again"
    text = read_text(file, InputError, kind)
    with Reading(file, kind, InputError):
        found = parse_json(text)
        if found["schema"] != SCHEMA:
            raise InputError(f"{file} has schema {found['schema']!r}; this reads '{SCHEMA}'.")
        for key in ("machine", "material"):
            file_name(found[key], str(file))
        return {key: found[key] for key in ("machine", "material", "cells", "squares")}


def _labelled(entries: list[dict[str, Any]], label: str, directory: Path) -> dict[str, Any]:
    for entry in entries:
        if entry["label"] == label.upper():
            return entry
    raise InputError(
        f"'{label}' is not on the sheet in {directory}, where there are "
        f"{entries[0]['label']} to {entries[-1]['label']}."
    )


def _take_dashes(values: dict[str, Any], rule: Mapping[str, Any]) -> None:
    """Put the dashes of ``rule`` in place of all others, whatever kind of crease they are for."""
    names = {"cut": "cut_mm", "gap": "gap_mm", "min_end": "min_end_mm"}
    values["perforation"].update({key: _mm(rule[name]) for key, name in names.items()})
    for kind in values.get("creases", {}).values():
        if isinstance(kind, dict):
            for key in names:
                kind.pop(key, None)


def _mm(length: float) -> str:
    return f"{length:g}mm"


def _written(operation: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "power": operation["power"],
        "feed": f"{operation['feed_mm_min']:g}mm/min",
        "passes": operation["passes"],
    }


def _drawable(material: Material) -> None:
    least = material.kerf_mm + MIN_STROKE_MM
    if material.perforation.cut_mm < least:
        raise ProfileError(
            f"With a kerf of {material.kerf_mm:g} mm, dashes of {material.perforation.cut_mm:g} mm "
            f"cannot be drawn; choose a cell with dashes of at least {least:g} mm."
        )
