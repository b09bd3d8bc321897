"""Words around numbers, for findings and for printed pages."""

from __future__ import annotations

from collections.abc import Iterable


def count(number: int, one: str, many: str) -> str:
    """``1 sheet``, ``2 sheets``."""
    return f"{number:,} {one if number == 1 else many}"


def runs(numbers: Iterable[int]) -> str:
    """``1-4, 7``: runs of consecutive numbers drawn together."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number == found[-1][-1] + 1:
            found[-1].append(number)
        else:
            found.append([number])
    return ", ".join(f"{r[0]}-{r[-1]}" if len(r) > 1 else str(r[0]) for r in found)
