"""``manifest.json``: what belongs to a job, each file with its SHA-256.

The schema is ``miurafab-job/1``: ``tool`` (name and version), ``options`` (as a person writes them,
those that are not the defaults), ``files`` {name: sha256} and ``profiles`` {file: sha256}, the
machine and the material that the job was made with. It does not name itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from miurafab.errors import InputError
from miurafab.files import Reading, file_name, parse_json, read_bytes, read_text, write_draft
from miurafab.findings import Finding
from miurafab.profiles.shipped import Kind
from miurafab.version import __version__

MANIFEST = "manifest.json"
SCHEMA = "miurafab-job/1"
TOOL = f"miurafab {__version__}"


@dataclass(frozen=True)
class Manifest:
    """What a ``manifest.json`` says."""

    tool: str
    options: Mapping[str, Any]
    files: Mapping[str, str]
    profiles: Mapping[str, str]


def write_manifest(
    staging: Path,
    besides: Iterable[Path],
    options: Mapping[str, Any],
    profiles: Mapping[Kind, Path],
) -> None:
    """Write the manifest of the files in ``staging`` and of those ``besides`` that the job uses
    where they are.
    """
    files = {path.name: path for path in (*staging.iterdir(), *besides)}
    document = {
        "schema": SCHEMA,
        "tool": TOOL,
        "options": dict(options),
        "files": {name: sha256(files[name]) for name in sorted(files)},
        "profiles": {f"{kind}/{path.name}": sha256(path) for kind, path in profiles.items()},
    }
    text = json.dumps(document, indent=1) + "\n"
    write_draft(staging / MANIFEST, text)


def read_manifest(directory: Path) -> Manifest:
    """The manifest of a job. Raises :class:`~miurafab.errors.InputError` if it cannot be read."""
    path = directory / MANIFEST
    text = read_text(path, InputError, "a manifest")
    with Reading(path, "a manifest that 'miurafab sheets' wrote; make the job again", InputError):
        document = parse_json(text)
        if document["schema"] != SCHEMA:
            raise InputError(
                f"{path} has the schema {document['schema']!r}; this version reads '{SCHEMA}'."
            )
        tables = (document[name] for name in ("options", "files", "profiles"))
        options, files, profiles = map(dict, tables)
        for name in files:
            file_name(name, str(path))
        for name in profiles:
            file_name(name.partition("/")[2], str(path))
        return Manifest(str(document["tool"]), options, files, profiles)


def pattern_name(folder: Path, manifest: Manifest) -> str:
    """The file name of the pattern of the job in ``folder``."""
    patterns = [name for name in manifest.files if name.endswith(".fold")]
    if len(patterns) != 1:
        raise InputError(f"{folder / MANIFEST} names {len(patterns)} patterns; a job has one.")
    return patterns[0]


def edits(folder: Path, names: Iterable[str]) -> tuple[Finding, ...]:
    """The findings ``edited``: which files of the job in ``folder``, of those ``names`` and of its
    profiles, are not as the manifest says.
    """
    if not (folder / MANIFEST).is_file():
        says = f"{folder} holds no {MANIFEST}, so nothing tells whether its files are as made."
        return (Finding("edited", says, MANIFEST),)
    told = read_manifest(folder).files
    wanted = sorted({*names, *(name for name in told if name.endswith(".toml"))})
    return tuple(
        Finding("edited", f"{name} {how} since the job was made; make the job again.", name)
        for name in wanted
        if (how := _edit(folder / name, told.get(name)))
    )


def _edit(path: Path, digest: str | None) -> str:
    """What was done to the file ``path`` since its ``digest`` was taken, empty for nothing."""
    if digest is None:
        return "was added"
    if not path.is_file():
        return "was removed"
    return "" if sha256(path) == digest else "has changed"


def sha256(path: Path) -> str:
    """The SHA-256 of the file ``path``, in hexadecimal digits."""
    return hashlib.sha256(read_bytes(path, InputError)).hexdigest()
