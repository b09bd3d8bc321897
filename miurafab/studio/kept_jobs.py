"""The jobs that the studio cuts: copies in the user's state folder, with their journals.

The studio's own folder goes with the studio, and a newer layout takes the place of an older one in
it. A job that is cut must outlive both: its journal tells where an interrupted sheet goes on.

A studio marks the job that it holds by an empty file with the number of its process. A marked job
is not removed by another studio as long as that process lives.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from pathlib import Path

from miurafab.errors import InputError
from miurafab.files import new_folder, state_folder, write_bytes
from miurafab.machine.owner import is_alive
from miurafab.workflow.manifest import MANIFEST

_KEPT = 20
"""The number of jobs kept; a further one removes the one that was put on longest ago, unless a
studio holds it."""
_HELD = ".held-"


def keep_job(job: Path) -> Path:
    """A copy of the job directory ``job`` that stays; the earlier copy of an equal one.

    Raises :class:`~miurafab.errors.InputError` where it cannot be written.
    """
    home = new_folder(state_folder() / "studio", "The folder of jobs that are cut")
    try:
        return _kept(job, home)
    except OSError as fault:
        raise InputError(f"The job cannot be kept in {home}: {fault.strerror}.") from None


def _kept(job: Path, home: Path) -> Path:
    digest = hashlib.sha256((job / MANIFEST).read_bytes()).hexdigest()[:10]
    kept = home / f"{job.name}-{digest}"
    _hold(kept)
    if not kept.is_dir():
        coming = home / f".{kept.name}.new"
        shutil.rmtree(coming, ignore_errors=True)
        new_folder(coming, "The copy of the job")
        for file in sorted(job.iterdir()):
            write_bytes(coming / file.name, file.read_bytes())
        coming.rename(kept)
    kept.touch()
    others = sorted(home.glob("[!.]*"), key=lambda path: path.stat().st_mtime, reverse=True)
    held = _held(home)
    for old in others[_KEPT:]:
        if old.name not in held:
            shutil.rmtree(old, ignore_errors=True)
    return kept


def _hold(kept: Path) -> None:
    """Mark ``kept`` as what this studio holds, and nothing else."""
    ending = f"-{os.getpid()}"
    for mark in kept.parent.glob(f"{_HELD}*{ending}"):
        mark.unlink(missing_ok=True)
    (kept.parent / f"{_HELD}{kept.name}{ending}").touch()


def _held(home: Path) -> set[str]:
    """The names of the jobs that studios hold; marks of processes that are gone are removed."""
    names = set()
    for mark in home.glob(f"{_HELD}*"):
        name, _, process = mark.name.removeprefix(_HELD).rpartition("-")
        if process.isdigit() and is_alive(int(process)):
            names.add(name)
        else:
            mark.unlink(missing_ok=True)
    return names
