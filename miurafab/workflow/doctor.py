"""What would stop a job on this computer, tried without sending a byte to any machine.

What is tried is what fails on real computers: each library is loaded, a plot is drawn, a browser is
looked for, the permissions of each serial port and of the folder of the user's own profiles are
read. Each problem ends with the command that mends it.
"""

from __future__ import annotations

import importlib.metadata
import io
import os
import platform
import shutil
import webbrowser
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from miurafab.display import Shown
from miurafab.errors import ProfileError
from miurafab.profiles import known_names, load_machine, load_material
from miurafab.profiles.own import configuration_folder
from miurafab.version import __version__
from miurafab.workflow.libraries import examined_libraries, not_installed, pip_install
from miurafab.workflow.ports import Port, no_port, serial_ports

ROOM_NEEDED_MB = 100
"""Free disk below which drawings, journal and transcript of a large job may not fit."""

EXTRAS = {
    "cluster": ("distributed", "tradeoff on a cluster"),
    "host": ("cryptography", "the studio for other computers"),
    "layers": ("python-sat", "the search for all layer orders"),
    "step": ("cascadio", "STEP files"),
}
"""What each extra brings, and what it is for."""


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
        What would stop a job, one sentence each with the command that mends it; empty if nothing
        would.
    notes : tuple of str
        What is missing and stops no job: extras, a browser, a port.
    """

    versions: dict[str, str]
    ports: tuple[Port, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def answer(self) -> dict[str, Any]:
        """The same, ready for JSON."""
        return {
            "versions": self.versions,
            "ports": [asdict(port) for port in self.ports],
            "problems": list(self.problems),
            "notes": list(self.notes),
        }


def doctor() -> Examination:
    """Try the installation, plots, the ports, the profiles, and the disk.

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
    problems, notes = [], []
    try:
        for name, version, trouble in examined_libraries():
            versions[name] = version
            problems += [trouble] if trouble else []
    except importlib.metadata.PackageNotFoundError:
        problems.append(not_installed())
    for extra, (name, purpose) in EXTRAS.items():
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            notes.append(
                f"{name}, for {purpose}, is not installed: {pip_install()} 'miurafab[{extra}]'"
            )
    problems += _plot_problems()
    ports = serial_ports()
    problems.extend(f"{port.device}: {port.trouble}." for port in ports if port.trouble)
    if not ports:
        notes.append(no_port())
    try:
        webbrowser.get()
    except webbrowser.Error:
        notes.append(
            "No browser is found: open the address that the studio prints by hand, or name a "
            "browser in the variable BROWSER."
        )
    problems += _folder_problems(configuration_folder())
    problems += _profile_problems()
    free = shutil.disk_usage(Path.cwd()).free // 1_000_000
    if free < ROOM_NEEDED_MB:
        problems.append(f"Only {free} MB are free on this disk; a job needs {ROOM_NEEDED_MB} MB.")
    return Examination(versions, ports, tuple(problems), tuple(notes))


def _plot_problems() -> list[str]:
    """What keeps a plot from being drawn."""
    try:
        from matplotlib.figure import Figure

        Figure((1, 1)).savefig(io.BytesIO(), format="png")
    except (ImportError, OSError, ValueError, RuntimeError) as fault:
        told = " ".join(str(fault).split())
        return [
            f"No plot is drawn ({told}); run {pip_install()} --force-reinstall matplotlib pillow."
        ]
    return []


def _folder_problems(folder: Path) -> list[str]:
    """What keeps the user's own profiles from being written to ``folder``."""
    there = next(each for each in (folder, *folder.parents) if each.exists())
    if not there.is_dir():
        return [
            f"{there} is a file, so your own profiles have no folder; run mv {there} {there}.old."
        ]
    if os.access(there, os.W_OK | os.X_OK):
        return []
    return [
        f"Your own profiles cannot be written to {folder}; run sudo chown -R $(id -u) {there}, or "
        "name another folder in XDG_CONFIG_HOME."
    ]


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
