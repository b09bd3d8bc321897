"""The options of a trade-off, for `tradeoff` and its command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from miurafab.errors import OptionError
from miurafab.options import Text, Whole, Written, option
from miurafab.origami.tradeoff import WEIGHTS

SIDES = (8, 12, 16, 24, 32, 48)


def _read_sides(value: object) -> tuple[int, ...]:
    words = value.split(",") if isinstance(value, str) else value
    try:
        return tuple(Whole(2).read(word) for word in words)  # type: ignore[attr-defined]  # TypeError below
    except (TypeError, ValueError):
        raise ValueError(f"is {value!r}; write whole numbers from 2, such as 8,16,32") from None


def _read_weights(value: object) -> tuple[float, ...]:
    words = value.split(",") if isinstance(value, str) else value
    try:
        weights = tuple(float(word) for word in words)  # type: ignore[attr-defined]  # TypeError below
    except (TypeError, ValueError):
        weights = ()
    if not weights or not all(0 < weight < 1 for weight in weights):
        raise ValueError(f"is {value!r}; write numbers between 0 and 1, such as 0.2,0.5,0.8")
    return weights


def _listed(values: Sequence[float]) -> str:
    return ",".join(f"{value:g}" for value in values)


@dataclass(frozen=True)
class TradeoffOptions:
    """The options of a trade-off beside those of a fit."""

    sides: tuple[int, ...] = option(
        Written(_read_sides, _listed, "N,N,..."),
        "Facets along a side, three numbers or more, comma-separated.",
        default=SIDES,
    )
    weights: tuple[float, ...] = option(
        Written(_read_weights, _listed, "W,W,..."),
        "Weights of effort in the cost, between 0 and 1, comma-separated.",
        default=WEIGHTS,
    )
    workers: int | None = option(
        Whole(1),
        "Processes on this computer.",
        default_text="one a processor on the command line, 1 in Python",
    )
    cluster: str | None = option(
        Text("ADDRESS"), "Run on the dask cluster at this address (tcp://HOST:8786)."
    )

    def __post_init__(self) -> None:
        if len(set(self.sides)) < 3:
            raise OptionError(
                "sides", f"is {_listed(self.sides)}; three different numbers or more are needed"
            )
