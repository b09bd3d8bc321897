"""Growing tables: rows are appended singly or in blocks, and stored as typed columns.

A row of a list of tuples takes about a hundred bytes; here it takes the bytes of its numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_FLUSH = 4096  # rows


class Columns:
    """A table whose columns have the NumPy ``types``, such as ``"f8"``."""

    def __init__(self, *types: str) -> None:
        self._types = types
        self._blocks: list[list[NDArray[Any]]] = [[] for _ in types]
        self._rows: list[tuple[float, ...]] = []
        self._filed = 0

    def __len__(self) -> int:
        return self._filed + len(self._rows)

    def add(self, *row: float) -> None:
        """Append one row."""
        self._rows.append(row)
        if len(self._rows) >= _FLUSH:
            self._file_rows()

    def extend(self, *columns: NDArray[Any] | Sequence[float]) -> None:
        """Append a block of rows, given as columns of equal length."""
        self._file_rows()
        self._file(columns)

    def _file_rows(self) -> None:
        if self._rows:
            columns = list(zip(*self._rows, strict=True))
            self._rows.clear()
            self._file(columns)

    def _file(self, columns: Sequence[NDArray[Any] | Sequence[float]]) -> None:
        for kind, blocks, column in zip(self._types, self._blocks, columns, strict=True):
            blocks.append(np.array(column, dtype=kind))
        self._filed += len(columns[0])

    def take(self, column: int) -> NDArray[Any]:
        """Column number ``column`` as one array. Callable once: its memory is released."""
        self._file_rows()
        blocks = self._blocks[column]
        whole = np.concatenate(blocks) if blocks else np.zeros(0, dtype=self._types[column])
        blocks.clear()
        return whole
