"""A frame: the box around a job, traced before it is cut, to see where it will lie.

The beam is off, or has so little power that it points and does not burn: :data:`MOST_POINTER` of
full power at most, under M4, which keeps it dark whenever the head stands.
"""

from __future__ import annotations

from miurafab.errors import InputError
from miurafab.gcode.job import Job
from miurafab.profiles import MachineProfile

MOST_POINTER = 0.05
"""The largest power of a pointer, as a fraction of full power."""
_FEED = 3000.0  # mm/min; slow enough to follow with the eye


def frame_job(
    name: str,
    bounds_mm: tuple[float, float, float, float],
    machine: MachineProfile,
    *,
    pointer: float = 0.0,
    back_to: tuple[float, float] = (0.0, 0.0),
) -> Job:
    """The job that traces ``bounds_mm`` (x0, y0, x1, y1) once and goes ``back_to`` (mm).

    ``pointer`` is the power as a fraction of full power, 0 for a dark frame. Raises
    :class:`~miurafab.errors.InputError` for a pointer that could burn, or on a tool that is no
    laser.
    """
    if not 0 <= pointer <= MOST_POINTER:
        raise InputError(
            f"A pointer of {100 * pointer:g} % could burn; choose at most {100 * MOST_POINTER:g} %."
        )
    if machine.dialect == "hpgl":
        raise InputError(f"{machine.name} speaks hpgl, in which a frame is not traced.")
    if pointer and (machine.tool.kind != "laser" or machine.dialect in ("grbl-0.9", "marlin")):
        raise InputError(f"{machine.name} has no laser that could point; leave `pointer` out.")
    x0, y0, x1, y1 = bounds_mm
    corners = ((x1, y0), (x1, y1), (x0, y1), (x0, y0))
    feed = min(_FEED, *machine.motion.max_rate_mm_min)
    power = round(pointer * machine.tool.s_max)
    lines = ["G21", "G90", "M5", f"G0 X{x0:.3f} Y{y0:.3f}", *([f"M4 S{power}"] if power else [])]
    lines += [f"G1 X{x:.3f} Y{y:.3f} F{feed:g}" for x, y in corners]
    lines += ["M5", f"G0 X{back_to[0]:.3f} Y{back_to[1]:.3f}", ""]
    return Job(f"the frame of {name}", "\n".join(lines))
