"""Machines and materials, read strictly from TOML."""

from miurafab.profiles.beam import OPERATIONS
from miurafab.profiles.machine import Knife, MachineProfile, load_machine, read_machine
from miurafab.profiles.material import GRAINS, Material, load_material, read_material
from miurafab.profiles.shipped import (
    DEFAULT_MACHINE,
    DEFAULT_MATERIAL,
    find_file,
    find_profile,
    known_names,
    shipped_directory,
    shipped_names,
)
from miurafab.profiles.table import Table, read_toml

__all__ = [
    "DEFAULT_MACHINE",
    "DEFAULT_MATERIAL",
    "GRAINS",
    "OPERATIONS",
    "Knife",
    "MachineProfile",
    "Material",
    "Table",
    "find_file",
    "find_profile",
    "known_names",
    "load_machine",
    "load_material",
    "read_machine",
    "read_material",
    "read_toml",
    "shipped_directory",
    "shipped_names",
]
