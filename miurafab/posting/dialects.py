"""The words that switch and set the tool, for each dialect and kind of tool.

What they mean (gnea/grbl 1.1, doc/markdown/laser_mode.md and gcode.c; MarlinFirmware/Marlin,
gcode/control/M3-M5.cpp and gcode/gcode.cpp):

* ``M4 S0`` once arms the laser: in laser mode (``$32=1``) it burns during ``G1`` only, scaled by
  the speed, and is dark in every ``G0`` and whenever motion stops. Each ``M3``, ``M4`` or ``M5``
  stops the motion, so there is none between the strokes. grblHAL and FluidNC do the same.
* GRBL 0.9 has no laser mode: its spindle output stays on in ``G0``. There the beam is switched
  at both ends of each stroke, as a pen is lowered and lifted.
* A servo on the spindle output would be pulled up by laser mode in every ``G0``: pens and knives
  need ``$32=0``. ``G4`` waits until the servo has come to rest.
* Marlin takes the power with the moves after ``M4 I`` (scaled by the speed) or ``M3 I``. Its ``G0``
  sets it to 0, in some versions only if told so by ``S0``, and the next ``G1`` must say it again.
  ``G0`` and ``G1`` share one feed, so each says its own.
* ``M2`` waits for the last move, then sets spindle, coolant and modal state to their defaults.
  Marlin has no ``M2``, and needs no ``G17`` and ``G94``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from miurafab.errors import LayoutError, ProfileError
from miurafab.fabrication.toolpath import Toolpath
from miurafab.posting.text import trimmed
from miurafab.profiles import OPERATIONS, Knife, MachineProfile, Material
from miurafab.profiles.beam import SHALLOW, Operation

_LASER_MODE_IS_SETTING_32 = ("grbl-1.1", "grblhal")


@dataclass(frozen=True)
class Words:
    """The words that use the tool.

    ``begin`` and ``end``: the lines before and after all strokes. ``air``: what opens and what
    shuts the air, empty where there is none. ``travel``: what a stroke's
    ``G0`` says besides its place; ``down`` (by operation) and ``up``: what follows that ``G0``
    and the stroke's last ``G1``. ``s`` and ``feed``: the words of each operation, ``s`` None where
    ``down`` sets it; with ``restated`` every stroke says them. ``chains`` says whether the gap
    between two strokes may be a ``G1 S0`` as well as a ``G0``.
    """

    begin: tuple[str, ...]
    end: tuple[str, ...]
    down: tuple[str, ...]
    up: str
    s: tuple[int, ...] | None
    feed: tuple[str, ...]
    air: tuple[str, ...]
    travel: str = ""
    restated: bool = False
    chains: bool = False


def words_of(machine: MachineProfile, material: Material) -> Words:
    """The words with which ``machine`` makes the operations of ``material``.

    Raises :class:`~miurafab.errors.ProfileError` for a machine that G-code is not written for.
    """
    kind, dialect = machine.tool.kind, machine.dialect
    operations = material.on(machine).operations
    feed = tuple(trimmed(operations[name].feed_mm_min) for name in OPERATIONS)
    if kind == "laser":
        s = tuple(machine.power_to_s(operations[name].power or 0.0) for name in OPERATIONS)
        return _marlin(machine, s, feed) if dialect == "marlin" else _laser(machine, s, feed)
    if dialect == "marlin":
        raise ProfileError(
            f"{machine.name}: for marlin, G-code is written for a laser, not for a {kind}; choose "
            "another machine."
        )
    return _servo(machine, operations, feed)


def _air(machine: MachineProfile) -> tuple[str, ...]:
    return (machine.tool.air_word, "M9") if machine.tool.air_assist else ()


_MODES = ("M5", "G21", "G90", "G17", "G94")
_HOME = ("G0 X0 Y0", "M2")


def _laser(machine: MachineProfile, s: tuple[int, ...], feed: tuple[str, ...]) -> Words:
    tool = machine.tool
    air = _air(machine)
    end = ("M5", *air[1:], *_HOME)
    if machine.dialect == "grbl-0.9":
        if tool.beam_mode != "M3":
            raise ProfileError(
                f'{machine.name}: GRBL 0.9 has no M4 for lasers; write beam_mode = "M3" under '
                "[tool] if the beam may burn on wherever the job stops."
            )
        down = tuple(f"\nM3 S{value}" for value in s)
        return Words(_MODES, end, down, "\nM5", None, feed, air)
    if machine.dialect in _LASER_MODE_IS_SETTING_32 and machine.settings.get(32) != 1:
        raise ProfileError(
            f"{machine.name}: without laser mode the beam would burn along every travel; write "
            '"$32" = 1 under [settings].'
        )
    begin = (*_MODES, f"{tool.beam_mode} S0")
    return Words(begin, end, ("",) * len(feed), "", s, feed, air, chains=True)


def _marlin(machine: MachineProfile, s: tuple[int, ...], feed: tuple[str, ...]) -> Words:
    air = _air(machine)
    travel = f" S0 F{trimmed(min(machine.motion.max_rate_mm_min))}"
    begin = ("M5", "G21", "G90", f"{machine.tool.beam_mode} I S0")
    end = ("M5 I", "M5", *air[1:], f"G0 X0 Y0{travel}")
    return Words(begin, end, ("",) * len(feed), "", s, feed, air, travel=travel, restated=True)


def _servo(
    machine: MachineProfile, operations: Mapping[str, Operation], feed: tuple[str, ...]
) -> Words:
    tool = machine.tool
    if machine.settings.get(32, 0) != 0:
        raise ProfileError(
            f'{machine.name}: "$32" = {machine.settings[32]:g} lifts a servo {tool.kind} in every '
            'travel; write "$32" = 0 under [settings].'
        )
    air = _air(machine)
    settle = f"\nG4 P{trimmed(tool.settle_s)}" if tool.settle_s > 0 else ""
    up = f"M3 S{tool.s_up}{settle}"
    down = tuple(f"\nM3 S{depth(machine, name, operations[name])}{settle}" for name in OPERATIONS)
    return Words((*_MODES, up), ("M5", *air[1:], *_HOME), down, "\n" + up, None, feed, air)


def depth(machine: MachineProfile, name: str, operation: Operation) -> int:
    """The S of a pen or knife that is down for the ``operation`` of that ``name``."""
    return machine.tool.depth(name) if operation.force is None else operation.force


def made_by_knife(toolpath: Toolpath, knife: Knife, machine: MachineProfile) -> tuple[str, ...]:
    """The operations of ``toolpath`` that the profile of ``knife`` leaves out.

    Raises :class:`~miurafab.errors.LayoutError` for one that it would cut right through.
    """
    present = [OPERATIONS[code] for code in sorted(set(toolpath.operation.tolist()))]
    for name in present:
        if name in SHALLOW and knife.s_shallow is None and name not in knife.leave_out:
            raise LayoutError(
                f"{toolpath.sheet} has strokes to {name}, which the knife of {machine.name} would "
                f"cut right through; write s_shallow, a depth that only marks the sheet, or "
                f'leave_out = ["{name}"] under [tool].'
            )
    return tuple(name for name in present if name in knife.leave_out)
