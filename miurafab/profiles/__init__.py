"""Machines and materials, read strictly from TOML."""

from miurafab.profiles.machine import Knife, MachineProfile, load_machine
from miurafab.profiles.material import GRAINS, OPERATIONS, Material, load_material
from miurafab.profiles.shipped import find_file, shipped_directory, shipped_names
from miurafab.profiles.table import Table, read_toml

__all__ = [
    "GRAINS",
    "OPERATIONS",
    "Knife",
    "MachineProfile",
    "Material",
    "Table",
    "find_file",
    "load_machine",
    "load_material",
    "read_toml",
    "shipped_directory",
    "shipped_names",
]
