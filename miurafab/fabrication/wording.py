"""Words around numbers, for findings and for printed pages."""

from __future__ import annotations

from collections.abc import Iterable


def count(number: int, one: str, many: str) -> str:
    """``1 sheet``, ``2 sheets``."""
    return f"{number:,} {one if number == 1 else many}"


def in_order(labels: Iterable[str]) -> list[str]:
    """Labels of tabs, letters and a number each, by seam and then by number."""
    return [f"{word}{number}" for _, word, number in _sorted(labels)]


def runs(labels: Iterable[str]) -> str:
    """``a1-a4, b7``: runs of consecutive labels drawn together."""
    found: list[list[tuple[int, str, int]]] = []
    for each in _sorted(labels):
        if found and each == (*found[-1][-1][:2], found[-1][-1][2] + 1):
            found[-1].append(each)
        else:
            found.append([each])
    ends = ([run[0], run[-1]] if len(run) > 1 else [run[0]] for run in found)
    return ", ".join("-".join(f"{word}{number}" for _, word, number in each) for each in ends)


def _sorted(labels: Iterable[str]) -> list[tuple[int, str, int]]:
    """The length of the letters, the letters, and the number of each label, sorted."""
    pairs = ((label.rstrip("0123456789"), label) for label in labels)
    return sorted((len(word), word, int(label[len(word) :])) for word, label in pairs)
