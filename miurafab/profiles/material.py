"""A material in one strict TOML file: how to crease, cut and glue it.

How it is worked stands once for each kind of beam (:mod:`miurafab.profiles.beam`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from miurafab.display import Shown
from miurafab.errors import ProfileError
from miurafab.files import AnyPath
from miurafab.options import (
    REQUIRED,
    Choice,
    Text,
    angle,
    length,
    modulus,
    number,
    option,
)
from miurafab.profiles.beam import (
    BEAMS,
    LASERS,
    OPERATIONS,
    BeamSettings,
    Meant,
    Operation,
)
from miurafab.profiles.machine import MachineProfile
from miurafab.profiles.shipped import find_profile
from miurafab.profiles.table import Table, read_toml

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
class CreaseStiffness:
    """How stiff a crease is that is not cut into, and where it yields; for forces in newtons."""

    crease_length_mm: float = option(
        length(0, 10_000, above=True),
        "The length of a strip of the flat sheet that is as stiff as the crease at its end: the "
        "bending stiffness over that of the crease.",
        REQUIRED,
    )
    yield_angle: float | None = option(
        angle(0, 180, above=True),
        "How far the crease turns from rest before its rest angle begins to move.",
        default_text="never yields",
    )
    hardening: float = option(
        number(0, 0.99), "The part of the stiffness that is left beyond that.", 0.1
    )


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


@dataclass(frozen=True, repr=False)
class Material(Shown):
    """One material.

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
    perforation : Perforation
        The dashes of creases that have none of their own, mm.
    tabs : TabRule
        The tabs that join patches, mm.
    beams : dict of str to BeamSettings
        How it is worked, for each kind of beam that it has settings for.
    modulus_pa : float or None
        Young's modulus in bending, None where the file does not give it. Only energies in joules
        and forces in newtons need it.
    folding : CreaseStiffness or None
        How stiff the creases are, None where the file does not give it. Only forces need it.
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
    perforation: Perforation
    tabs: TabRule
    beams: dict[str, BeamSettings]
    modulus_pa: float | None = None
    folding: CreaseStiffness | None = None
    creases: dict[str, Crease] = field(default_factory=_all_perforated)
    relief_hole_mm: float = 0.0
    grain: str = "none"

    def entry(self, machine: MachineProfile) -> BeamSettings | None:
        """What the file says for the beam of ``machine``, None for nothing."""
        found, laser = self.beams.get(machine.tool.beam), machine.tool.laser
        if found is None or laser is None:
            return found
        return found if laser.is_kind(found.beam, found.meant.wavelength) else None

    def on(self, machine: MachineProfile) -> BeamSettings:
        """How it is worked on ``machine``. Raises ``ProfileError`` if that has another beam."""
        found, tool = self.entry(machine), machine.tool
        if found is None:
            has = ", ".join(sorted(each.title for each in self.beams.values())) or "none"
            raise ProfileError(
                f"{self.name} has no settings for {tool.beam_title}, which {machine.name} is; it "
                f"has some for: {has}. Take another machine or material, or find settings with "
                "'miurafab calibrate' and a `power` and a `feed` to begin with."
            )
        if tool.laser is not None:
            return found.on(tool.laser)
        return found if found.meant.forces_of in (None, machine.name) else found.without_forces()

    def most_power(self, machine: MachineProfile) -> float:
        """The most power that a job may use, as a share of the full power of ``machine``."""
        most = self.on(machine).most_watts
        return 1.0 if most is None else machine.share(most)

    def worked_with(self, machine: MachineProfile, **operations: Operation) -> Material:
        """The same with other ``operations`` for the beam of ``machine``."""
        used = self.on(machine)
        made = replace(used, operations=used.operations | operations)
        return replace(self, beams={**self.beams, used.beam: made})

    def perforation_of(self, kind: str) -> Perforation:
        """The dashes on creases of one kind."""
        return self.creases[kind].perforation or self.perforation


def read_material(material: Material | AnyPath | None) -> Material:
    """``material`` itself, or the one that it names; for None the default material."""
    if isinstance(material, Material):
        return material
    return load_material(find_profile("materials", None) if material is None else material)


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
    if table.has("operations"):
        raise table.fault(
            "operations",
            "has no beam: power belongs to one kind of beam; put these tables below [beams.diode] "
            "(with lasers and wavelength), [beams.co2], [beams.knife] or [beams.pen], and write "
            'each power in watts: 0.8 of a 10 W laser is "8W"',
        )
    kerf = table.value("kerf", KERF)
    perforation = table.table("perforation").options(Perforation)
    creases, relief_hole = _creases(table.table("creases", {}), perforation, kerf)
    material = Material(
        name=path.stem,
        title=table.value("title", Text()),
        thickness_mm=table.value("thickness", length(0.01, 20)),
        kerf_mm=kerf,
        perforation=perforation,
        tabs=table.table("tabs").options(TabRule),
        beams=_beams(table.table("beams")),
        modulus_pa=table.value("modulus", modulus(1e5, 1e12), None),
        folding=table.table("folding").options(CreaseStiffness) if table.has("folding") else None,
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


def _beams(table: Table) -> dict[str, BeamSettings]:
    beams = {}
    for kind in BEAMS:
        if table.has(kind):
            beams[kind] = _settings(table.table(kind), kind)
    table.finish(BEAMS)
    return beams


def _settings(table: Table, kind: str) -> BeamSettings:
    operations: dict[str, Operation] = {}
    entries = table.table("operations")
    meant = table.options(Meant)
    if kind in LASERS and meant.lasers is None:
        raise table.fault("lasers", 'is missing: write the power of those meant, ["5W", "10W"]')
    if kind == "diode" and meant.wavelength is None:
        raise table.fault("wavelength", "is missing: write that of the diode in nm, as 450")
    settings = BeamSettings(kind, meant, operations)
    most = settings.most_watts
    for name in OPERATIONS:
        entry = entries.table(name)
        operations[name] = made = entry.options(Operation)
        if (made.power is None) is (kind in LASERS):
            complaint = (
                "is missing" if made.power is None else f"is for a laser, not {settings.title}"
            )
            raise entry.fault("power", complaint)
        if made.power is not None and most is not None and made.power > most:
            raise entry.fault("power", f"is {made.power:g} W; max_power allows {most:g} W at most")
        if made.force is not None and meant.forces_of is None:
            raise entry.fault(
                "force",
                "is an S value of one machine; name that machine as forces_of above the operations",
            )
    entries.finish()
    return settings
