"""A material: how it is creased, cut and glued, as one strict TOML file.

Powers are fractions of the laser's full power, so that one material file serves machines with
different S ranges; the profile of the machine turns them into S words.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from miurafab.profiles.shipped import find_file
from miurafab.profiles.table import Table, read_toml

OPERATIONS = ("engrave", "score", "perforate", "cut")
"""The operations in the order they are made on a sheet: what loosens the sheet comes last."""


CREASE_KINDS = ("mountain", "valley", "tab")
"""The kinds of crease that may be made differently; the fold of a tab is of its own kind."""

MODES = ("perforate", "score", "cut", "none")
MIN_HOLE_PATH_MM = 0.1
"""A circle of a smaller diameter is a dot to a beam and its controller (judged)."""

GRAINS = ("none", "x", "y")
"""Which way the fibres of a sheet run as it lies on the bed, if any."""

START_ENDS = ("bridge", "cut")
FITS = ("centre", "stretch_cut", "stretch_gap")


@dataclass(frozen=True)
class Perforation:
    """Dashes on a crease, lengths in mm: ``cut`` burnt, ``gap`` left, ``end_bridge`` left whole
    at both crease ends, and no burnt end segment shorter than ``min_end``.

    ``start_end`` is what a crease begins and ends with: a ``bridge``, or a ``cut`` right from the
    vertex. ``fit`` says what gives way so that the dashes fill the crease: the two end dashes
    (``centre``), all dashes (``stretch_cut``), or all gaps (``stretch_gap``).
    """

    cut_mm: float
    gap_mm: float
    end_bridge_mm: float
    min_end_mm: float
    start_end: str = "bridge"
    fit: str = "centre"

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
    """Glue tabs: ``height`` in mm, and the ``inset`` kept from the borders of the glued facet.

    No inner angle at the base of a tab exceeds ``max_angle`` (rad), and one with less glue than
    ``min_area_mm2`` is told.
    """

    height_mm: float
    inset_mm: float
    max_angle: float = math.radians(75)
    min_area_mm2: float = 10.0


@dataclass(frozen=True)
class Operation:
    """How one operation is made: ``power`` in 0..1, ``feed_mm_min``, and ``passes``."""

    power: float
    feed_mm_min: float
    passes: int


@dataclass(frozen=True)
class Material:
    """One material on one class of laser.

    ``modulus_pa`` is Young's modulus in bending, None where the file does not give it: it is
    needed for energies in joules and for nothing else. ``creases`` holds all of
    :data:`CREASE_KINDS`; ``relief_hole_mm`` is the diameter burnt out at a vertex, 0 for none.
    ``grain`` is one of :data:`GRAINS`.
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


def load_material(name: str | Path) -> Material:
    """The material called ``name``: a shipped name or the path of a TOML file.

    Raises :class:`~miurafab.errors.ProfileError` naming the file, the key and what is accepted.
    """
    path = find_file("materials", str(name))
    table = Table(read_toml(path), path.name)
    thickness = table.length("thickness", low=0.01, high=20)
    max_power = table.number("max_power", 1.0, low=0.01, high=1)
    kerf = table.length("kerf", low=0, high=2)
    perforation = _perforation(table.table("perforation"))
    creases, relief_hole = _creases(table.table("creases", {}), perforation, kerf)
    material = Material(
        name=path.stem,
        title=table.text("title"),
        thickness_mm=thickness,
        kerf_mm=kerf,
        max_power=max_power,
        perforation=perforation,
        tabs=_tabs(table.table("tabs")),
        operations=_operations(table.table("operations"), max_power),
        modulus_pa=table.modulus("modulus", low=1e5, high=1e12) if table.has("modulus") else None,
        creases=creases,
        relief_hole_mm=relief_hole,
        grain=table.choice("grain", GRAINS, "none"),
    )
    table.finish()
    return material


def _perforation(table: Table) -> Perforation:
    perforation = Perforation(
        cut_mm=table.length("cut", low=0.05, high=100),
        gap_mm=table.length("gap", low=0.05, high=100),
        end_bridge_mm=table.length("end_bridge", low=0, high=20),
        min_end_mm=table.length("min_end", low=0, high=100),
        start_end=table.choice("start_end", START_ENDS, "bridge"),
        fit=table.choice("fit", FITS, "centre"),
    )
    table.finish()
    return perforation


def _creases(table: Table, usual: Perforation, kerf: float) -> tuple[dict[str, Crease], float]:
    """How each kind of crease is made, what it does not say being as ``usual``; and the diameter
    of relief holes in mm.
    """
    creases = {}
    for kind in CREASE_KINDS:
        entry = table.table(kind, {})
        mode = entry.choice("mode", MODES, "perforate")
        own = replace(
            usual,
            cut_mm=entry.length("cut", usual.cut_mm, low=0.05, high=100),
            gap_mm=entry.length("gap", usual.gap_mm, low=0.05, high=100),
            end_bridge_mm=entry.length("end_bridge", usual.end_bridge_mm, low=0, high=20),
            min_end_mm=entry.length("min_end", usual.min_end_mm, low=0, high=100),
            start_end=entry.choice("start_end", START_ENDS, usual.start_end),
            fit=entry.choice("fit", FITS, usual.fit),
        )
        if mode == "cut" and own.bridge_mm == 0.0:
            raise entry.fault(
                "mode",
                "is 'cut' without bridges at the ends, which would part the sheet; give it "
                "start_end = 'bridge' and an end_bridge",
            )
        entry.finish()
        creases[kind] = Crease(mode, None if own == usual else own)
    hole = table.length("relief_hole", 0.0, low=0, high=20)
    if 0.0 < hole < kerf + MIN_HOLE_PATH_MM:
        raise table.fault(
            "relief_hole",
            f"is {hole:g} mm; with a kerf of {kerf:g} mm it must be 0 or at least "
            f"{kerf + MIN_HOLE_PATH_MM:g} mm",
        )
    table.finish()
    return creases, hole


def _tabs(table: Table) -> TabRule:
    rule = TabRule(
        height_mm=table.length("height", low=0.5, high=100),
        inset_mm=table.length("inset", 0.3, low=0, high=10),
        max_angle=table.angle("max_angle", math.radians(75), low=0.1, high=math.pi),
        min_area_mm2=table.number("min_area", 10.0, low=0, high=1e6),
    )
    table.finish()
    return rule


def _operations(table: Table, max_power: float) -> dict[str, Operation]:
    operations = {}
    for name in OPERATIONS:
        entry = table.table(name)
        operations[name] = Operation(
            power=entry.number("power", low=0, high=max_power),
            feed_mm_min=entry.feed("feed", low=1, high=1e6),
            passes=entry.whole("passes", 1, low=1, high=50),
        )
        entry.finish()
    table.finish()
    return operations
