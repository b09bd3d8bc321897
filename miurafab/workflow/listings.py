"""What there is to choose from: surfaces, machines and materials, each with a word on it."""

from __future__ import annotations

from miurafab.profiles import known_names, load_machine, load_material
from miurafab.surfaces.catalogue import CATALOGUE, NamedSurface


def list_surfaces() -> dict[str, str]:
    """List the built-in surfaces.

    Returns
    -------
    dict
        The name of each surface, with its parameters and their defaults (angles in degrees).

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.list_surfaces()["hypar"]
    'a hyperbolic paraboloid z = height x y, ruled along x and y (width=2, depth=2, height=0.5)'
    """
    return {name: f"{entry.summary} ({_defaults(entry)})" for name, entry in CATALOGUE.items()}


def _defaults(entry: NamedSurface) -> str:
    return ", ".join(f"{key}={each.default_text}" for key, each in entry.parameters.items())


def list_machines() -> dict[str, str]:
    """List the shipped machines.

    Returns
    -------
    dict
        The name of each machine, with its title.

    Examples
    --------
    >>> import miurafab as mf
    >>> "grbl-laser-400" in mf.list_machines()
    True
    """
    return {name: load_machine(name).title for name in known_names("firmware_profiles")}


def list_materials() -> dict[str, str]:
    """List the shipped materials.

    Returns
    -------
    dict
        The name of each material, with its title.

    Examples
    --------
    >>> import miurafab as mf
    >>> "card-250" in mf.list_materials()
    True
    """
    return {name: load_material(name).title for name in known_names("materials")}
