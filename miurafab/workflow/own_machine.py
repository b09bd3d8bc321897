"""A machine profile of one's own, from the settings of the board itself.

The nearest profile gives what ``$$`` does not tell (the tool, the buffers). The settings replace
what they tell (:mod:`miurafab.profiles.board`).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from miurafab.errors import InputError, OptionError, ProfileError
from miurafab.files import AnyPath, as_path, write_text
from miurafab.grbl.settings import Settings
from miurafab.machine.actions import read_dump, read_settings
from miurafab.options import read_options
from miurafab.profiles import MachineProfile, find_profile, load_machine, read_toml
from miurafab.profiles.beam import Laser
from miurafab.profiles.board import PLACES, told
from miurafab.profiles.shipped import own_directory
from miurafab.profiles.table import toml_text
from miurafab.simulate.grbl.controller import virtual_settings

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_LASER_MODE = 32
_ASKED_FOR = sorted((*(number for number, each in PLACES.items() if each.part != "z"), _LASER_MODE))
"""The settings that a job relies on; the profile then requires them."""


def add_machine(
    name: str,
    *,
    port: str | None = None,
    settings: AnyPath | None = None,
    like: AnyPath | None = None,
    title: str | None = None,
    baud: int | None = None,
    beam: str | None = None,
    power: float | str | None = None,
    wavelength: float | str | None = None,
) -> tuple[Path, MachineProfile]:
    """Write a machine profile into the configuration folder, where it is known by its name.

    Parameters
    ----------
    name : str
        What the machine is called. A profile is not overwritten.
    port : str, optional
        The port of the board, whose settings are read; or else
    settings : str or os.PathLike, optional
        A file with what ``$$`` printed.
    like : str or os.PathLike, optional
        The profile that gives what settings do not tell; the default machine without it.
    title : str, optional
        What lists call the machine.
    baud : int, optional
        The speed of the port, as the profile ``like`` says without it.
    beam : {"diode", "co2"}, optional
        The kind of a laser, which no setting tells; a laser needs it.
    power : float or str, optional
        The power of a laser's light at full S in watts, as its label says; a laser needs it.
    wavelength : float, optional
        The wavelength of a diode's light in nm; a diode needs it.

    Returns
    -------
    (Path, MachineProfile)

    Raises
    ------
    InputError
        For a name that cannot be one or is taken, and if neither or both sources are given.
    ProfileError
        Where the settings do not make a machine.
    MachineError
        If the board cannot be asked.

    Examples
    --------
    >>> import miurafab as mf
    >>> own = {"beam": "diode", "power": "5W", "wavelength": 450}
    >>> path, machine = mf.add_machine("my-laser", port="virtual", **own)
    >>> machine.tool.s_max
    1000
    """
    if not _NAME.fullmatch(name):
        raise InputError(f"'{name}' cannot name a machine; use letters, digits, '-' and '_'.")
    path = own_directory("firmware_profiles") / f"{name}.toml"
    if path.exists():
        raise InputError(f"{path} exists already; choose another name or remove it.")
    if (port is None) == (settings is None):
        raise InputError("Give the `port` of the board, or a file of its `settings`.")
    base = find_profile("firmware_profiles", like)
    values = read_toml(base)
    _state_beam(values["tool"], {"beam": beam, "power": power, "wavelength": wavelength})
    if port is None:
        assert settings is not None
        file = as_path(settings, "The settings")
        found, source = read_dump(file), file.name
    else:
        known = load_machine(base)
        speed = known.controller.baud if baud is None else baud
        # The machine in memory is one like the profile, and not a board fresh from its maker.
        found = read_settings(port, baud=speed, settings=virtual_settings(known))
        source = port
        values.setdefault("controller", {})["baud"] = speed
    _take(values, found)
    values["title"] = title or f"{name}, like {base.stem}"
    path.parent.mkdir(parents=True, exist_ok=True)
    head = f"# From the settings of the board ({source}); the rest is that of {base.stem}.\n"
    write_text(path, head + toml_text(values))
    try:
        return path, load_machine(path)
    except ProfileError:
        path.unlink()
        raise


def _state_beam(tool: dict[str, Any], given: dict[str, Any]) -> None:
    """Put what is ``given`` of a laser's beam in place of that of another machine."""
    given = {key: value for key, value in given.items() if value is not None}
    if tool.get("kind") != "laser":
        for key in given:
            raise OptionError(key, f"is for a laser, and this machine has a {tool.get('kind')}")
        return
    if "beam" not in given or "power" not in given:
        raise InputError(
            "Give the `beam` of the laser, diode or co2, and the `power` of its light, as its "
            "label says: no setting tells them, and materials have settings for one kind of "
            "beam, in watts."
        )
    if given["beam"] == "diode" and "wavelength" not in given:
        raise InputError("Give the `wavelength` of the diode in nm; common blue ones have 450.")
    made = read_options(Laser, given)
    for key in ("beam", "power", "wavelength"):
        tool.pop(key, None)
    tool |= {"beam": made.beam, "power": f"{made.power:g}W"}
    if made.wavelength is not None:
        tool["wavelength"] = made.wavelength


def _take(values: dict[str, Any], found: Settings) -> None:
    """Put what the settings tell into the ``values`` of a profile."""
    for place, value in told(found.values, has_z="z" in values):
        plain = place.kind.metavar in ("N", "NUMBER")
        written = value if plain else place.kind.show(value).replace(" ", "")
        values.setdefault(place.part, {})[place.key] = written
    required = values.setdefault("settings", {})
    required |= {f"${n}": found.values[n] for n in _ASKED_FOR if n in found.values}
    if values["tool"].get("kind") == "laser" and found.values.get(_LASER_MODE) == 0:
        required["$32"] = 1  # a laser burns along its travels without it, so `cut` asks for it
