"""A machine: what its bed, motion, beam and controller can do, as one strict TOML file.

The limits of the ranges below are those of the firmware or of physics, not of taste: they are
there to catch a wrong unit (a 40 m bed) and not to forbid an unusual machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from miurafab.profiles.material import OPERATIONS
from miurafab.profiles.shipped import find_file
from miurafab.profiles.table import Table, read_toml

DIALECTS = ("grbl-1.1", "grbl-0.9", "grblhal", "fluidnc", "marlin", "hpgl")
TOOLS = ("laser", "pen", "knife")
STREAMING = ("character-counting", "send-response")
FLOW_CONTROL = ("none", "xon-xoff", "rts-cts")


@dataclass(frozen=True)
class Bed:
    """The usable work area: ``width_mm`` along X, ``height_mm`` along Y, and the margin kept."""

    width_mm: float
    height_mm: float
    margin_mm: float


@dataclass(frozen=True)
class MotionLimits:
    """What the firmware's planner is set to: rates in mm/min, accelerations in mm/s²."""

    max_rate_mm_min: tuple[float, float]
    acceleration_mm_s2: tuple[float, float]
    junction_deviation_mm: float


@dataclass(frozen=True)
class Knife:
    """A blade that trails behind the axis of its holder, as the wheel of a caster does.

    ``offset_mm`` is how far its tip trails, 0 where the machine corrects for that itself.
    At a corner that turns by more than ``corner_angle`` (rad) the blade is swivelled about its tip.
    A closed outline is cut on over its beginning by ``overcut_mm``. ``s_shallow`` is the S of a
    depth that marks the sheet and does not part it, for scores and engravings; None if there is
    no such depth. ``leave_out`` are the operations that this knife is not asked to make.
    """

    offset_mm: float
    corner_angle: float
    overcut_mm: float
    s_shallow: int | None
    leave_out: tuple[str, ...]


@dataclass(frozen=True)
class Tool:
    """What marks the sheet. S values run from ``s_min`` to ``s_max`` (``$31``, ``$30``).

    ``beam_mode`` is the word that arms a laser: M4 scales the power with the speed and goes dark
    whenever motion stops; M3 keeps burning and must be allowed explicitly.
    For a pen or knife ``s_down`` and ``s_up`` are the servo positions and ``settle_s`` the time
    each takes; on an HPGL machine ``s_down`` is the force of its ``FS`` instruction.
    """

    kind: str
    s_min: int
    s_max: int
    beam_mode: str
    air_assist: bool
    s_down: int
    s_up: int
    settle_s: float
    knife: Knife | None = None


@dataclass(frozen=True)
class Controller:
    """How to talk to it: ``rx_bytes`` usable receive buffer, ``line_chars`` usable line length.

    ``flow_control`` is how a machine that answers nothing holds up its sender.
    """

    baud: int
    streaming: str
    rx_bytes: int
    line_chars: int
    planner_blocks: int
    flow_control: str = "none"


@dataclass(frozen=True)
class MachineProfile:
    """One machine class.

    ``settings`` are the controller settings a job expects, ``{30: 1000.0}`` for ``$30=1000``.
    """

    name: str
    title: str
    dialect: str
    bed: Bed
    motion: MotionLimits
    tool: Tool
    controller: Controller
    settings: dict[int, float]

    @property
    def job_suffix(self) -> str:
        """How the name of a file for this machine ends."""
        return ".plt" if self.dialect == "hpgl" else ".nc"

    def power_to_s(self, fraction: float) -> int:
        """The S word for a power ``fraction`` (0 to 1) of the laser's full power."""
        tool = self.tool
        return round(tool.s_min + fraction * (tool.s_max - tool.s_min)) if fraction > 0 else 0


def load_machine(name: str | Path) -> MachineProfile:
    """The machine profile called ``name``: a shipped name or the path of a TOML file.

    Raises :class:`~miurafab.errors.ProfileError` naming the file, the key and what is accepted.
    """
    path = find_file("firmware_profiles", str(name))
    table = Table(read_toml(path), path.name)
    profile = MachineProfile(
        name=path.stem,
        title=table.text("title"),
        dialect=table.choice("dialect", DIALECTS),
        bed=_bed(table.table("bed")),
        motion=_motion(table.table("motion")),
        tool=_tool(table.table("tool")),
        controller=_controller(table.table("controller")),
        settings=_settings(table.table("settings", {})),
    )
    table.finish()
    return profile


def _bed(table: Table) -> Bed:
    bed = Bed(
        width_mm=table.length("width", low=10, high=20_000),
        height_mm=table.length("height", low=10, high=20_000),
        margin_mm=table.length("margin", 5.0, low=0, high=500),
    )
    table.finish()
    if 2 * bed.margin_mm >= min(bed.width_mm, bed.height_mm):
        raise table.fault("margin", "leaves nothing of the bed")
    return bed


def _motion(table: Table) -> MotionLimits:
    motion = MotionLimits(
        max_rate_mm_min=(
            table.feed("max_rate_x", low=1, high=1e6),
            table.feed("max_rate_y", low=1, high=1e6),
        ),
        acceleration_mm_s2=(
            table.number("acceleration_x", low=1, high=1e5),
            table.number("acceleration_y", low=1, high=1e5),
        ),
        junction_deviation_mm=table.length("junction_deviation", 0.01, low=0, high=1),
    )
    table.finish()
    return motion


def _tool(table: Table) -> Tool:
    kind = table.choice("kind", TOOLS)
    s_max = table.whole("s_max", 1000, low=1, high=100_000)
    tool = Tool(
        kind=kind,
        s_min=table.whole("s_min", 0, low=0, high=s_max),
        s_max=s_max,
        beam_mode=table.choice("beam_mode", ("M4", "M3"), "M4" if kind == "laser" else "M3"),
        air_assist=table.flag("air_assist", False),
        s_down=table.whole("s_down", s_max, low=0, high=s_max),
        s_up=table.whole("s_up", 0, low=0, high=s_max),
        settle_s=table.number("settle", 0.0, low=0, high=10),
        knife=_knife(table, s_max) if kind == "knife" else None,
    )
    table.finish()
    return tool


def _knife(table: Table, s_max: int) -> Knife:
    return Knife(
        offset_mm=table.length("offset", low=0, high=5),
        corner_angle=table.angle("corner_angle", math.radians(20), low=0.02, high=math.pi),
        overcut_mm=table.length("overcut", 0.0, low=0, high=20),
        s_shallow=table.whole("s_shallow", low=0, high=s_max) if table.has("s_shallow") else None,
        leave_out=table.choices("leave_out", OPERATIONS, ()),
    )


def _controller(table: Table) -> Controller:
    controller = Controller(
        baud=table.whole("baud", 115_200, low=300, high=4_000_000),
        streaming=table.choice("streaming", STREAMING, "character-counting"),
        rx_bytes=table.whole("rx_bytes", 128, low=16, high=65_536),
        line_chars=table.whole("line_chars", 79, low=20, high=4096),
        planner_blocks=table.whole("planner_blocks", 15, low=1, high=1024),
        flow_control=table.choice("flow_control", FLOW_CONTROL, "none"),
    )
    table.finish()
    return controller


def _settings(table: Table) -> dict[int, float]:
    settings = {}
    for key, value in table.rest().items():
        if not (key.startswith("$") and key[1:].isdigit()):
            raise table.fault(key, 'is not a setting; write it like "$30" = 1000')
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise table.fault(key, f"is {value!r}, not a number")
        settings[int(key[1:])] = float(value)
    return settings
