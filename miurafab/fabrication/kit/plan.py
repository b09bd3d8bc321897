"""The kit of a pattern: its rows in the order of creasing, and the wedges of its gauge."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from miurafab.fabrication.kit.gauge import Wedge, wedges
from miurafab.fabrication.kit.rows import Row, crease_lines, read_row, row_of, unnumbered
from miurafab.origami.crease_pattern import CreasePattern


@dataclass(frozen=True)
class FoldersKit:
    """What ``layout.json`` tells of the folding; it follows from the pattern alone.

    Parameters
    ----------
    rows : tuple of Row
        The lines in the order in which they are creased.
    wedges : tuple of Wedge
        The gauge.
    unnumbered : int
        The number of creases that are of no line.
    """

    rows: tuple[Row, ...]
    wedges: tuple[Wedge, ...]
    unnumbered: int


def folders_kit(pattern: CreasePattern) -> FoldersKit:
    """The kit of ``pattern``."""
    lines = crease_lines(pattern)
    rows = tuple(row_of(line) for line in lines)
    return FoldersKit(rows, wedges(rows), unnumbered(pattern, lines))


def kit_table(kit: FoldersKit) -> dict[str, Any]:
    """The kit in ``layout.json``."""
    return asdict(kit)


def read_kit(table: dict[str, Any]) -> FoldersKit:
    """The kit that :func:`kit_table` wrote."""
    return FoldersKit(
        tuple(map(read_row, table["rows"])),
        tuple(
            Wedge(float(each["opening_deg"]), tuple(map(str, each["rows"])))
            for each in table["wedges"]
        ),
        int(table["unnumbered"]),
    )
