"""Files: one way to name them, one gate through which they are read, one way to write them.

A file that is read is data of a stranger. :func:`read_bytes` reads regular files only, up to a
limit, and :class:`Reading` turns whatever a parser raises on the content into one sentence. A file
that is written takes the place of an earlier one in one step (:func:`write_bytes`): whoever looks
finds the earlier or the new content, whole, also after a power loss or on a full disk.
"""

from __future__ import annotations

import errno
import json
import os
import reprlib
import secrets
import stat
from pathlib import Path
from types import TracebackType
from typing import Any

from miurafab.errors import InputError, MiurafabError, is_plain, shown

AnyPath = str | os.PathLike[str]
"""A path as every public function takes it."""

MOST_BYTES = 1 << 28
"""A file may have this many bytes, where nothing else is said: a pattern of a million facets has
half as many."""
MOST_MESH_BYTES = 1 << 30
"""A mesh may have this many: a scan of 20 million triangles."""
MOST_TEXT_BYTES = 1 << 22
"""A file that a person writes may have this many: a design, a profile, a list of settings."""
MOST_DIGITS = 18
"""Whole numbers of so many digits fit into 64 bits."""

_LONGEST_NAME, _LONGEST_PATH = 255, 4000
"""In bytes; what is longer is an error of the system (Linux: NAME_MAX, PATH_MAX)."""
_LONGEST_PART = 200
"""... of a name to which an ending or a word is added."""

_FAULTS = (ValueError, TypeError, LookupError, ArithmeticError, RecursionError, MemoryError)
_TEMPORARY = ".miurafab-{}.new"


def as_path(value: object, what: str) -> Path:
    """``value`` as a path; ``what`` begins the sentence if it is none, such as ``The pattern``.

    Raises :class:`~miurafab.errors.InputError`.

    >>> as_path("hypar.fold", "The pattern").suffix
    '.fold'
    """
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(text, str):
        raise InputError(f"{what} is {reprlib.repr(value)}, which is not a path.")
    if not text or not is_plain(text):
        why = "no path" if not text or "\0" in text else "a name with control or unreadable letters"
        raise InputError(f"{what} is {text!r}, which is {why}.")
    path = Path(text)
    if len(os.fsencode(text)) > _LONGEST_PATH or any(map(_is_long, path.parts)):
        raise InputError(f"{what} is {text[:40]!r}..., which is too long for the name of a file.")
    return path


def _is_long(name: str) -> bool:
    return len(os.fsencode(name)) > _LONGEST_NAME


def state_folder() -> Path:
    """Where logs and the like are kept for this user; it need not exist.

    It is ``$XDG_STATE_HOME/miurafab``, ``~/.local/state/miurafab`` without that variable (XDG Base
    Directory Specification), and ``%LOCALAPPDATA%\\miurafab`` on Windows.
    """
    home = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA")
    return Path(home or Path.home() / ".local" / "state") / "miurafab"


_NOT_IN_NAMES = frozenset('/\\:*?"<>|')
"""Letters that some system has in no name of a file."""


def as_file_name(text: str) -> str:
    """``text`` as the name of a file on every system, unchanged where it is one.

    >>> as_file_name('lid "3:4".fold')
    'lid _3_4_.fold'
    """
    name = "".join("_" if letter in _NOT_IN_NAMES else letter for letter in text)
    ending = Path(name).suffix
    if len(name.encode("utf-8")) <= _LONGEST_PART:
        return name
    stem = name.removesuffix(ending).encode("utf-8")[:_LONGEST_PART].decode("utf-8", "ignore")
    return stem.rstrip() + ending


def file_name(name: object, where: str) -> str:
    """``name`` if it is the name of a file and no path; ``where`` begins the sentence if not.

    Raises :class:`~miurafab.errors.InputError`.

    >>> file_name("sheet-01", "layout.json")
    'sheet-01'
    """
    text = name if isinstance(name, str) else ""
    bad = not is_plain(text) or len(os.fsencode(text)) > _LONGEST_NAME - 20
    if not text or bad or _NOT_IN_NAMES & set(text) or text.strip(". ") == "":
        raise InputError(f"{where} names {reprlib.repr(name)}, which is not the name of a file.")
    return text


