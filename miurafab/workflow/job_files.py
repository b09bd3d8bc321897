"""The files of a job, put in place all at once: whole, or not at all.

A full disk, an error or a power loss leaves the earlier job or the new one
(:mod:`~miurafab.workflow.whole_folder`), and never a half-written file that a machine could run.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from miurafab.errors import InputError
from miurafab.files import Reading, file_name, parse_json, read_bytes, read_text, write_draft
from miurafab.profiles import MachineProfile, Material, load_machine, load_material
from miurafab.profiles.shipped import Kind, shipped_directory
from miurafab.workflow.drawings import GUIDE, GUIDE_PAGE, JIG, PICTURE, is_ending
from miurafab.workflow.manifest import LAYOUT, MANIFEST
from miurafab.workflow.whole_folder import put_in_place, settle, whole_folder

GUIDES = (GUIDE, GUIDE_PAGE, JIG, "calibration.pdf", "calibration.json")
"""What explains a job; one made in the place of another leaves none of them."""
_SHEET = re.compile(r"sheet-[0-9]{2,}(-back)?")
"""The names of programs, which begin those of all that is drawn."""
OPENED, CAPPED = "-opened", "-capped"
"""What stands behind the name of a pattern that was opened, or capped, for its job."""
_CHANGED = re.compile(rf"({OPENED}|{CAPPED})\.fold$")
_ENDINGS = (".nc", ".plt", ".svg")
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


@contextmanager
def job_files(directory: Path) -> Iterator[Path]:
    """Where to write the files of a job meant for ``directory``, which is made if need be.

    At the end of the block they are moved there; sheets, drawings and guides of an earlier job
    are removed, and files that are no part of it left alone. Raises
    :class:`~miurafab.errors.InputError` where the directory holds something else than a job, or
    something that is no part of it is in the way, or it cannot be written.
    """
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory} is a file; a job needs a directory.")
    made = [each for each in (directory, *directory.parents) if not each.exists()]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with whole_folder(directory, _is_of_job) as staging:
            drawn, copies = _earlier(directory)
            yield staging
            _leave_alone(staging, directory, drawn | copies)
            put_in_place(directory, drawn, (LAYOUT, MANIFEST), LAYOUT)
    except OSError as fault:
        if not _of_writing(fault, directory):
            raise
        raise InputError(f"{directory} cannot be written: {fault.strerror}.") from None
    finally:
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
    layout = directory / LAYOUT
    if not layout.exists():
        strangers = sorted(directory.glob("*.nc")) + sorted(directory.glob("*.plt"))
        if strangers:
            raise InputError(
                f"{directory} holds {strangers[0].name}, which no layout there accounts for; "
                "choose another directory or remove it."
            )
        return set(), set()
    kind = "a layout of this version; choose another directory or remove it"
    text = read_text(layout, InputError, kind)
    with Reading(layout, kind, InputError):
        made = parse_json(text)
        names = [
            sheet[key] for sheet in made["sheets"] for key in ("name", "back") if sheet.get(key)
        ]
        if not all(map(_SHEET.fullmatch, names)):
            raise ValueError("it names a sheet that no job has")
        copies = [made["pattern"]["file"], f"{made['machine']}.toml", f"{made['material']}.toml"]
        copies.append(_CHANGED.sub(".fold", copies[0]))  # the pattern as it was fitted
        known = {file_name(name, str(layout)) for name in copies}
    drawn = {
        path.name
        for path in directory.iterdir()
        for name in names
        if path.name.startswith(name) and _is_drawn(path.name[len(name) :])
    }
    return drawn | {LAYOUT, MANIFEST, PICTURE, *GUIDES}, known


def _is_of_job(name: str) -> bool:
    """Whether ``name`` is that of a file that every job may have, and that another removes."""
    sheet = _SHEET.match(name)
    drawn = sheet is not None and _is_drawn(name[sheet.end() :])
    return drawn or name in (LAYOUT, MANIFEST, PICTURE, *GUIDES)


def _is_drawn(ending: str) -> bool:
    return ending in _ENDINGS or is_ending(ending)


def settle_job(directory: Path) -> None:
    """Finish what a process that died left of a job in ``directory``, before it is read.

    Raises :class:`~miurafab.errors.InputError` where that cannot be done, and for a link by which
    something outside the job would be read or written.
    """
    if directory.is_dir():
        _stay_inside(directory)
        settle(directory, _is_of_job)


def _stay_inside(directory: Path) -> None:
    here = Path(os.path.realpath(directory))
    for path in sorted(directory.iterdir()):  # realpath, since Path.resolve raises for a ring
        if path.is_symlink() and here not in Path(os.path.realpath(path)).parents:
            raise InputError(
                f"{path} is a link out of the job; put the file itself there, or remove the link."
            )


def _leave_alone(staging: Path, directory: Path, earlier: set[str]) -> None:
    """Raise where a file in ``staging`` would take the place of one of ``directory`` that is not
    among those of an ``earlier`` job.
    """
    for name in sorted(path.name for path in staging.iterdir()):
        there = directory / name
        if not there.exists() or name in earlier:
            continue
        if not there.is_file() or read_bytes(there, InputError) != (staging / name).read_bytes():
            raise InputError(
                f"{there} is no part of a job and would be overwritten; move it away, or choose "
                "another directory."
            )


def job_machine(name: str, folder: Path | None) -> MachineProfile:
    """The machine that a job names: the user's own profile beside the job, else a known one."""
    return load_machine(_beside(name, folder))


def job_material(name: str, folder: Path | None) -> Material:
    """The material that a job names: the user's own beside the job, else a known one."""
    return load_material(_beside(name, folder))


def _beside(name: str, folder: Path | None) -> str | Path:
    own = None if folder is None else folder / f"{file_name(name, 'The job')}.toml"
    return own if own is not None and own.is_file() else name


def keep_profiles(machine: Path, material: Path, directory: Path, staging: Path) -> None:
    """Copy the files of a machine and a material into a job meant for ``directory``, if they are
    the user's own; one that was written into ``staging`` stays there.

    Raises :class:`~miurafab.errors.InputError` where two would have one name.
    """
    kinds: tuple[tuple[Kind, Path], ...] = (("firmware_profiles", machine), ("materials", material))
    for kind, path in kinds:
        file_name(path.name, "The job")
        there = directory / path.name
        if path.resolve().parent == shipped_directory(kind).resolve():
            if there.exists():
                raise InputError(
                    f"{there} would stand in for the shipped {path.stem}; remove it, or give its "
                    "path to use it."
                )
        elif path != staging / path.name and (staging / path.name).exists():
            raise InputError(
                f"The machine and the material are both called {path.stem}; rename one of them."
            )
        elif path.parent != staging:
            write_draft(staging / path.name, read_bytes(path, InputError))
