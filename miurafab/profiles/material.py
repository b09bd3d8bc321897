"""A material: how it is creased, cut and glued, as one strict TOML file.

Powers are fractions of the laser's full power, so that one material file serves machines with
different S ranges; the profile of the machine turns them into S words.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from miurafab.profiles.shipped import find_file
from miurafab.profiles.table import Table, read_toml

OPERATIONS = ("engrave", "score", "perforate", "cut")
"""The operations in the order they are made on a sheet: what loosens the sheet comes last."""


@dataclass(frozen=True)
class Perforation:
    """Dashes on a crease, lengths in mm: ``cut`` burnt, ``gap`` left, ``end_bridge`` left whole
    at both crease ends, and no burnt end segment shorter than ``min_end``.
    """

    cut_mm: float
    gap_mm: float
    end_bridge_mm: float
    min_end_mm: float


@dataclass(frozen=True)
class TabRule:
    """Glue tabs: ``height`` in mm, and the ``inset`` kept from the borders of the glued facet."""

    height_mm: float
    inset_mm: float


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
    needed for energies in joules and for nothing else.
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


def load_material(name: str | Path) -> Material:
    """The material called ``name``: a shipped name or the path of a TOML file.

    Raises :class:`~miurafab.errors.ProfileError` naming the file, the key and what is accepted.
    """
    path = find_file("materials", str(name))
    table = Table(read_toml(path), path.name)
    thickness = table.length("thickness", low=0.01, high=20)
    max_power = table.number("max_power", 1.0, low=0.01, high=1)
    material = Material(
        name=path.stem,
        title=table.text("title"),
        thickness_mm=thickness,
        kerf_mm=table.length("kerf", low=0, high=2),
        max_power=max_power,
        perforation=_perforation(table.table("perforation")),
        tabs=_tabs(table.table("tabs")),
        operations=_operations(table.table("operations"), max_power),
        modulus_pa=table.modulus("modulus", low=1e5, high=1e12) if table.has("modulus") else None,
    )
    table.finish()
    return material


def _perforation(table: Table) -> Perforation:
    perforation = Perforation(
        cut_mm=table.length("cut", low=0.05, high=100),
        gap_mm=table.length("gap", low=0.05, high=100),
        end_bridge_mm=table.length("end_bridge", low=0, high=20),
        min_end_mm=table.length("min_end", low=0, high=100),
    )
    table.finish()
    return perforation


def _tabs(table: Table) -> TabRule:
    rule = TabRule(
        height_mm=table.length("height", low=0.5, high=100),
        inset_mm=table.length("inset", 0.3, low=0, high=10),
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
