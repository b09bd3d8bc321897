"""The options of an energy curve, for `energy` and its command."""

from __future__ import annotations

from dataclasses import dataclass

from miurafab.options import Choice, Either, Pair, Whole, number, option

STRAIN, CYCLES = 0.2, 3


@dataclass(frozen=True)
class EnergyOptions:
    """The options of an energy curve beside its pattern and its material."""

    steps: int = option(
        Whole(1, 100_000),
        "Steps from the folded form to flat, or to the largest extension.",
        default=40,
    )
    crease: int | None = option(
        Whole(),
        "The edge whose fold angle is driven.",
        default_text="a crease in the middle",
    )
    crease_ratio: float = option(
        number(0), "Stiffness of the creases over that of the facets.", default=0.0
    )
    pull: str | tuple[int, int] | None = option(
        Either(Choice(("corners",)), Pair(Whole(), "V1,V2", "0,120")),
        "Pull two vertices apart, two opposite corners of the grid or those given, and tell the "
        "force in newtons.",
        default_text="none",
    )
    strain: float | None = option(
        number(-0.9, 10),
        "With `pull`: how much farther apart, over the distance in the folded form.",
        default_text=f"{STRAIN:g}",
    )
    cycles: int | None = option(
        Whole(1, 1000),
        "With `pull`: how often to pull and let go.",
        default_text=str(CYCLES),
    )
