"""What a tool makes of a material: its kerf, and its creases.

Only a beam takes away a kerf. A pen crosses the sheet without weakening it, so dashes that hold it
together serve nothing, and each costs two moves of the pen. So where the material does not say
otherwise, a pen draws a mountain as one line and a valley as long dashes, and the fold of a tab
like any other fold of its kind. A knife makes what the material says.
"""

from __future__ import annotations

from dataclasses import replace

from miurafab.profiles import MachineProfile, Material
from miurafab.profiles.material import Crease, Perforation

PEN_DASHES = Perforation(3.0, 1.5, 0.0, 0.5, "cut", "stretch_cut")
"""Long dashes, in mm: from 5.25 mm on a valley has two (judged on prints)."""

_PEN = {"mountain": Crease("score", PEN_DASHES), "valley": Crease("perforate", PEN_DASHES)}


def made_by(material: Material, machine: MachineProfile) -> Material:
    """``material`` as the tool of ``machine`` makes it."""
    kind = machine.tool.kind
    if kind == "laser":
        return material
    material = replace(material, kerf_mm=0.0)
    if kind != "pen":
        return material
    creases = {
        name: _PEN.get(name) if crease == Crease() else crease
        for name, crease in material.creases.items()
    }
    return replace(material, creases={n: crease for n, crease in creases.items() if crease})
