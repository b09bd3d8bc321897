"""What the ``$`` settings of a board tell of its machine: one table, read by profiles and files.

Numbers and meaning: gnea/grbl 1.1, ``doc/markdown/settings.md``. GRBL reports Z on every board, so
what it says of Z counts only where a profile has the axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from miurafab.options import Kind, Whole, declared, outside
from miurafab.profiles.machine import Bed, MachineProfile, MotionLimits, ZAxis


@dataclass(frozen=True)
class Place:
    """Where a setting stands: in a ``field`` of a ``part`` of the profile."""

    part: str
    field: str
    kind: Kind

    @property
    def key(self) -> str:
        """Its name in a file, where the table is called as the part."""
        return outside(self.field)


def _place(part: str, cls: type, name: str) -> Place:
    found = declared(cls)[name]
    return Place(part, found.field, found.kind)


PLACES = {
    11: _place("motion", MotionLimits, "junction_deviation"),
    30: Place("tool", "s_max", Whole()),
    31: Place("tool", "s_min", Whole()),
    110: _place("motion", MotionLimits, "max_rate_x"),
    111: _place("motion", MotionLimits, "max_rate_y"),
    112: _place("z", ZAxis, "max_rate"),
    120: _place("motion", MotionLimits, "acceleration_x"),
    121: _place("motion", MotionLimits, "acceleration_y"),
    122: _place("z", ZAxis, "acceleration"),
    130: _place("bed", Bed, "width"),
    131: _place("bed", Bed, "height"),
    132: _place("z", ZAxis, "travel"),
}
"""The place of each setting that a profile has one for."""


def told(values: Mapping[int, float], *, has_z: bool) -> Iterator[tuple[Place, Any]]:
    """The places of a profile that the settings ``values`` tell, with the values inside."""
    for number, place in PLACES.items():
        if number in values and (has_z or place.part != "z"):
            value = values[number]
            yield place, round(value) if isinstance(place.kind, Whole) else value


def settings_of(machine: MachineProfile) -> dict[int, float]:
    """The settings that the places of ``machine`` stand for."""
    parts = {number: getattr(machine, place.part) for number, place in PLACES.items()}
    return {
        number: getattr(part, PLACES[number].field)
        for number, part in parts.items()
        if part is not None
    }


def with_settings(machine: MachineProfile, values: Mapping[int, float]) -> MachineProfile:
    """``machine`` as a board with the settings ``values`` has it, which it then requires."""
    parts: dict[str, dict[str, Any]] = {}
    for place, value in told(values, has_z=machine.z is not None):
        parts.setdefault(place.part, {})[place.field] = value
    changed = {part: replace(getattr(machine, part), **fields) for part, fields in parts.items()}
    return replace(machine, settings={**machine.settings, **values}, **changed)
