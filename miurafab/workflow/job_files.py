"""The files of a job, put in place all at once: whole, or not at all.

They are written to a directory of their own inside the job's. Only when the last one is on the disk
do they take the places of those of an earlier job, ``layout.json`` last; so a full disk or an error
in between leaves what was there as it was, and never a half-written file that a machine could run.
"""

from __future__ import annotations

import errno
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from miurafab.errors import InputError
from miurafab.profiles import MachineProfile, Material, load_machine, load_material
from miurafab.profiles.shipped import Kind, shipped_directory
from miurafab.workflow.drawings import ENDINGS, PICTURE
from miurafab.workflow.manifest import MANIFEST

LAYOUT = "layout.json"
GUIDES = ("assembly.pdf", "calibration.pdf", "calibration.json")
"""What explains a job; one made in the place of another leaves none of them."""
_UNFINISHED = ".unfinished"
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


@contextmanager
def job_files(directory: Path) -> Iterator[Path]:
    """Where to write the files of a job meant for ``directory``, which is made if need be.

    At the end of the block they are moved there; sheets, drawings and guides of an earlier job
    are removed, and files that are no part of it left alone. Raises
    :class:`~miurafab.errors.InputError` where the directory holds something else than a job, or
    something that is no part of it is in the way, or it cannot be written.
    """
    sheets, copies = _earlier(directory)
    made = [each for each in (directory, *directory.parents) if not each.exists()]
    staging = directory / _UNFINISHED
    try:
        shutil.rmtree(staging, ignore_errors=True)
        staging.mkdir(parents=True)
        yield staging
        _put_in_place(staging, directory, sheets, copies)
    except OSError as fault:
        if not _of_writing(fault, directory):
            raise
        raise InputError(f"{directory} cannot be written: {fault.strerror}.") from None
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        for each in made:
            if each.is_dir() and not any(each.iterdir()):
                each.rmdir()


def _of_writing(fault: OSError, directory: Path) -> bool:
    """Whether ``fault`` came of a file in ``directory``; a full disk does not name the file."""
    if fault.filename is None:
        return fault.errno in _NO_ROOM
    file = Path(fault.filename)
    return directory == file or directory in file.parents


def _earlier(directory: Path) -> tuple[set[str], set[str]]:
    """The names of the files of the job that is in ``directory``: those that are drawn, and those
    that are copies of the user's.
    """
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory} is a file; a job needs a directory.")
    layout = directory / LAYOUT
    if not layout.exists():
        strangers = sorted(directory.glob("*.nc")) + sorted(directory.glob("*.plt"))
        if strangers:
            raise InputError(
                f"{directory} holds {strangers[0].name}, which no layout there accounts for; "
                "choose another directory or remove it."
            )
        return set(), set()
    try:
        made = json.loads(layout.read_text(encoding="utf-8"))
        sheets = [str(sheet["name"]) for sheet in made["sheets"]]
        sheets += [str(sheet["back"]) for sheet in made["sheets"] if sheet.get("back")]
        copies = {str(made["pattern"]["file"])}
        copies |= {f"{made[kind]}.toml" for kind in ("machine", "material")}
    except (ValueError, KeyError, TypeError):
        raise InputError(
            f"{layout} is not a layout of this version; choose another directory or remove it."
        ) from None
    drawn = {
        f"{Path(name).name}{ending}"
        for name in sheets
        for ending in (".nc", ".plt", ".svg", *ENDINGS)
    }
    return drawn | {LAYOUT, MANIFEST, PICTURE, *GUIDES}, copies


def _put_in_place(staging: Path, directory: Path, drawn: set[str], copies: set[str]) -> None:
    """Move all files of ``staging`` into ``directory``, in the places of those ``drawn`` and
    ``copies`` made for an earlier job.
    """
    fresh = sorted((path.name for path in staging.iterdir()), key=lambda name: name == LAYOUT)
    for name in fresh:
        there = directory / name
        if not there.exists() or name in drawn | copies:
            continue
        if there.is_dir() or there.read_bytes() != (staging / name).read_bytes():
            raise InputError(
                f"{there} is no part of a job and would be overwritten; move it away, or choose "
                "another directory."
            )
    (directory / LAYOUT).unlink(missing_ok=True)
    for name in drawn:
        (directory / name).unlink(missing_ok=True)
    for name in fresh:
        (staging / name).replace(directory / name)


def job_machine(name: str, folder: Path | None) -> MachineProfile:
    """The machine that a job names: the user's own profile beside the job, else a known one."""
    return load_machine(_beside(name, folder))


def job_material(name: str, folder: Path | None) -> Material:
    """The material that a job names: the user's own beside the job, else a known one."""
    return load_material(_beside(name, folder))


def _beside(name: str, folder: Path | None) -> str | Path:
    own = None if folder is None else folder / f"{name}.toml"
    return own if own is not None and own.is_file() else name


def keep_profiles(machine: Path, material: Path, directory: Path, staging: Path) -> None:
    """Copy the files of a machine and a material into a job meant for ``directory``, if they are
    the user's own.

    Raises :class:`~miurafab.errors.InputError` where two would have one name.
    """
    kinds: tuple[tuple[Kind, Path], ...] = (("firmware_profiles", machine), ("materials", material))
    for kind, path in kinds:
        there = directory / path.name
        if path.resolve().parent == shipped_directory(kind).resolve():
            if there.exists():
                raise InputError(
                    f"{there} would stand in for the shipped {path.stem}; remove it, or give its "
                    "path to use it."
                )
        elif (staging / path.name).exists():
            raise InputError(
                f"The machine and the material are both called {path.stem}; rename one of them."
            )
        else:
            shutil.copyfile(path, staging / path.name)
