"""The parameters of motion: the machine's axes, its controller, and the link to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from miurafab.errors import ProfileError
from miurafab.profiles import MachineProfile
from miurafab.profiles.board import settings_of
from miurafab.profiles.machine import BAUD

_NEEDED = (1, 11, 12, 30, 31, 32, 100, 101, 102, 110, 111, 112, 120, 121, 122)
_COUNT_AND_CHECKSUM = len("N12345 *123")
"""The usual addition to a line for Marlin."""
Triple = tuple[float, float, float]
_EIGHT_BIT = ("grbl-1.1", "grbl-0.9")
"""Dialects that run on an ATmega328P."""
COMMON_STEPS = 80.0
"""The steps/mm of a profile without ``$100``: a belt of 2 mm pitch, 20 teeth and 1/16 steps, as in
the usual laser frame."""


@dataclass(frozen=True)
class MotionParameters:
    """The settings that shape motion; triples are for the axes X, Y, Z.

    ``steps_per_mm`` ($100-$102); ``max_rate_mm_min`` ($110-$112); ``acceleration`` in mm/s²
    ($120-$122); ``junction_deviation`` and ``arc_tolerance`` in mm ($11, $12); ``idle_lock`` in s:
    after each stop the controller holds the motors for this time before it goes on; None: it holds
    them forever and does not wait ($1); ``laser`` mode ($32); ``s_max``, ``s_min`` ($30, $31).
    ``planner_blocks`` is the depth of the look-ahead. With ``slow_processor`` parsing and planning
    take the time of GRBL's 8-bit processor, else no time.
    """

    steps_per_mm: Triple
    max_rate_mm_min: Triple
    acceleration: Triple
    junction_deviation: float
    arc_tolerance: float
    idle_lock: float | None
    laser: bool
    s_max: float
    s_min: float
    planner_blocks: int = 15
    slow_processor: bool = True

    @classmethod
    def from_settings(cls, settings: Mapping[int, float]) -> MotionParameters:
        """The parameters in a full set of ``$`` settings.

        Raises :class:`~miurafab.errors.ProfileError`, naming the first missing setting.
        """
        missing = [number for number in _NEEDED if number not in settings]
        if missing:
            raise ProfileError(f"The settings lack ${missing[0]}; give all that $$ prints.")
        return cls(
            steps_per_mm=_triple(settings, 100),
            max_rate_mm_min=_triple(settings, 110),
            acceleration=_triple(settings, 120),
            junction_deviation=settings[11],
            arc_tolerance=settings[12],
            idle_lock=None if settings[1] == 255 else settings[1] * 1e-3,
            laser=bool(settings[32]),
            s_max=settings[30],
            s_min=settings[31],
        )

    @classmethod
    def from_profile(cls, profile: MachineProfile) -> MotionParameters:
        """The parameters of a machine profile; its ``settings`` override its motion table.

        Where a profile has no Z axis, Z gets the values of X.
        """
        rate, acceleration = profile.motion.max_rate_mm_min[0], profile.motion.acceleration_mm_s2[0]
        settings = {1: 25.0, 12: 0.002, 112: rate, 122: acceleration}
        settings |= dict.fromkeys((100, 101, 102), COMMON_STEPS) | settings_of(profile)
        settings |= {32: float(profile.tool.kind == "laser")}
        return replace(
            cls.from_settings(settings | profile.settings),
            planner_blocks=profile.controller.planner_blocks,
            slow_processor=profile.dialect in _EIGHT_BIT,
        )


@dataclass(frozen=True)
class Link:
    """The serial link: ``baud`` (10 bits a byte); the host's ``latency`` in s from the controller's
    answer to the next byte sent; the controller's receive buffer ``rx_bytes`` (0: one line at a
    time); ``line_overhead``, the bytes that the dialect adds to each line.
    """

    baud: int = BAUD
    latency: float = 1e-3
    rx_bytes: int = 128
    line_overhead: int = 0

    @classmethod
    def from_profile(cls, profile: MachineProfile) -> Link:
        """The link to the machine of ``profile``."""
        controller = profile.controller
        one_by_one = controller.streaming == "send-response" and profile.dialect != "hpgl"
        return cls(
            baud=controller.baud,
            rx_bytes=0 if one_by_one else controller.rx_bytes,
            line_overhead=_COUNT_AND_CHECKSUM if profile.dialect == "marlin" else 0,
        )


def _triple(settings: Mapping[int, float], first: int) -> Triple:
    return settings[first], settings[first + 1], settings[first + 2]
