"""Calibration: a sheet that tries settings out, and the material made of the ones chosen.

The sheet is a job directory like any other; ``calibration.json`` in it says what each label on it
stands for, so that a choice can be named by its label.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from miurafab.display import Shown
from miurafab.errors import OptionError
from miurafab.fabrication.beam_findings import beam_findings
from miurafab.fabrication.calibration import (
    SHEET,
    STRIPS,
    CalibrationSheet,
    calibration_sheet,
)
from miurafab.fabrication.calibration_ladder import begun
from miurafab.fabrication.drawing.calibration_guide import calibration_guide
from miurafab.fabrication.drawing.svg import sheet_svg
from miurafab.fabrication.layout import write_layout
from miurafab.fabrication.sheets import Layout, Sheet, Totals
from miurafab.files import (
    AnyPath,
    as_path,
    write_draft,
)
from miurafab.options import declared, read_value
from miurafab.options.verbs import verb
from miurafab.origami.formats.fold import fold_text
from miurafab.posting.sections import post_sections
from miurafab.profiles import (
    MachineProfile,
    Material,
    find_profile,
    load_machine,
    load_material,
    read_toml,
)
from miurafab.profiles.beam import Operation
from miurafab.profiles.shipped import Kind
from miurafab.profiles.table import toml_text
from miurafab.workflow.dry_run import dry_run
from miurafab.workflow.job_directory import JobDirectory
from miurafab.workflow.job_files import job_files, keep_profiles
from miurafab.workflow.manifest import LAYOUT, write_manifest

CHOICES = "calibration.json"
GUIDE = "calibration.pdf"
SCHEMA = "miurafab-calibration/2"
_COUPON = "coupon.fold"


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
    *,
    power: float | str | None = None,
    feed: float | str | None = None,
) -> Calibration:
    """Write the job directory of a test sheet: dashes against settings, scores, kerf, a coupon.

    Parameters
    ----------
    directory : str or os.PathLike
        The job directory. It is made if need be.
    machine : str or os.PathLike, optional
        A shipped name or a TOML file, grbl-laser-400 by default.
    material : str or os.PathLike, optional
        The material to begin with: a shipped name or a TOML file, card-250 by default.
    power : float or str, optional
        The power of a cut to begin with, in watts, where the material has no settings for the
        beam of the machine.
    feed : float or str, optional
        The feed of that cut, mm/min.

    Returns
    -------
    Calibration

    Raises
    ------
    ProfileError
        For a material without settings for the machine's beam.
    OptionError
        For a power or feed that is missing, or given where the material has settings.
    LayoutError
        For a bed that is too small.
    InputError
        For a directory that holds something else.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.calibrate("test-sheet", material="card-250")
    <Calibration test-sheet: 28 flaps, 6 squares>
    """
    directory = as_path(directory, "The job directory")
    machine_file = find_profile("firmware_profiles", machine)
    material_file = find_profile("materials", material)
    profile, stock = load_machine(machine_file), load_material(material_file)
    own_text = None
    if stock.entry(profile) is None or not (power is None and feed is None):
        stock, own_text = _begun(profile, stock, material_file, power, feed)
    sheet = calibration_sheet(profile, stock)
    toolpath = sheet.toolpath
    job = post_sections(sheet.sections, profile, patch_labels=sheet.labels)
    with job_files(directory) as staging:
        if own_text is not None:
            material_file = staging / f"{stock.name}.toml"
            write_draft(material_file, own_text)
        keep_profiles(machine_file, material_file, directory, staging)
        size = (sheet.width_mm, sheet.height_mm)
        timed = dry_run(SHEET, job, profile, size, stock.most_power(profile))
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
            "beam": profile.tool.beam,
            "power": None if profile.tool.laser is None else profile.tool.laser.power,
            "wavelength": None if profile.tool.laser is None else profile.tool.laser.wavelength,
            "cells": [dataclasses.asdict(cell) for cell in sheet.cells],
            "scores": [dataclasses.asdict(score) for score in sheet.scores],
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
            findings=tuple(beam_findings(profile, stock)),
        )
        digest = hashlib.sha256(coupon.encode("utf-8")).hexdigest()
        write_draft(staging / LAYOUT, write_layout(layout, _COUPON, digest))
        profiles: dict[Kind, Path] = {
            "firmware_profiles": machine_file,
            "materials": material_file,
        }
        write_manifest(staging, (), {}, profiles)
    made = JobDirectory(directory, layout, profile, stock.most_power(profile), (job,), (timed,))
    return Calibration(made, sheet)


def _begun(
    machine: MachineProfile,
    material: Material,
    file: Path,
    power: float | str | None,
    feed: float | str | None,
) -> tuple[Material, str]:
    """``material`` with settings for the beam of ``machine`` alone, which it had none for, and the
    text of its file.
    """
    if material.entry(machine) is not None:
        given = "power" if feed is None else "feed"
        raise OptionError(
            given,
            f"is for a material without settings for {machine.tool.beam_title}; "
            f"{material.name} has some: leave it out",
        )
    kinds = {each: declared(Operation)[each].kind for each in ("power", "feed")}
    if power is None and feed is None:
        material.on(machine)
    settings = begun(
        material,
        machine,
        None if power is None else read_value("power", kinds["power"], power),
        None if feed is None else read_value("feed", kinds["feed"], feed),
    )
    values = read_toml(file)
    table: dict[str, Any] = {}
    if settings.meant.lasers is not None:
        table["lasers"] = [f"{watts:g}W" for watts in settings.meant.lasers]
        table["max_power"] = f"{settings.most_watts:g}W"
    if settings.meant.wavelength is not None:
        table["wavelength"] = settings.meant.wavelength
    operations = {name: dataclasses.asdict(each) for name, each in settings.operations.items()}
    table["operations"] = {name: written_operation(each) for name, each in operations.items()}
    values["beams"] = {settings.beam: table}
    name = f"{material.name}-{settings.beam}"
    made = dataclasses.replace(material, name=name, beams={settings.beam: settings})
    return made, f"# {material.name}, to begin with on {machine.name}.\n" + toml_text(values)


def written_operation(operation: Mapping[str, Any]) -> dict[str, Any]:
    """An operation, as its fields, as a material file has it."""
    strength: dict[str, Any] = {}
    if operation["power"] is not None:
        strength["power"] = f"{operation['power']:g}W"
    if operation["force"] is not None:
        strength["force"] = operation["force"]
    return {
        **strength,
        "feed": f"{operation['feed_mm_min']:g}mm/min",
        "passes": operation["passes"],
    }
