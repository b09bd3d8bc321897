"""Power belongs to a beam: how each operation is made, for each kind of beam, in watts.

A fraction of full power is 8 W on one laser and 30 W on the next, and card takes up the light of a
CO2 laser otherwise than that of a diode. So a machine states its kind of beam and its watts, and a
material has an entry for each kind of beam that it was tried with. What has no entry is refused.

Within one kind of beam a setting holds by its energy per length, P / v: a laser of less power than
an entry asks for goes slower by as much (:meth:`BeamSettings.on`). Power density and heat flow do
not scale so, hence the range of lasers that the entry was meant for; outside it a layout warns.

Pens and knives are such kinds too. They have no power; their forces are the S values of one
machine, which an entry names.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from miurafab.options import (
    REQUIRED,
    Choice,
    Flag,
    Pair,
    Text,
    Whole,
    feed,
    length,
    number,
    option,
    watts,
)

OPERATIONS = ("engrave", "score", "perforate", "cut")
"""The operations in the order in which a sheet is made; cuts, which loosen it, come last."""

SHALLOW = ("engrave", "score")
"""The operations that mark the sheet and must not cut through it."""

LASERS = ("diode", "co2")
BEAMS = (*LASERS, "knife", "pen")

SAME_NM = 50.0
"""Diodes within so many nm are one kind: blue ones have 440 to 460 nm (judged), the next kinds are
red (650 nm) and infrared (from 808 nm), which pale card hardly takes up."""


@dataclass(frozen=True)
class Laser:
    """The beam of a laser."""

    beam: str = option(Choice(LASERS), "Kind of laser.", REQUIRED)
    power: float = option(
        watts(0.05, 2000),
        "Power of its light at full S, as its label says; not of its supply.",
        REQUIRED,
    )
    wavelength: float | None = option(
        number(200, 12_000, unit=" nm"), "Wavelength of a diode's light in nm; a diode needs it."
    )

    @property
    def title(self) -> str:
        """What messages call the beam."""
        return beam_title(self.beam, self.wavelength)

    def is_kind(self, beam: str, wavelength: float | None) -> bool:
        """Whether this laser is of the kind ``beam`` at that ``wavelength`` in nm."""
        if beam != self.beam or wavelength is None or self.wavelength is None:
            return beam == self.beam
        return abs(wavelength - self.wavelength) <= SAME_NM


@dataclass(frozen=True)
class Operation:
    """How one operation is made."""

    feed_mm_min: float = option(feed(), "Speed of the head.", REQUIRED)
    power: float | None = option(watts(0, 2000), "Power of the beam; a laser needs it.")
    force: int | None = option(
        Whole(),
        "S (HPGL: force) of a pen or knife.",
        default_text="the machine's `s_down` or `s_shallow`",
    )
    passes: int = option(Whole(1, 50), "How often each stroke is made.", 1)
    z_step_mm: float = option(
        length(0, 20), "How much lower the head is in each further pass; needs a Z axis.", 0.0
    )
    focus_mm: float = option(
        length(-50, 50),
        "Z of the head in the first pass, 0 being the height to which you focused; needs a Z axis.",
        0.0,
    )
    air: bool = option(
        Flag(), "Whether air is blown, on a machine with air assist; false switches it off.", True
    )

    @property
    def heights_mm(self) -> tuple[float, ...]:
        """Z in each pass."""
        return tuple(
            round(self.focus_mm - number * self.z_step_mm, 3) for number in range(self.passes)
        )

    @property
    def energy_j_mm(self) -> float:
        """The energy of one pass in joules per mm, 0 without a power."""
        return 60.0 * (self.power or 0.0) / self.feed_mm_min


def _ordered(powers: tuple[float, float]) -> tuple[float, float]:
    return min(powers), max(powers)


@dataclass(frozen=True)
class Meant:
    """What the settings of one kind of beam were meant for."""

    lasers: tuple[float, float] | None = option(
        Pair(watts(0.05, 2000), "POWER,POWER", "5W,10W", collect=_ordered),
        "Least and greatest power of the lasers that it is for; a laser needs it.",
    )
    max_power: float | None = option(
        watts(0.01, 2000),
        "The most power that a job may use.",
        default_text="the greatest of `lasers`",
    )
    wavelength: float | None = option(
        number(200, 12_000, unit=" nm"), "Wavelength of a diode's light in nm; a diode needs it."
    )
    forces_of: str | None = option(Text(), "The machine whose S values the forces are.")


@dataclass(frozen=True)
class BeamSettings:
    """How a material is worked with one kind of ``beam``: what that was ``meant`` for, and its
    ``operations``.
    """

    beam: str
    meant: Meant
    operations: dict[str, Operation]

    @property
    def most_watts(self) -> float | None:
        """The most power of a job in watts; None without a laser."""
        least_and_most = self.meant.lasers
        return self.meant.max_power or (None if least_and_most is None else least_and_most[1])

    @property
    def title(self) -> str:
        """What messages call the beam."""
        return beam_title(self.beam, self.meant.wavelength)

    def on(self, laser: Laser) -> BeamSettings:
        """The settings for ``laser``: operations that ask for more than it has take all of it, at
        a feed at which the energy per length is the same.
        """
        made = {
            name: _within(operation, laser.power) for name, operation in self.operations.items()
        }
        return replace(self, operations=made)

    def without_forces(self) -> BeamSettings:
        """The settings with the forces of whatever machine makes them."""
        made = {name: replace(each, force=None) for name, each in self.operations.items()}
        return replace(self, operations=made)

    def slowed(self, laser: Laser) -> list[str]:
        """The operations that :meth:`on` slows down."""
        return [name for name, each in self.operations.items() if (each.power or 0) > laser.power]


def _within(operation: Operation, most: float) -> Operation:
    if operation.power is None or operation.power <= most:
        return operation
    feed_mm_min = operation.feed_mm_min * most / operation.power
    return replace(operation, power=most, feed_mm_min=feed_mm_min)


def beam_title(beam: str, wavelength: float | None) -> str:
    """What messages call a kind of beam."""
    if beam not in LASERS:
        return f"a {beam}"
    if beam == "co2":
        return "a CO2 laser"
    return "a diode laser" if wavelength is None else f"a diode laser of {wavelength:g} nm"
