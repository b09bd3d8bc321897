"""miurafab: from a curved surface to a folded origami shell, cut on a real machine.

The verbs of the command line are functions here, over frozen dataclasses::

    import miurafab

    wanted = miurafab.design("hypar:height=0.5", facets="20x20", size="250mm")
    result = miurafab.fit(wanted.request)
    layout = miurafab.sheets(result.pattern, "grbl-laser-400", "card-250")
    miurafab.write_job(layout, "jobs/hypar")
    miurafab.cut("jobs/hypar", port="virtual")

Each name is imported when it is first used, so that ``import miurafab`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from miurafab.version import __version__

if TYPE_CHECKING:
    from miurafab.origami.fitting.fit import fit
    from miurafab.origami.folding.thick_panels import thick_panels
    from miurafab.origami.verify import audit as check
    from miurafab.posting import post
    from miurafab.profiles import load_machine, load_material
    from miurafab.workflow.calibrate import add_material, calibrate
    from miurafab.workflow.convert import convert, read_pattern
    from miurafab.workflow.cut import DEFAULT_MATERIAL, prepare
    from miurafab.workflow.cut_sheets import cut
    from miurafab.workflow.design import design, load_pattern, save_pattern
    from miurafab.workflow.doctor import examine
    from miurafab.workflow.energy import check_writable as check_energy_file
    from miurafab.workflow.energy import energy, write_energy
    from miurafab.workflow.fold import (
        check_motion_file,
        fold,
        thickness_report,
        write_angles,
        write_motion,
    )
    from miurafab.workflow.job_directory import (
        design_profiles,
        layout_options,
        read_job,
        sheets,
        write_job,
    )
    from miurafab.workflow.page import write_page
    from miurafab.workflow.picture import write_pictures
    from miurafab.workflow.preview import ASSUMED_MACHINE as DEFAULT_MACHINE
    from miurafab.workflow.preview import preview
    from miurafab.workflow.tradeoff import check_writable as check_tradeoff_file
    from miurafab.workflow.tradeoff import tradeoff, write_tradeoff

_HOMES = {
    "DEFAULT_MACHINE": ("miurafab.workflow.preview", "ASSUMED_MACHINE"),
    "DEFAULT_MATERIAL": ("miurafab.workflow.cut", "DEFAULT_MATERIAL"),
    "add_material": ("miurafab.workflow.calibrate", "add_material"),
    "calibrate": ("miurafab.workflow.calibrate", "calibrate"),
    "check": ("miurafab.origami.verify", "audit"),
    "check_energy_file": ("miurafab.workflow.energy", "check_writable"),
    "check_motion_file": ("miurafab.workflow.fold", "check_motion_file"),
    "check_tradeoff_file": ("miurafab.workflow.tradeoff", "check_writable"),
    "convert": ("miurafab.workflow.convert", "convert"),
    "cut": ("miurafab.workflow.cut_sheets", "cut"),
    "design": ("miurafab.workflow.design", "design"),
    "design_profiles": ("miurafab.workflow.job_directory", "design_profiles"),
    "energy": ("miurafab.workflow.energy", "energy"),
    "examine": ("miurafab.workflow.doctor", "examine"),
    "fit": ("miurafab.origami.fitting.fit", "fit"),
    "fold": ("miurafab.workflow.fold", "fold"),
    "load_machine": ("miurafab.profiles", "load_machine"),
    "layout_options": ("miurafab.workflow.job_directory", "layout_options"),
    "load_material": ("miurafab.profiles", "load_material"),
    "load_pattern": ("miurafab.workflow.design", "load_pattern"),
    "post": ("miurafab.posting", "post"),
    "prepare": ("miurafab.workflow.cut", "prepare"),
    "preview": ("miurafab.workflow.preview", "preview"),
    "read_job": ("miurafab.workflow.job_directory", "read_job"),
    "read_pattern": ("miurafab.workflow.convert", "read_pattern"),
    "save_pattern": ("miurafab.workflow.design", "save_pattern"),
    "sheets": ("miurafab.workflow.job_directory", "sheets"),
    "thick_panels": ("miurafab.origami.folding.thick_panels", "thick_panels"),
    "thickness_report": ("miurafab.workflow.fold", "thickness_report"),
    "tradeoff": ("miurafab.workflow.tradeoff", "tradeoff"),
    "write_angles": ("miurafab.workflow.fold", "write_angles"),
    "write_energy": ("miurafab.workflow.energy", "write_energy"),
    "write_job": ("miurafab.workflow.job_directory", "write_job"),
    "write_motion": ("miurafab.workflow.fold", "write_motion"),
    "write_tradeoff": ("miurafab.workflow.tradeoff", "write_tradeoff"),
    "write_page": ("miurafab.workflow.page", "write_page"),
    "write_pictures": ("miurafab.workflow.picture", "write_pictures"),
}

__all__ = [
    "DEFAULT_MACHINE",
    "DEFAULT_MATERIAL",
    "__version__",
    "add_material",
    "calibrate",
    "check",
    "check_energy_file",
    "check_motion_file",
    "check_tradeoff_file",
    "convert",
    "cut",
    "design",
    "design_profiles",
    "energy",
    "examine",
    "fit",
    "fold",
    "layout_options",
    "load_machine",
    "load_material",
    "load_pattern",
    "post",
    "prepare",
    "preview",
    "read_job",
    "read_pattern",
    "save_pattern",
    "sheets",
    "thick_panels",
    "thickness_report",
    "tradeoff",
    "write_angles",
    "write_energy",
    "write_job",
    "write_motion",
    "write_page",
    "write_pictures",
    "write_tradeoff",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'miurafab' has no attribute '{name}'")
    module, attribute = _HOMES[name]
    return getattr(importlib.import_module(module), attribute)


def __dir__() -> list[str]:
    return sorted(__all__)
