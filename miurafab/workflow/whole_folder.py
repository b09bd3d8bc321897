"""Several files of one folder are replaced together: all of them or none, whenever the power fails.

New files are written to :data:`STAGING`, a folder inside the folder. When they are on the disk, an
*order* beside them takes its name in one step: which names to remove, which files to move up. From
that moment the new files hold. A process that dies before it leaves the earlier files as they were;
one that dies after it leaves the order, and whoever reads or writes the folder next carries it out
first (:func:`settle`). To carry it out twice does no harm.

One process at a time writes: it holds a lock on a file, which the system releases if it dies.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from miurafab.errors import InputError
from miurafab.files import MOST_TEXT_BYTES, Reading, file_name, parse_json, read_text, sync_folder
from miurafab.files import write_text as write_whole

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

STAGING = ".unfinished"
ORDER = "order.json"
_LOCK = ".lock"
_PATIENCE_S = 10.0
"""A reader waits so long for a writer that is moving files up, which takes milliseconds."""
_LOOK_S = 0.02
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)


@contextmanager
def whole_folder(folder: Path, may_remove: Callable[[str], bool]) -> Iterator[Path]:
    """The staging folder, in which the block writes files for ``folder``, which exists.

    The block ends with :func:`put_in_place`. Whatever an earlier process left is settled first,
    where ``may_remove`` says of a name whether an order may remove it. Raises
    :class:`~miurafab.errors.InputError` where another process writes ``folder``.
    """
    with _locked(folder):
        _carry_out(folder, may_remove)
        staging = folder / STAGING
        if staging.is_symlink() or (staging.exists() and not staging.is_dir()):
            raise InputError(f"{staging} is not a folder of miurafab; remove it.")
        shutil.rmtree(staging, ignore_errors=True)
        staging.mkdir()
        try:
            yield staging
        finally:
            if not (staging / ORDER).exists():
                shutil.rmtree(staging, ignore_errors=True)


def put_in_place(folder: Path, remove: Collection[str], first: Collection[str], last: str) -> None:
    """Replace files of ``folder`` by those in its staging folder, and ``remove`` others.

    ``first`` are removed before all, ``last`` is moved up after all, so that programs that know
    nothing of orders see no mixture as a job.
    """
    staging = folder / STAGING
    put = sorted((path.name for path in staging.iterdir()), key=lambda name: name == last)
    for name in put:
        _sync_file(staging / name)
    sync_folder(staging)
    for name in (*first, *remove, *put):
        if (folder / name).is_dir() and not (folder / name).is_symlink():
            raise InputError(f"{folder / name} is a folder where a file belongs; move it away.")
    order = {"first": sorted(first), "remove": sorted(set(remove) - set(put)), "put": put}
    write_whole(staging / ORDER, json.dumps(order))
    _carry_out(folder, lambda name: True)


def settle(folder: Path, may_remove: Callable[[str], bool]) -> None:
    """Finish the replacement that a process began in ``folder`` and did not live to finish.

    Raises :class:`~miurafab.errors.InputError` where that cannot be done.
    """
    if not (folder / STAGING / ORDER).is_file():
        return
    end = time.monotonic() + _PATIENCE_S
    while True:
        try:
            with _locked(folder):
                _carry_out(folder, may_remove)
            return
        except _Busy:
            if time.monotonic() > end:
                raise
            time.sleep(_LOOK_S)
        except OSError as fault:
            there = fault.filename2 or fault.filename or folder
            raise InputError(
                f"{folder} was not finished, and {there} cannot be written: {fault.strerror}."
            ) from None


def _carry_out(folder: Path, may_remove: Callable[[str], bool]) -> None:
    staging = folder / STAGING
    path = staging / ORDER
    if staging.is_symlink() or not path.is_file():
        return
    text = read_text(path, InputError, "an order of miurafab", MOST_TEXT_BYTES)
    with Reading(path, "an order of miurafab", InputError):
        order = parse_json(text)
        first, remove, put = (_names(order[key], path) for key in ("first", "remove", "put"))
        if not all(map(may_remove, (*first, *remove))):
            raise InputError(f"{path} would remove what is no part of a job; delete {staging}.")
    for name in (*first, *remove):
        if name not in put or (staging / name).exists():  # else it is the new one
            (folder / name).unlink(missing_ok=True)
    for name in put:
        if (staging / name).exists():
            (staging / name).replace(folder / name)
    sync_folder(folder)
    path.unlink()
    shutil.rmtree(staging, ignore_errors=True)


def _names(names: list[object], path: Path) -> list[str]:
    return [file_name(name, str(path)) for name in names]


def _sync_file(path: Path) -> None:
    opened = os.open(path, os.O_RDWR)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


class _Busy(InputError):
    """Another process holds the lock."""


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of ``folder``. Raises :class:`_Busy` if another process does."""
    path = folder / _LOCK
    opened = _lock_file(path, folder)
    try:
        yield
    finally:
        if sys.platform != "win32":  # where an open file cannot be removed
            path.unlink(missing_ok=True)
        os.close(opened)
        if sys.platform == "win32":
            path.unlink(missing_ok=True)


def _lock_file(path: Path, folder: Path) -> int:
    if path.is_symlink() or path.is_dir():
        raise InputError(f"{path} is not a lock of miurafab; remove it.")
    while True:
        opened = os.open(path, os.O_RDWR | os.O_CREAT | _NO_LINK, 0o666)
        try:
            if sys.platform == "win32":
                msvcrt.locking(opened, msvcrt.LK_NBLCK, 1)
            else:
                fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # the process that held it may just have removed the file
            if os.path.samestat(os.fstat(opened), path.stat()):
                return opened
        except (BlockingIOError, PermissionError):
            os.close(opened)
            raise _Busy(
                f"{folder} is being written by another miurafab; wait until it has ended, or "
                "choose another directory."
            ) from None
        except FileNotFoundError:
            pass
        except OSError:
            os.close(opened)
            raise
        os.close(opened)
