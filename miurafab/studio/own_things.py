"""The machines and materials to choose from: the shipped ones and the person's own.

The person's own lie in the configuration folder (:mod:`miurafab.profiles.shipped`). They are looked
at anew each time, since they may be added while the studio is open. One that cannot be read is left
out, and told.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from miurafab.errors import MiurafabError
from miurafab.profiles import (
    DEFAULT_MACHINE,
    DEFAULT_MATERIAL,
    MachineProfile,
    Material,
    find_profile,
    known_names,
    load_machine,
    load_material,
)
from miurafab.profiles.shipped import Kind, own_directory


def own_things() -> dict[str, Any]:
    """``machines`` and ``materials``, each with ``name``, ``title`` and whether it is the person's
    ``own``; ``faults``, a sentence for each that cannot be read; ``machine`` and ``material``, the
    names to begin with.
    """
    faults: list[str] = []
    return {
        "machines": _listed("firmware_profiles", load_machine, faults),
        "materials": _listed("materials", load_material, faults),
        "faults": faults,
        "machine": _default("firmware_profiles", DEFAULT_MACHINE, faults),
        "material": _default("materials", DEFAULT_MATERIAL, faults),
    }


def _listed(
    kind: Kind, load: Callable[[str], MachineProfile | Material], faults: list[str]
) -> list[dict[str, Any]]:
    found = []
    for name in known_names(kind):
        try:
            title = load(name).title
        except MiurafabError as fault:
            faults.append(fault.sentence)
            continue
        own = (own_directory(kind) / f"{name}.toml").is_file()
        found.append({"name": name, "title": title, "own": own})
    return found


def _default(kind: Kind, usual: str, faults: list[str]) -> str:
    """The person's own default, if it is known by its name: the page chooses by name."""
    try:
        own = find_profile(kind, None).stem
    except MiurafabError as fault:  # it is there no more
        faults.append(fault.sentence)
        return usual
    return own if own in known_names(kind) else usual
