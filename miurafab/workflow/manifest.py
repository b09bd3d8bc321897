"""``manifest.json``: what belongs to a job, each file with its SHA-256.

The schema is ``miurafab-job/1``: ``tool`` (name and version), ``options`` (as a person writes them,
those that are not the defaults), ``files`` {name: sha256} and ``profiles`` {file: sha256}, the
machine and the material that the job was made with. It does not name itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from miurafab.errors import InputError, is_plain
from miurafab.files import Reading, file_name, parse_json, read_bytes, read_text, write_draft
from miurafab.findings import Finding
from miurafab.profiles.shipped import Kind, shipped_directory
from miurafab.version import __version__

LAYOUT, MANIFEST = "layout.json", "manifest.json"
SCHEMA = "miurafab-job/1"
TOOL = f"miurafab {__version__}"
_LONGEST_TOOL = 100


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
        tool = str(document["tool"])
        if not is_plain(tool) or len(tool) > _LONGEST_TOOL:
            raise ValueError("its 'tool' is no name and version")
        return Manifest(tool, options, files, profiles)


def pattern_name(folder: Path, manifest: Manifest) -> str:
    """The file name of the pattern of the job in ``folder``: that which its layout is of."""
    path = folder / LAYOUT
    from miurafab.fabrication.layout import read_head  # slow to load

    name = read_head(read_text(path, InputError, "a layout"), path).pattern_file
    if name not in manifest.files:
        raise InputError(f"{folder / MANIFEST} does not name {name}, the pattern of the layout.")
    return name


def edits(folder: Path, names: Iterable[str]) -> tuple[Finding, ...]:
    """The findings ``edited``: which files of the job in ``folder``, of those ``names`` and of the
    profiles beside them, are not as the manifest says.
    """
    if not (folder / MANIFEST).is_file():
        says = f"{folder} holds no {MANIFEST}, so nothing tells whether its files are as made."
        return (Finding("edited", says, MANIFEST),)
    told = read_manifest(folder).files
    wanted = sorted({*names, *(name for name in told if name.endswith(".toml"))})
    return tuple(_edited((name, folder / name, told.get(name)) for name in wanted))


def all_edits(folder: Path, manifest: Manifest, programs: Iterable[str]) -> Iterator[Finding]:
    """The findings ``edited`` of all files of the ``manifest``, of the ``programs`` that are in
    ``folder``, and of the profiles, of which those that are shipped stay in the package.
    """
    names = [*manifest.files, *sorted(set(programs) - set(manifest.files))]
    yield from _edited((name, folder / name, manifest.files.get(name)) for name in names)
    for name, digest in manifest.profiles.items():
        kind, _, file = name.partition("/")
        own = folder / file
        path = own if own.is_file() else shipped_directory(_kind(kind)) / file
        yield from _edited([(name, path, digest)])


def _kind(text: str) -> Kind:
    kinds: tuple[Kind, ...] = get_args(Kind)
    for kind in kinds:
        if kind == text:
            return kind
    raise InputError(f"The manifest names profiles of the kind '{text}', which there is not.")


def _edited(files: Iterable[tuple[str, Path, str | None]]) -> Iterator[Finding]:
    for name, path, digest in files:
        how = _edit(path, digest)
        if how:
            says = f"{name} {how} since the job was made; make the job again."
            yield Finding("edited", says, name)


def _edit(path: Path, digest: str | None) -> str:
    """What was done to the file ``path`` since its ``digest`` was taken, empty for nothing."""
    if digest is None:
        return "was added"
    if not path.is_file():
        return "is no file any more" if path.exists() else "was removed"
    return "" if sha256(path) == digest else "has changed"


def sha256(path: Path) -> str:
    """The SHA-256 of the file ``path``, in hexadecimal digits."""
    return hashlib.sha256(read_bytes(path, InputError)).hexdigest()
