"""Materials with changed operations, alike for every beam."""

from __future__ import annotations

from dataclasses import replace

from miurafab.profiles import Material


def changed(material: Material, **operations: dict[str, object]) -> Material:
    """``material`` with other fields of its ``operations``, for each beam that it has."""
    beams = {}
    for beam, entry in material.beams.items():
        made = {
            name: replace(each, **operations.get(name, {}))
            for name, each in entry.operations.items()
        }
        beams[beam] = replace(entry, operations=made)
    return replace(material, beams=beams)
