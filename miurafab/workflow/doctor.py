"""What would stop a job on this computer, looked at without sending a byte to any machine."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from miurafab.display import Shown
from miurafab.errors import ProfileError
from miurafab.machine.transport import list_ports
from miurafab.profiles import known_names, load_machine, load_material
from miurafab.version import __version__

ROOM_NEEDED_MB = 100
"""Free disk below which drawings, journal and transcript of a large job may not fit."""


@dataclass(frozen=True)
class Port:
    """A serial port of this computer; ``trouble`` says why you cannot use it, if so."""

    device: str
    description: str
    trouble: str | None


@dataclass(frozen=True, repr=False)
class Examination(Shown):
    """What :func:`doctor` found on this computer.

    Attributes
    ----------
    versions : dict of str
        The version of miurafab, of Python and of each package that miurafab needs, or
        ``"missing"``, by name.
    ports : tuple of Port
        The serial ports: ``device``, ``description``, and ``trouble`` where you cannot use one.
    problems : tuple of str
        What would stop a job, one sentence each; empty if nothing would.
    """

    versions: dict[str, str]
    ports: tuple[Port, ...]
    problems: tuple[str, ...]

    def answer(self) -> dict[str, Any]:
        """The same, ready for JSON."""
        return {
            "versions": self.versions,
            "ports": [asdict(port) for port in self.ports],
            "problems": list(self.problems),
        }


def doctor() -> Examination:
    """Look at the installation, the ports, the shipped profiles, and the free disk.

    Returns
    -------
    Examination
        ``problems`` are sentences on what would stop a job; nothing is sent to any port.

    Examples
    --------
    >>> import miurafab as mf
    >>> "numpy" in mf.doctor().versions
    True
    """
    versions = {
        "miurafab": __version__,
        "python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
    }
    problems = []
    try:
        needed = importlib.metadata.requires("miurafab") or []
    except importlib.metadata.PackageNotFoundError:
        needed = []
        problems.append("miurafab runs from its source and is not installed; run pip install .")
    for name in _names(needed):
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "missing"
            problems.append(f"{name} is not installed; run pip install {name}.")
    ports = serial_ports()
    problems.extend(f"{port.device}: {port.trouble}." for port in ports if port.trouble)
    problems.extend(_profile_problems())
    free = shutil.disk_usage(Path.cwd()).free // 1_000_000
    if free < ROOM_NEEDED_MB:
        problems.append(f"Only {free} MB are free on this disk; a job needs {ROOM_NEEDED_MB} MB.")
    return Examination(versions, ports, tuple(problems))


def serial_ports() -> tuple[Port, ...]:
    """The serial ports of this computer."""
    return tuple(Port(device, text, _trouble(device)) for device, text in list_ports())


def _names(requirements: list[str]) -> list[str]:
    """The names in lines such as ``numpy>=2.1``, without those that only an extra asks for."""
    always = (line for line in requirements if "extra ==" not in line)
    return sorted({re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in always})


def _trouble(device: str) -> str | None:
    path = Path(device)
    if not path.exists() or os.access(path, os.R_OK | os.W_OK):
        return None
    return (
        "you may not open it; join the group that owns it "
        f"(on Linux: sudo usermod -aG dialout {os.environ.get('USER', 'NAME')}, then log in again)"
    )


def _profile_problems() -> list[str]:
    problems = []
    for name in known_names("firmware_profiles"):
        try:
            load_machine(name)
        except ProfileError as fault:
            problems.append(str(fault))
    for name in known_names("materials"):
        try:
            load_material(name)
        except ProfileError as fault:
            problems.append(str(fault))
    return problems
