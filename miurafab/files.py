"""Paths as callers give them, text or any path object, and the content of files."""

from __future__ import annotations

import os
import reprlib
from pathlib import Path

from miurafab.errors import InputError, MiurafabError

AnyPath = str | os.PathLike[str]
"""A path as every public function takes it."""


def as_path(value: object, what: str) -> Path:
    """``value`` as a path; ``what`` begins the sentence if it is none, such as ``The pattern``.

    Raises :class:`~miurafab.errors.InputError`.

    >>> as_path("hypar.fold", "The pattern").suffix
    '.fold'
    """
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(text, str):
        raise InputError(f"{what} is {reprlib.repr(value)}, which is not a path.")
    if not text or "\0" in text:
        raise InputError(f"{what} is {text!r}, which is no path.")
    return Path(text)


def read_bytes(path: Path, error: type[MiurafabError]) -> bytes:
    """The content of the file ``path``; raises ``error`` if it cannot be read."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise error(f"{path} does not exist.") from None
    except OSError as fault:
        raise error(f"{path} cannot be read: {fault.strerror}.") from None


def read_text(path: Path, error: type[MiurafabError], kind: str) -> str:
    """The text of the UTF-8 file ``path`` of a ``kind`` such as ``a FOLD file``; else ``error``."""
    try:
        return read_bytes(path, error).decode("utf-8")
    except UnicodeDecodeError:
        raise error(f"{path} is not {kind}: it is not UTF-8 text.") from None


def new_file(value: object, what: str, endings: tuple[str, ...]) -> Path:
    """A path that can be written: it has one of ``endings`` and its folder is there.

    Raises :class:`~miurafab.errors.InputError`.
    """
    path = as_path(value, what)
    if path.suffix.lower() not in endings:
        raise InputError(f"{path} does not end in one of {', '.join(endings)}.")
    if not path.absolute().parent.is_dir():
        raise InputError(f"The folder of {path} does not exist.")
    return path
