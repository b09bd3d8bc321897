"""Results drawn or tabulated: the ending of the file decides, and is checked before the work."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from miurafab.errors import InputError

PLOTS = (".png", ".svg")


def check_writable(path: Path, what: str) -> None:
    """Refuse, before any work is done, a file that :func:`write_result` could not write.

    ``what`` is the result's name in the sentence. Raises :class:`~miurafab.errors.InputError`.
    """
    if path.suffix.lower() not in (*PLOTS, ".csv"):
        raise InputError(f"{path}: {what} is written as .png, .svg or .csv, by the ending.")
    if not path.absolute().parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist.")


def write_result(
    path: Path, what: str, table: Callable[[], str], plot: Callable[[str], bytes]
) -> None:
    """Write the ``table`` to a .csv, or the ``plot`` of the kind that the ending names.

    Raises :class:`~miurafab.errors.InputError` for another ending.
    """
    check_writable(path, what)
    if path.suffix.lower() == ".csv":
        path.write_text(table(), encoding="utf-8", newline="\n")
    else:
        path.write_bytes(plot(path.suffix.lower().removeprefix(".")))
