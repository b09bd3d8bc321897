"""Findings on a material and the beam that works it: what was scaled, and what was left out.

Settings are scaled within one kind of beam alone (:meth:`BeamSettings.on`), and never in silence.
"""

from __future__ import annotations

from miurafab.findings import Finding
from miurafab.profiles import MachineProfile, Material
from miurafab.profiles.beam import BeamSettings, Laser


def beam_findings(machine: MachineProfile, material: Material) -> list[Finding]:
    """What a person should know of the settings of ``material`` on ``machine``."""
    entry, laser = material.beams[machine.tool.beam], machine.tool.laser
    if laser is not None:
        return _scaled(machine, material, entry, laser)
    found_on = entry.meant.forces_of
    if found_on is None or found_on == machine.name:
        return []
    sentence = (
        f"The forces of {material.name} were found on {found_on}; {machine.name} takes the s_down "
        "and s_shallow of its own profile. Try them with 'miurafab calibrate'."
    )
    return [Finding("other-forces", sentence)]


def _scaled(
    machine: MachineProfile, material: Material, entry: BeamSettings, laser: Laser
) -> list[Finding]:
    assert entry.meant.lasers is not None
    least, most = entry.meant.lasers
    slowed = entry.slowed(laser)
    if least <= laser.power <= most and not slowed:
        return []
    ways = "each operation keeps its power in watts"
    if slowed:
        used = entry.on(laser)
        feeds = ", ".join(f"{name} {used.operations[name].feed_mm_min:.3g}" for name in slowed)
        ways = f"what asks for more goes slower with the same energy per length ({feeds} mm/min)"
    span = f"{least:g} W" if least == most else f"{least:g} to {most:g} W"
    sentence = (
        f"The settings of {material.name} are meant for lasers of {span}, and {machine.name} has "
        f"{laser.power:g} W: {ways}. Cut a test sheet first, with 'miurafab calibrate'."
    )
    return [Finding("scaled", sentence)]
