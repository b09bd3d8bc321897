"""The kinds of values that only a fit has: flat-foldability, and the number of pieces."""

from __future__ import annotations

import itertools
import math

from miurafab.errors import UnitError
from miurafab.options import Kind
from miurafab.options.kinds import comma_parts, is_truth, number
from miurafab.units import parse_angle

_FLAT_FOLDABILITY = "it must be exact, off, or an angle such as 0.016rad or 0.9deg"


class FlatFoldability(Kind):
    """``exact`` (0 inside), ``off`` (None) or the largest difference of pi - a1 - a3 from 0.

    The paper gives this limit in radians, every other angle here is in degrees; so a number must
    carry its unit.
    """

    @property
    def metavar(self) -> str:
        return "exact|off|ANGLE"

    def read(self, value: object) -> float | None:
        if value == "exact":
            return 0.0
        if value == "off":
            return None
        try:
            # whatever is no number is told by its TypeError
            float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            pass
        else:
            if is_truth(value):
                raise ValueError(f"is {value}; {_FLAT_FOLDABILITY}")
            raise ValueError(
                f"is {value} without a unit; write {value}rad, as the paper does, or degrees such "
                "as 0.9deg"
            )
        try:
            inside = parse_angle(value if isinstance(value, str) else repr(value))
        except UnitError:
            raise ValueError(f"is {value!r}; {_FLAT_FOLDABILITY}") from None
        self.check(inside)
        return inside

    def check(self, inside: float) -> None:
        if not 0 <= inside < math.pi:
            raise ValueError(
                f"is {math.degrees(inside):g} deg; it must be exact, off, or an angle under 180 deg"
            )

    def show(self, inside: float) -> str:
        return f"{inside:g}rad" if inside else "exact"


class Pieces(Kind):
    """``auto`` (None inside) or a whole number from 1 on."""

    @property
    def metavar(self) -> str:
        return "N|auto"

    def read(self, value: object) -> int | None:
        if value == "auto":
            return None
        text = value if isinstance(value, str) else repr(value)
        if not text.isdecimal():
            raise ValueError(f"is {value!r}; it must be auto or a whole number from 1 on")
        self.check(int(text))
        return int(text)

    def check(self, inside: int) -> None:
        if inside < 1:
            raise ValueError(f"is {inside}; it must be auto or a whole number from 1 on")

    def show(self, inside: int) -> str:
        return str(inside)


class Poles(Kind):
    """Two points of space, the coordinates of the one after those of the other."""

    @property
    def metavar(self) -> str:
        return "X,Y,Z,X,Y,Z"

    def read(self, value: object) -> tuple[float, ...]:
        try:
            numbers = tuple(number().read(part) for part in comma_parts(value))
        except (TypeError, ValueError):
            raise ValueError(
                f"is {value!r}; write six numbers with commas between, such as 0,0,-50,0,0,50"
            ) from None
        self.check(numbers)
        return numbers

    def check(self, inside: tuple[float, ...]) -> None:
        if len(inside) != 6 or not all(map(math.isfinite, inside)):
            raise ValueError(f"is {self.show(inside)!r}; it must be six numbers, two points")
        if inside[:3] == inside[3:]:
            raise ValueError(f"is {self.show(inside)!r}; the two points must differ")

    def show(self, inside: tuple[float, ...]) -> str:
        return ",".join(map("{:g}".format, inside))


class CutColumns(Kind):
    """Columns of vertices along which a sheet is cut, each under the next."""

    @property
    def metavar(self) -> str:
        return "I,J"

    def read(self, value: object) -> tuple[int, ...]:
        try:
            columns = tuple(int(str(part)) for part in comma_parts(value))
        except (TypeError, ValueError):
            raise ValueError(
                f"is {value!r}; write column numbers with commas between, such as 8,16"
            ) from None
        self.check(columns)
        return columns

    def check(self, inside: tuple[int, ...]) -> None:
        if not inside or inside[0] < 1 or any(a >= b for a, b in itertools.pairwise(inside)):
            raise ValueError(
                f"is {self.show(inside)!r}; write columns from 1 on, each under the next"
            )

    def show(self, inside: tuple[int, ...]) -> str:
        return ",".join(map(str, inside))
