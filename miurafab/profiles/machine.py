"""A machine in one strict TOML file: its bed, motion, tool and controller.

The ranges below are wide: they catch a wrong unit (a bed of 40 m) and allow an unusual machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from miurafab.display import Shown
from miurafab.files import AnyPath
from miurafab.options import (
    REQUIRED,
    Choice,
    Flag,
    Several,
    Text,
    Whole,
    angle,
    feed,
    length,
    number,
    option,
)
from miurafab.profiles.beam import OPERATIONS, SHALLOW, Laser
from miurafab.profiles.shipped import find_profile
from miurafab.profiles.table import Table, read_toml
from miurafab.units import as_float

DIALECTS = ("grbl-1.1", "grbl-0.9", "grblhal", "fluidnc", "marlin", "hpgl")
BAUD = 115_200
"""The baud rate of nearly every GRBL board."""
WAIT_S = 2.5
"""The longest time until the banner of a common board (boot loader: 1 to 2 s)."""
TOOLS = ("laser", "pen", "knife")
STREAMING = ("character-counting", "send-response")
AIR_WORDS = ("M8", "M7")
FLOW_CONTROL = ("none", "xon-xoff", "rts-cts")


@dataclass(frozen=True)
class Bed:
    """The usable work area in mm."""

    width_mm: float = option(length(10, 20_000), "Work area along X.", REQUIRED)
    height_mm: float = option(length(10, 20_000), "Work area along Y.", REQUIRED)
    margin_mm: float = option(length(0, 500), "Kept free along the edges.", 5.0)
    roll_fed: bool = option(
        Flag(), "Whether the machine itself lays fresh material out for each sheet.", False
    )


@dataclass(frozen=True)
class MotionLimits:
    """What the firmware's planner is set to: rates in mm/min, accelerations in mm/s²."""

    max_rate_x_mm_min: float = option(feed(), "Maximum rate of X (`$110`).", REQUIRED)
    max_rate_y_mm_min: float = option(feed(), "Maximum rate of Y (`$111`).", REQUIRED)
    acceleration_x_mm_s2: float = option(
        number(1, 1e5, unit=" mm/s²"), "Acceleration of X in mm/s² (`$120`).", REQUIRED
    )
    acceleration_y_mm_s2: float = option(
        number(1, 1e5, unit=" mm/s²"), "Acceleration of Y in mm/s² (`$121`).", REQUIRED
    )
    junction_deviation_mm: float = option(length(0, 1), "Junction deviation (`$11`).", 0.01)

    @property
    def max_rate_mm_min(self) -> tuple[float, float]:
        """The maximum rates of X and Y."""
        return self.max_rate_x_mm_min, self.max_rate_y_mm_min

    @property
    def acceleration_mm_s2(self) -> tuple[float, float]:
        """The accelerations of X and Y."""
        return self.acceleration_x_mm_s2, self.acceleration_y_mm_s2


@dataclass(frozen=True)
class ZAxis:
    """A motor that lifts and lowers the head; a machine without the table has none."""

    travel_mm: float = option(length(0.1, 1000), "Travel of Z (`$132`).", REQUIRED)
    max_rate_mm_min: float = option(feed(), "Maximum rate of Z (`$112`).", REQUIRED)
    acceleration_mm_s2: float = option(
        number(0.1, 1e5, unit=" mm/s²"), "Acceleration of Z in mm/s² (`$122`).", REQUIRED
    )


@dataclass(frozen=True)
class Knife:
    """A blade that trails behind the axis of its holder, as the wheel of a caster does."""

    offset_mm: float = option(
        length(0, 5),
        "How far the tip trails; 0 where the machine corrects for that itself.",
        REQUIRED,
    )
    corner_angle: float = option(
        angle(1, 180),
        "At a corner that turns by more, the blade is turned about its tip in fine steps.",
        math.radians(20),
    )
    overcut_mm: float = option(
        length(0, 20), "Closed outlines are cut on over their start by this length.", 0.0
    )
    s_shallow: int | None = option(
        Whole(),
        "S (HPGL: force) that marks the sheet without cutting through, for scores and engravings.",
        default_text="none",
    )
    leave_out: tuple[str, ...] = option(
        Several(Choice(OPERATIONS)), "Operations that this knife does not make.", ()
    )


