"""What a calibration sheet tries: dashes from stiff to soft, settings from little energy to much.

A laser is tried at several powers and feeds, by energy per length; a pen or knife at several forces
(the S of its servo above the lifted position, the force of HPGL). The settings of the material
itself are always among them.
"""

from __future__ import annotations

import math
from dataclasses import replace

from miurafab.errors import OptionError, ProfileError
from miurafab.fabrication.perforation import MIN_STROKE_MM
from miurafab.profiles import OPERATIONS, MachineProfile, Material
from miurafab.profiles.beam import BeamSettings, Meant, Operation
from miurafab.profiles.material import Perforation

DASHES = ((0.7, 1.3), (1.0, 1.0), (1.4, 1.0), (1.8, 0.8))
"""The rows: dash and gap over the material's, from stiff to soft."""
POWERS = (0.7, 1.0, 1.3)
FEEDS = (1.0, 1.6)
"""The columns of a laser: power and feed over the material's, within the limits of both."""
FORCES = (0.7, 0.85, 1.0, 1.15, 1.3)
"""The columns of a pen or knife: its force over that of the material or the machine."""

_BEGUN = {"engrave": (0.2, 3.0), "score": (0.3, 2.5), "perforate": (0.85, 1.5), "cut": (1.0, 1.0)}
"""Power and feed over those of the cut where a material begins: the middle of the shipped entries
for lasers, which lie at 0.19 to 0.27 and 2.2 to 5 (engrave), 0.3 to 0.4 and 2 to 2.7 (score), and
0.83 to 0.88 and 1.3 to 1.7 (perforate).
"""
_MOST = 1.3
"""The most power of an entry that is begun, over that of its cut: the last of :data:`POWERS`."""


def begun(
    material: Material, machine: MachineProfile, power: float | None, feed_mm_min: float | None
) -> BeamSettings:
    """Settings to begin with on ``machine``, for which ``material`` has none: a person's ``power``
    in watts (of a laser) and feed of the cut, and what follows from them for the rest.

    Raises :class:`~miurafab.errors.OptionError` for a number that is missing or not wanted.
    """
    tool = machine.tool
    laser = tool.laser
    if feed_mm_min is None:
        raise OptionError("feed", "is missing; give that of a cut to begin with")
    if laser is None:
        if power is not None:
            raise OptionError("power", f"is for a laser, and {machine.name} is {tool.beam_title}")
        operations = {name: Operation(feed_mm_min * _BEGUN[name][1]) for name in OPERATIONS}
        return BeamSettings(tool.beam, Meant(), operations)
    if power is None:
        raise OptionError("power", "is missing; give that of a cut to begin with, in watts")
    if power > laser.power:
        raise OptionError("power", f"is {power:g} W; {machine.name} has {laser.power:g} W")
    operations = {
        name: Operation(feed_mm_min * faster, round(power * weaker, 3))
        for name, (weaker, faster) in _BEGUN.items()
    }
    most = min(round(power * _MOST, 3), laser.power)
    meant = Meant((laser.power, laser.power), most, laser.wavelength)
    return BeamSettings(tool.beam, meant, operations)


def tried_on(material: Material, machine: MachineProfile) -> Material:
    """``material`` as ``machine`` tries it: with a kerf only under a beam, and with the forces of
    that machine.
    """
    used = material.on(machine)
    if machine.tool.laser is not None:
        return material
    pressed = {
        name: each if each.force is not None else replace(each, force=machine.tool.depth(name))
        for name, each in used.operations.items()
    }
    own = BeamSettings(used.beam, replace(used.meant, forces_of=machine.name), pressed)
    return replace(material, kerf_mm=0.0, beams={**material.beams, used.beam: own})


def dashes(material: Material) -> list[Perforation]:
    """The rows."""
    usual = material.perforation
    least = material.kerf_mm + MIN_STROKE_MM
    found: dict[tuple[float, float], Perforation] = {}
    for dash, gap in DASHES:
        cut = max(_scaled(usual.cut_mm, dash), math.ceil(least * 20 - 1e-9) / 20)
        left = max(_scaled(usual.gap_mm, gap), 0.05)
        rule = replace(usual, cut_mm=cut, gap_mm=left, min_end_mm=min(usual.min_end_mm, cut))
        found.setdefault((cut, left), rule)
    return list(found.values())


def _scaled(length: float, factor: float) -> float:
    """A length times ``factor``, rounded to 0.05 mm; unchanged if the factor is 1."""
    return length if factor == 1.0 else round(round(length * factor * 20) / 20, 2)


def columns(material: Material, machine: MachineProfile, name: str) -> list[Operation]:
    """The columns of the operation ``name`` of a material as :func:`tried_on` gives it, the least
    energy or force first.
    """
    entry = material.on(machine)
    usual = entry.operations[name]
    if usual.power is None:
        assert usual.force is not None
        return _forces(machine, usual, usual.force)
    assert entry.most_watts is not None
    most = min(entry.most_watts, machine.tool.laser.power if machine.tool.laser else 0.0)
    fastest = min(machine.motion.max_rate_mm_min)
    powers = dict.fromkeys(
        min(usual.power if factor == 1.0 else round(usual.power * factor, 2), most)
        for factor in POWERS
    )
    feeds = dict.fromkeys(
        min(
            usual.feed_mm_min if factor == 1.0 else float(f"{usual.feed_mm_min * factor:.3g}"),
            fastest,
        )
        for factor in FEEDS
    )
    found = [replace(usual, power=power, feed_mm_min=feed) for power in powers for feed in feeds]
    return sorted(found, key=lambda each: (each.energy_j_mm, each.power or 0.0))


def _forces(machine: MachineProfile, usual: Operation, depth: int) -> list[Operation]:
    tool = machine.tool
    lifted = 0 if machine.dialect == "hpgl" else tool.s_up
    tried = dict.fromkeys(
        min(max(round(lifted + factor * (depth - lifted)), 0), tool.s_max) for factor in FORCES
    )
    if len(tried) < 2:
        raise ProfileError(
            f"{machine.name}: its tool is lifted at S{lifted} and down at S{depth}, which leaves "
            "no forces to try; write s_up and s_down under [tool]."
        )
    return [replace(usual, force=force) for force in tried]
