"""How sheets are cut: what a person asks for at the start, declared once."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from miurafab.display import Shown
from miurafab.errors import OptionError
from miurafab.machine.planning import SendOptions
from miurafab.machine.trace_box import MOST_POINTER
from miurafab.options import Flag, Pair, Several, Whole, check_options, length, option, percent
from miurafab.workflow.alignment import Mark


@dataclass(frozen=True, repr=False)
class CutOptions(Shown):
    """How sheets are cut; :func:`cut` names each option.

    Attributes
    ----------
    send : SendOptions
        How the sender starts and watches the machine.
    resume : bool
        Whether to continue an interrupted job.
    frame : bool
        Whether to trace the box around each sheet first.
    pointer : float
        The beam power of the frame, as a fraction of full power.
    from_stroke : int or None
        The stroke, from 1, that the first sheet begins with.
    align : tuple of pairs of points
        Two marks of the one sheet: their position in the job, and where the head stands over them.
    virtual_speed : float or None
        How much faster than real time the virtual machine runs.
    """

    send: SendOptions = field(default_factory=SendOptions)
    resume: bool = option(
        Flag(),
        "Continue an interrupted job; needs `home` or `at`, since the position was lost.",
        False,
        group="Start",
    )
    frame: bool = option(
        Flag(), "Trace the box around each sheet first, then wait.", False, group="Start"
    )
    pointer: float = option(
        percent(0, 100 * MOST_POINTER),
        "Beam power of the frame in percent; 0 keeps the beam off.",
        0.0,
        group="Start",
    )
    from_stroke: int | None = option(
        Whole(1),
        "The stroke that the first sheet begins with, as the progress and the preview count them; "
        "those before it are left out.",
        group="Start",
    )
    align: tuple[Mark, ...] = option(
        Several(
            Pair(Pair(length(-math.inf), "X,Y"), "X,Y=X2,Y2", "10,10=12.3,9.8", "="), separator=";"
        ),
        "A mark of the sheet, X,Y in the job, and X2,Y2 where the head stands over it; give two, "
        "and the sheet is cut where it lies.",
        (),
        group="Start",
    )
    virtual_speed: float | None = None

    def __post_init__(self) -> None:
        check_options(self)
        if self.align and isinstance(self.send.at, str):
            raise OptionError(
                "at",
                f"is {self.send.at}, and `align` says where the sheet lies; give `at` as X,Y, in "
                "the coordinates in which the marks were measured, or leave it out",
            )

    @property
    def unread(self) -> bool:
        """Whether a program may be sent that this computer cannot read."""
        return self.send.check_mode or "program" in self.send.force


DEFAULT_OPTIONS = CutOptions()