@dataclass(frozen=True)
class Tool:
    """What marks the sheet. S values run from ``s_min`` to ``s_max`` (``$31``, ``$30``).

    ``beam_mode`` is the word that arms a laser: M4 scales the power with the speed and goes dark
    whenever motion stops; M3 keeps burning and must be allowed explicitly. ``air_word`` is the
    word that opens the valve of ``air_assist``.
    For a pen or knife ``s_down`` and ``s_up`` are the servo positions and ``settle_s`` the time
    each takes; on an HPGL machine ``s_down`` is the force of its ``FS`` instruction. ``laser`` is
    the beam of a laser.
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
    air_word: str = AIR_WORDS[0]
    laser: Laser | None = None

    @property
    def beam(self) -> str:
        """The kind of beam that settings of materials are for: a kind of laser, pen or knife."""
        return self.kind if self.laser is None else self.laser.beam

    @property
    def beam_title(self) -> str:
        """What messages call that kind of beam."""
        return f"a {self.kind}" if self.laser is None else self.laser.title

    def depth(self, operation: str) -> int:
        """The S of a pen or knife that is down; shallow for operations that mark."""
        knife = self.knife
        if knife is not None and knife.s_shallow is not None and operation in SHALLOW:
            return knife.s_shallow
        return self.s_down

    @property
    def strength(self) -> str:
        """What messages call the beam with its full power."""
        return self.beam_title + ("" if self.laser is None else f", {self.laser.power:g} W")

    def same_beam(self, other: Tool) -> bool:
        """Whether a power or depth means the same on ``other``."""
        if self.laser is None or other.laser is None:
            return self.beam == other.beam
        return self.laser.power == other.laser.power and self.laser.is_kind(
            other.laser.beam, other.laser.wavelength
        )


@dataclass(frozen=True)
class Controller:
    """How to talk to the controller."""

    baud: int = option(Whole(300, 4_000_000), "Speed of the serial port in baud.", BAUD)
    streaming: str = option(
        Choice(STREAMING), "How the sender keeps the receive buffer full.", STREAMING[0]
    )
    wait: float = option(
        number(0.1, 120.0),
        "How many seconds the board may take to start after its port is opened.",
        WAIT_S,
    )
    reset: bool = option(
        Flag(),
        "Reset the controller softly once its port is open, even if it is at rest.",
        False,
    )
    rx_bytes: int = option(Whole(16, 65_536), "Usable bytes of the receive buffer.", 128)
    line_chars: int = option(Whole(20, 4096), "Usable characters of a line.", 79)
    planner_blocks: int = option(Whole(1, 1024), "Moves that the planner holds.", 15)
    flow_control: str = option(
        Choice(FLOW_CONTROL),
        "How a machine that answers nothing pauses its sender.",
        FLOW_CONTROL[0],
    )


@dataclass(frozen=True, repr=False)
class MachineProfile(Shown):
    """One machine class.

    Attributes
    ----------
    name : str
        The stem of the file of the profile.
    title : str
        What lists call the machine.
    dialect : str
        The language of the controller, such as ``"grbl-1.1"``.
    bed : Bed
        The work area and its margin, mm.
    motion : MotionLimits
        Rates in mm/min and accelerations in mm/s² of the firmware's planner.
    tool : Tool
        What marks the sheet, and its S values.
    controller : Controller
        The serial port's speed and buffers.
    settings : dict of int to float
        The controller settings that a job expects, ``{30: 1000.0}`` for ``$30=1000``.
    z : ZAxis or None
        The motor that lifts the head, if there is one.
    """

    name: str
    title: str
    dialect: str
    bed: Bed
    motion: MotionLimits
    tool: Tool
    controller: Controller
    settings: dict[int, float]
    z: ZAxis | None = None

    @property
    def job_suffix(self) -> str:
        """How the name of a file for this machine ends."""
        return ".plt" if self.dialect == "hpgl" else ".nc"

    def share(self, power: float) -> float:
        """A ``power`` in watts as a share of the laser's full power, 1 at most."""
        laser = self.tool.laser
        assert laser is not None
        return min(1.0, power / laser.power)

    def power_to_s(self, power: float) -> int:
        """The S word for a ``power`` in watts of a laser."""
        tool = self.tool
        least, most = tool.s_min, tool.s_max
        return round(least + self.share(power) * (most - least)) if power > 0 else 0