class Reading:
    """What goes wrong while the content of a file is parsed becomes one ``error`` with its name.

    ``what`` is the file, or ``its name: `` and a place; ``kind`` says what it should be, such as
    ``a FOLD file``. Sentences of miurafab about the content get the name in front, unless they
    have it.

    >>> with Reading("a.fold", "a FOLD file", InputError):
    ...     int("9" * 5000)
    Traceback (most recent call last):
    miurafab.errors.InputError: a.fold is not a FOLD file: a number in it has too many digits.
    """

    def __init__(self, what: object, kind: str, error: type[MiurafabError]) -> None:
        self._what = str(what)
        self._kind = kind
        self._error = error

    def __enter__(self) -> None:
        """Nothing is to be done before."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        fault: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if isinstance(fault, MiurafabError):
            if self._what in fault.sentence:
                return
            raise self._error(f"{self._what}: {fault.sentence}") from None
        if isinstance(fault, _FAULTS):
            raise self._error(f"{self._what} is not {self._kind}: {_reason(fault)}.") from None


def _reason(fault: BaseException) -> str:
    if isinstance(fault, RecursionError):
        return "it is nested too deeply"
    if isinstance(fault, MemoryError):
        return "it asks for more memory than there is"
    if isinstance(fault, json.JSONDecodeError):
        return f"line {fault.lineno} is not valid JSON ({fault.msg})"
    if isinstance(fault, UnicodeDecodeError):
        return "it is not UTF-8 text"
    if isinstance(fault, KeyError):
        return f"it lacks {fault}"
    text = " ".join(str(fault).split())
    if "integer string conversion" in text or isinstance(fault, OverflowError):
        return "a number in it has too many digits"
    return shown(text[:200]).rstrip(".") or type(fault).__name__


def read_bytes(path: Path, error: type[MiurafabError], most: int = MOST_BYTES) -> bytes:
    """The content of the file ``path``, of at most ``most`` bytes.

    Raises ``error`` if it cannot be read, is larger, or is no file but a pipe or a device, which
    might have no end.
    """
    as_path(path, "A file")
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            what = "a folder" if path.is_dir() else "a pipe or a device"
            raise error(f"{path} is {what} and not a file.")
        with path.open("rb") as file:
            content = file.read(most + 1)
    except FileNotFoundError:
        raise error(f"{path} does not exist.") from None
    except OSError as fault:
        raise error(f"{path} cannot be read: {fault.strerror}.") from None
    except MemoryError:
        raise error(f"{path} is larger than the memory of this computer.") from None
    if len(content) > most:
        raise error(f"{path} is larger than {most >> 20} MiB, the most that is read here.")
    return content


def read_text(path: Path, error: type[MiurafabError], kind: str, most: int = MOST_BYTES) -> str:
    """The text of the UTF-8 file ``path`` of a ``kind`` such as ``a FOLD file``; else ``error``."""
    content = read_bytes(path, error, most)
    with Reading(path, kind, error):
        return content.decode("utf-8")


def parse_json(text: str) -> Any:
    """The value in ``text``. Raises ``ValueError`` and ``RecursionError`` (:class:`Reading`)."""
    return json.loads(text, parse_int=_whole)


def _whole(digits: str) -> int:
    if len(digits.lstrip("-")) > MOST_DIGITS:
        raise ValueError("a number in it has too many digits")
    return int(digits)


def new_file(value: object, what: str, endings: tuple[str, ...]) -> Path:
    """A path that can be written: it has one of ``endings`` and its folder is there.

    Raises :class:`~miurafab.errors.InputError`.
    """
    path = as_path(value, what)
    if path.suffix.lower() not in endings:
        raise InputError(f"{path} does not end in one of {', '.join(endings)}.")
    if not path.absolute().parent.is_dir():
        raise InputError(f"The folder of {path} does not exist.")
    if path.is_dir():
        raise InputError(f"{path} is a folder and not a file.")
    return path


def new_folder(value: object, what: str) -> Path:
    """A folder to write into, which is made if need be.

    Raises :class:`~miurafab.errors.InputError` for a file and for the name of a picture or a page,
    which is meant for a file.
    """
    path = as_path(value, what)
    if path.exists() and not path.is_dir():
        raise InputError(f"{what} is {path}, which is a file; give a folder.")
    if not path.exists() and path.suffix.lower() in (".svg", ".png", ".html", ".pdf"):
        raise InputError(f"{what} is {path}, the name of a file; give a folder.")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"{path} cannot be made: {fault.strerror}.") from None
    return path


def write_text(path: Path, text: str, *, private: bool = False) -> None:
    """Write ``text`` as UTF-8, with the same bytes on every system (:func:`write_bytes`)."""
    with Reading(path, "a text that can be written", InputError):
        content = text.encode("utf-8")
    write_bytes(path, content, private=private)


def write_bytes(path: Path, content: bytes, *, private: bool = False) -> None:
    """Write ``content`` in place of the file ``path``, whole or not at all.

    It goes to a temporary file beside ``path``, onto the disk, and takes the name of ``path`` in
    one step. A link is followed, and the permissions of an earlier file are kept, but those of a
    ``private`` file are its owner's alone. A pipe or device is written as it is.

    Raises :class:`~miurafab.errors.InputError`.
    """
    as_path(path, "A file")
    try:
        there = Path(os.path.realpath(path))
        if there.exists() and not there.is_file() and not there.is_dir():
            _put(os.open(there, os.O_WRONLY), content)
            return
        _replace(there, content, private=private)
    except OSError as fault:
        raise InputError(f"{path} cannot be written: {fault.strerror}.") from None


def write_draft(path: Path, content: str | bytes) -> None:
    """Write a file of a folder that is private until :func:`sync_folder` and a rename.

    Raises :class:`~miurafab.errors.InputError`.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        _put(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | _BINARY, 0o666), data)
    except OSError as fault:
        raise InputError(f"{path} cannot be written: {fault.strerror}.") from None


_BINARY = getattr(os, "O_BINARY", 0)
"""Windows would write other line ends without it."""


def _replace(path: Path, content: bytes, *, private: bool) -> None:
    new = path.with_name(_TEMPORARY.format(secrets.token_hex(6)))
    mode = 0o600 if private else 0o666
    opened = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, mode)
    try:
        _put(opened, content, sync=True)
        if path.exists() and not private:
            new.chmod(stat.S_IMODE(path.stat().st_mode))
        new.replace(path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def _put(opened: int, content: bytes, *, sync: bool = False) -> None:
    """Write ``content`` to the file descriptor ``opened``, and close it."""
    try:
        left = memoryview(content)
        while left:
            left = left[os.write(opened, left[: 1 << 24]) :]
        if sync:
            os.fsync(opened)
    finally:
        os.close(opened)


def sync_folder(folder: Path) -> None:
    """Wait until the names in ``folder`` are on the disk."""
    if os.name != "posix":  # Windows opens no folders; it writes names at once
        return
    opened = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(opened)
    except OSError as fault:
        if fault.errno != errno.EINVAL:  # a file system that has no such call
            raise
    finally:
        os.close(opened)
