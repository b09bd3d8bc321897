"""The serial ports of this computer, and the permissions that they need; nothing is sent to any."""

from __future__ import annotations

import getpass
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from miurafab.machine.transport import list_ports

GROUPS = ("dialout", "uucp")
"""The groups that own serial ports on Debian, Fedora and their kin, and on Arch."""


@dataclass(frozen=True)
class Port:
    """A serial port of this computer; ``trouble`` says why you cannot use it, if so."""

    device: str
    description: str
    trouble: str | None


def serial_ports() -> tuple[Port, ...]:
    """The serial ports of this computer."""
    return tuple(Port(device, text, _trouble(device)) for device, text in list_ports())


def no_port() -> str:
    """Why there may be no port, and what to do before one is plugged in."""
    there = "No serial port is found: plug the machine in, with a cable that carries data"
    if sys.platform != "linux":
        return f"{there}; an adapter may need the driver of its maker."
    group = next((name for name in GROUPS if _members(name) is not None), None)
    if group is None or os.geteuid() == 0 or _is_in(group):
        return f"{there}."
    return f"{there}; to open it, {_join(group)}."


def _trouble(device: str) -> str | None:
    path = Path(device)
    if not path.exists() or os.access(path, os.R_OK | os.W_OK):
        return None
    return f"you may not open it; {_join(_group(path))}"


def _group(path: Path) -> str:
    """The group of ``path``: its number where it has no name, as in a container."""
    try:
        return path.group()
    except KeyError:
        return str(path.stat().st_gid)


def _user() -> str | None:
    """The name of the user; in a container, users may have none."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # until and from Python 3.13
        return None


def _join(group: str) -> str:
    """How the user joins ``group``."""
    user = _user()
    if user is None or group.isdecimal():
        return f"it needs its group: run the container with --group-add {group}"
    if user in (_members(group) or ()):
        return f"you are in its group {group} from your next login on: log out and in again"
    return f"join its group: sudo usermod -aG {group} {user}, then log in again"


def _members(group: str) -> list[str] | None:
    """The users that are listed in ``group``; None where there is no such group."""
    import grp  # which Windows has not; there no port needs a group

    try:
        return grp.getgrnam(group).gr_mem
    except KeyError:
        return None


def _is_in(group: str) -> bool:
    """Whether this process runs with ``group``."""
    import grp

    return grp.getgrnam(group).gr_gid in (*os.getgroups(), os.getegid())
