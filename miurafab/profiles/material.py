"""A material in one strict TOML file: how to crease, cut and glue it.

Powers are fractions of the laser's full power, so that one file serves machines with different S
ranges; the machine profile turns them into S words.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from miurafab.display import Shown
from miurafab.files import AnyPath
from miurafab.options import (
    REQUIRED,
    Choice,
    Flag,
    Text,
    Whole,
    angle,
    feed,
    length,
    modulus,
    number,
    option,
)
from miurafab.profiles.shipped import find_profile
from miurafab.profiles.table import Table, read_toml

OPERATIONS = ("engrave", "score", "perforate", "cut")
"""The operations in the order in which a sheet is made; cuts, which loosen it, come last."""


CREASE_KINDS = ("mountain", "valley", "tab")
"""The kinds of crease, which may be made differently; ``tab`` is the fold of a tab."""

MODES = ("perforate", "score", "cut", "none")
KERF = length(0, 2)
"""The width of a cut, as it is written."""

MIN_HOLE_PATH_MM = 0.1
"""A beam and its controller make a dot of a circle with a smaller diameter (judged)."""

GRAINS = ("none", "x", "y")
"""The direction of the fibres of a sheet on the bed, if it has any."""

START_ENDS = ("bridge", "cut")
FITS = ("centre", "stretch_cut", "stretch_gap")


@dataclass(frozen=True)
class Perforation:
    """Dashes on a crease, lengths in mm."""

    cut_mm: float = option(length(0.05, 100), "Length of a burnt dash.", REQUIRED)
    gap_mm: float = option(length(0.05, 100), "Length left whole between dashes.", REQUIRED)
    end_bridge_mm: float = option(length(0, 20), "Left whole at both ends of a crease.", REQUIRED)
    min_end_mm: float = option(length(0, 100), "The shortest dash at a crease's end.", REQUIRED)
    start_end: str = option(
        Choice(START_ENDS),
        "What a crease begins and ends with: a bridge, or a cut right from the vertex.",
        START_ENDS[0],
    )
    fit: str = option(
        Choice(FITS),
        "What gives way so that the dashes fill the crease: the two end dashes (centre), all "
        "dashes (stretch_cut), or all gaps (stretch_gap).",
        FITS[0],
    )

    @property
    def bridge_mm(self) -> float:
        """What is left whole at both ends of a crease, in mm."""
        return self.end_bridge_mm if self.start_end == "bridge" else 0.0


@dataclass(frozen=True)
class Crease:
    """How the creases of one kind are made: perforated, scored, cut but for the bridges at their
    ends, or not at all; ``perforation`` is None where it is the material's own.
    """

    mode: str = "perforate"
    perforation: Perforation | None = None


def _all_perforated() -> dict[str, Crease]:
    return {kind: Crease() for kind in CREASE_KINDS}


@dataclass(frozen=True)
class TabRule:
    """Glue tabs."""

    height_mm: float = option(length(0.5, 100), "Height of a tab.", REQUIRED)
    inset_mm: float = option(
        length(0, 10), "Distance kept from the borders of the glued facet.", 0.3
    )
    max_angle: float = option(
        angle(5, 180), "Largest inner angle at the base of a tab.", math.radians(75)
    )
    min_area_mm2: float = option(
        number(0, 1e6, unit=" mm²"), "A note names each tab with less glue than this area.", 10.0
    )


@dataclass(frozen=True)
class Operation:
    """How one operation is made."""

    power: float = option(number(0, 1), "Fraction of the laser's full power.", REQUIRED)
    feed_mm_min: float = option(feed(), "Speed of the head.", REQUIRED)
    passes: int = option(Whole(1, 50), "How often each stroke is made.", 1)
    z_step_mm: float = option(
        length(0, 20), "How much lower the head is in each further pass; needs a Z axis.", 0.0
    )
    focus_mm: float = option(
        length(-50, 50),
        "Z of the head in the first pass, 0 being the height to which you focused; needs a Z axis.",
        0.0,
    )
    air: bool = option(
        Flag(), "Whether air is blown, on a machine with air assist; false switches it off.", True
    )

    @property
    def heights_mm(self) -> tuple[float, ...]:
        """Z in each pass."""
        return tuple(
            round(self.focus_mm - number * self.z_step_mm, 3) for number in range(self.passes)
        )


@dataclass(frozen=True, repr=False)
class Material(Shown):
    """One material on one class of laser.

    Attributes
    ----------
    name : str
        The stem of the file of the material.
    title : str
        What lists call the material.
    thickness_mm : float
        The thickness of the sheet.
    kerf_mm : float
        The width of the cut.
    max_power : float
        The most power that a job may use, as a fraction of full power.
    perforation : Perforation
        The dashes of creases that have none of their own, mm.
    tabs : TabRule
        The tabs that join patches, mm.
    operations : dict of str to Operation
        Power, feed, passes, heights and air of each operation.
    modulus_pa : float or None
        Young's modulus in bending, None where the file does not give it. Only energies in joules
        need it.
    creases : dict of str to Crease
        How each of :data:`CREASE_KINDS` is made.
    relief_hole_mm : float
        The diameter burnt out at a vertex, 0 for none.
    grain : {"none", "x", "y"}
        The direction of the grain.
    """

    name: str
    title: str
    thickness_mm: float
    kerf_mm: float
    max_power: float
    perforation: Perforation
    tabs: TabRule
    operations: dict[str, Operation]
    modulus_pa: float | None = None
    creases: dict[str, Crease] = field(default_factory=_all_perforated)
    relief_hole_mm: float = 0.0
    grain: str = "none"

    def perforation_of(self, kind: str) -> Perforation:
        """The dashes on creases of one kind."""
        return self.creases[kind].perforation or self.perforation


def load_material(name: AnyPath) -> Material:
    """Read a material.

    Parameters
    ----------
    name : str or os.PathLike
        A shipped name (:func:`list_materials` lists them) or a TOML file.

    Returns
    -------
    Material

    Raises
    ------
    ProfileError
        Naming the file, the key and what is accepted.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.load_material("card-250").thickness_mm
    0.3
    """
    path = find_profile("materials", name)
    table = Table(read_toml(path), path.name)
    max_power = table.value("max_power", number(0.01, 1), 1.0)
    kerf = table.value("kerf", KERF)
    perforation = table.table("perforation").options(Perforation)
    creases, relief_hole = _creases(table.table("creases", {}), perforation, kerf)
    material = Material(
        name=path.stem,
        title=table.value("title", Text()),
        thickness_mm=table.value("thickness", length(0.01, 20)),
        kerf_mm=kerf,
        max_power=max_power,
        perforation=perforation,
        tabs=table.table("tabs").options(TabRule),
        operations=_operations(table.table("operations"), max_power),
        modulus_pa=table.value("modulus", modulus(1e5, 1e12), None),
        creases=creases,
        relief_hole_mm=relief_hole,
        grain=table.value("grain", Choice(GRAINS), "none"),
    )
    table.finish()
    return material


def _creases(table: Table, usual: Perforation, kerf: float) -> tuple[dict[str, Crease], float]:
    """How each kind of crease is made, what it does not say being as ``usual``; and the diameter
    of relief holes in mm.
    """
    creases = {}
    for kind in CREASE_KINDS:
        entry = table.table(kind, {})
        mode = entry.value("mode", Choice(MODES), "perforate")
        own = entry.options(Perforation, usual)
        if mode == "cut" and own.bridge_mm == 0.0:
            raise entry.fault(
                "mode",
                "is 'cut' without bridges at the ends, which would part the sheet; give it "
                "start_end = 'bridge' and an end_bridge",
            )
        creases[kind] = Crease(mode, None if own == usual else own)
    hole = table.value("relief_hole", length(0, 20), 0.0)
    if 0.0 < hole < kerf + MIN_HOLE_PATH_MM:
        raise table.fault(
            "relief_hole",
            f"is {hole:g} mm; with a kerf of {kerf:g} mm it must be 0 or at least "
            f"{kerf + MIN_HOLE_PATH_MM:g} mm",
        )
    table.finish()
    return creases, hole


def _operations(table: Table, max_power: float) -> dict[str, Operation]:
    operations = {}
    for name in OPERATIONS:
        entry = table.table(name)
        operations[name] = made = entry.options(Operation)
        if made.power > max_power:
            raise entry.fault("power", f"is {made.power:g}; max_power allows {max_power:g} at most")
    table.finish()
    return operations
