"""miurafab: from a curved surface to a folded origami shell, cut on a real machine.

The verbs of the command line are functions here, over values, paths and objects alike. Lengths are
in mm and angles in degrees::

    import miurafab as mf

    sheet = mf.fit("hypar", height=0.5, facets=(20, 20), size=250)
    sheet.pattern.save("hypar.fold")
    mf.fold(sheet).save("hypar.gif")
    job = mf.sheets(sheet, machine="grbl-laser-400", material="card-250")
    job.write("jobs/hypar")
    mf.preview(job)
    mf.cut("jobs/hypar", port="virtual")

A mistake in what you give is one of the exceptions below :class:`MiurafabError`, whose message is
one sentence. A fit that finds no sheet is a result with advice.

Each name is imported when it is first used, so that ``import miurafab`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from miurafab.version import __version__ as __version__

# The one list of public names. Editors and type checkers read it as imports; at run time
# `_homes` reads the same lines as text, and `__getattr__` imports a name when it is asked for.
if TYPE_CHECKING:
    from miurafab.errors import ControllerError as ControllerError
    from miurafab.errors import GcodeError as GcodeError
    from miurafab.errors import InputError as InputError
    from miurafab.errors import JobStopped as JobStopped
    from miurafab.errors import LayoutError as LayoutError
    from miurafab.errors import MachineError as MachineError
    from miurafab.errors import MiurafabError as MiurafabError
    from miurafab.errors import OptionError as OptionError
    from miurafab.errors import PatternError as PatternError
    from miurafab.errors import PortError as PortError
    from miurafab.errors import ProfileError as ProfileError
    from miurafab.errors import TargetError as TargetError
    from miurafab.errors import UnitError as UnitError
    from miurafab.fabrication.options import LayoutOptions as LayoutOptions
    from miurafab.fabrication.sheets import DrawnLayout as DrawnLayout
    from miurafab.fabrication.sheets import Layout as Layout
    from miurafab.findings import Finding as Finding
    from miurafab.origami.crease_pattern import CreasePattern as CreasePattern
    from miurafab.origami.energy.curve import EnergyCurve as EnergyCurve
    from miurafab.origami.energy.pieces import PieceEnergies as PieceEnergies
    from miurafab.origami.energy.pull import PullCurve as PullCurve
    from miurafab.origami.fitting.request import FitOptions as FitOptions
    from miurafab.origami.fitting.request import FitRequest as FitRequest
    from miurafab.origami.fitting.result import FitResult as FitResult
    from miurafab.origami.folding.kinematics import FoldingMotion as FoldingMotion
    from miurafab.origami.folding.plates import ThickPlates as ThickPlates
    from miurafab.origami.folding.thick_panels import ThickPanels as ThickPanels
    from miurafab.origami.formats.files import load as load
    from miurafab.origami.tradeoff import Tradeoff as Tradeoff
    from miurafab.origami.verify import Audit as Audit
    from miurafab.origami.verify import Measurements as Measurements
    from miurafab.profiles import MachineProfile as MachineProfile
    from miurafab.profiles import Material as Material
    from miurafab.profiles import load_machine as load_machine
    from miurafab.profiles import load_material as load_material
    from miurafab.workflow.calibrate import Calibration as Calibration
    from miurafab.workflow.calibrate import calibrate as calibrate
    from miurafab.workflow.check_job import JobCheck as JobCheck
    from miurafab.workflow.check_job import check_job as check_job
    from miurafab.workflow.convert import Conversion as Conversion
    from miurafab.workflow.convert import convert as convert
    from miurafab.workflow.cut_options import CutOptions as CutOptions
    from miurafab.workflow.cut_sheets import CutSheet as CutSheet
    from miurafab.workflow.cut_sheets import cut as cut
    from miurafab.workflow.design import Design as Design
    from miurafab.workflow.design import design as design
    from miurafab.workflow.doctor import Examination as Examination
    from miurafab.workflow.doctor import doctor as doctor
    from miurafab.workflow.dry_run import SheetPreview as SheetPreview
    from miurafab.workflow.energy import energy as energy
    from miurafab.workflow.fit import fit as fit
    from miurafab.workflow.fold import fold as fold
    from miurafab.workflow.folding import Folding as Folding
    from miurafab.workflow.job_directory import JobDirectory as JobDirectory
    from miurafab.workflow.job_directory import read_job as read_job
    from miurafab.workflow.layers import Layers as Layers
    from miurafab.workflow.layers import layers as layers
    from miurafab.workflow.listings import list_machines as list_machines
    from miurafab.workflow.listings import list_materials as list_materials
    from miurafab.workflow.listings import list_surfaces as list_surfaces
    from miurafab.workflow.own_machine import add_machine as add_machine
    from miurafab.workflow.own_material import add_material as add_material
    from miurafab.workflow.panels import thick_panels as thick_panels
    from miurafab.workflow.patterns import check as check
    from miurafab.workflow.preview import Preview as Preview
    from miurafab.workflow.preview import preview as preview
    from miurafab.workflow.quicker import QuickerWay as QuickerWay
    from miurafab.workflow.rebuild import Rebuilt as Rebuilt
    from miurafab.workflow.rebuild import rebuild as rebuild
    from miurafab.workflow.sheet_job import SheetJob as SheetJob
    from miurafab.workflow.sheets import sheets as sheets
    from miurafab.workflow.tradeoff import tradeoff as tradeoff


def _homes() -> dict[str, str]:
    """The module of each public name, from the lines ``from MODULE import NAME as NAME`` above."""
    # A package that is imported has a spec, and its loader has the source.
    source = __spec__.loader.get_source(__name__)  # type: ignore[union-attr]
    lines = (line.split() for line in source.splitlines() if line.startswith("    from miurafab"))
    return {words[3]: words[1] for words in lines}


_HOMES = _homes()
__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'miurafab' has no attribute '{name}'")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