def read_machine(machine: MachineProfile | AnyPath | None) -> MachineProfile:
    """``machine`` itself, or the profile that it names; for None the default machine."""
    if isinstance(machine, MachineProfile):
        return machine
    return load_machine(find_profile("firmware_profiles", None) if machine is None else machine)


def load_machine(name: AnyPath) -> MachineProfile:
    """Read a machine profile.

    Parameters
    ----------
    name : str or os.PathLike
        A shipped name (:func:`list_machines` lists them) or a TOML file.

    Returns
    -------
    MachineProfile

    Raises
    ------
    ProfileError
        Naming the file, the key and what is accepted.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.load_machine("grbl-laser-400").bed.width_mm
    400.0
    """
    path = find_profile("firmware_profiles", name)
    table = Table(read_toml(path), path.name)
    profile = MachineProfile(
        name=path.stem,
        title=table.value("title", Text()),
        dialect=table.value("dialect", Choice(DIALECTS)),
        bed=table.table("bed").options(Bed),
        motion=table.table("motion").options(MotionLimits),
        tool=_tool(table.table("tool")),
        controller=table.table("controller").options(Controller),
        settings=_settings(table.table("settings", {})),
        z=_z_axis(table.table("z")) if table.has("z") else None,
    )
    table.finish()
    if 2 * profile.bed.margin_mm >= min(profile.bed.width_mm, profile.bed.height_mm):
        raise table.fault("bed", "has a margin that leaves nothing of the bed")
    if profile.z is not None and profile.dialect == "hpgl":
        raise table.fault("z", "is for G-code; HPGL lifts its tool without a height")
    if profile.tool.air_word == "M7" and profile.dialect == "marlin":
        raise table.fault("tool", "has the air_word M7; Marlin's usual coolant is M8")
    return profile


def _z_axis(table: Table) -> ZAxis:
    axis = table.options(ZAxis)
    table.finish()
    return axis


def _tool(table: Table) -> Tool:
    kind = table.value("kind", Choice(TOOLS))
    if kind == "laser":
        _states_its_beam(table)
    s_max = table.value("s_max", Whole(1, 100_000), 1000)
    own_s = Whole(0, s_max)
    tool = Tool(
        kind=kind,
        s_min=table.value("s_min", own_s, 0),
        s_max=s_max,
        beam_mode=table.value("beam_mode", Choice(("M4", "M3")), "M4" if kind == "laser" else "M3"),
        air_assist=table.value("air_assist", Flag(), False),
        air_word=table.value("air_word", Choice(AIR_WORDS), AIR_WORDS[0]),
        s_down=table.value("s_down", own_s, s_max),
        s_up=table.value("s_up", own_s, 0),
        settle_s=table.value("settle", number(0, 10, unit=" s"), 0.0),
        laser=table.options(Laser) if kind == "laser" else None,
        knife=table.options(Knife) if kind == "knife" else None,
    )
    table.finish()
    if tool.beam == "diode" and not table.has("wavelength"):
        raise table.fault(
            "wavelength", "is missing: write that of the diode in nm, 450 for common blue ones"
        )
    if tool.knife is not None and (tool.knife.s_shallow or 0) > s_max:
        raise table.fault("s_shallow", f"is {tool.knife.s_shallow}, which exceeds s_max ({s_max})")
    return tool


def _states_its_beam(table: Table) -> None:
    """Raise where a laser does not say what its S values mean in watts."""
    for key in ("beam", "power"):
        if not table.has(key):
            raise table.fault(
                key,
                "is missing: settings of materials are for one kind of beam, in watts; write "
                'beam = "diode" and wavelength = 450 (nm), or beam = "co2", and power = "10W", '
                "which is what the laser's label says of its light",
            )


def _settings(table: Table) -> dict[int, float]:
    settings = {}
    for key, value in table.rest().items():
        number = key[1:]
        if not (key.startswith("$") and number.isascii() and number.isdigit() and len(number) < 6):
            raise table.fault(key, 'is not a setting; write it like "$30" = 1000')
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(as_float(value))
        ):
            raise table.fault(key, f"is {value!r}, not a number")
        settings[int(number)] = float(value)
    return settings
