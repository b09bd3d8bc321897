"""The libraries that miurafab needs: whether each is there, new enough, and loads.

This module imports none of them, so that it can tell of any that is broken.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import re
import shlex
import sys
from pathlib import Path

_MODULES = {"fonttools": "fontTools", "pillow": "PIL", "pyserial": "serial"}  # others: their name


def library_problems(fault: Exception) -> tuple[str, ...]:
    """What is wrong with the libraries, which may be why ``fault`` was raised: one sentence each
    with the command that mends it.
    """
    try:
        return tuple(trouble for _, _, trouble in examined_libraries() if trouble)
    except importlib.metadata.PackageNotFoundError:
        return (not_installed(),) if isinstance(fault, ImportError) else ()


def not_installed() -> str:
    """What to do with a checkout that nothing was installed from."""
    checkout = shlex.quote(str(Path(__file__).parents[2]))
    return f"miurafab runs from its source and is not installed; run {pip_install()} {checkout}."


def examined_libraries() -> list[tuple[str, str, str | None]]:
    """Name, version and trouble of each library that an installed miurafab needs.

    Raises ``PackageNotFoundError`` where miurafab runs from its source and is not installed.
    """
    needed = _needs("miurafab")
    found: dict[str, tuple[str, str | None]] = {}

    def examine(name: str) -> None:
        found[name] = "", None  # ends a circle
        others = [other for other in _needs(name) if other in needed]
        for other in others:
            if other not in found:
                examine(other)
        whole = not any(found[other][1] for other in others)
        found[name] = _library(*needed[name], loads=whole)

    for name in needed:
        if name not in found:
            examine(name)
    return [(needed[name][0], *found[name]) for name in sorted(found)]


def _needs(package: str) -> dict[str, tuple[str, str]]:
    """What ``package`` needs without any extra, by plain name: name and least version.

    From lines such as ``numpy>=2.1``; nothing for a library that is not there.
    """
    try:
        lines = importlib.metadata.requires(package) or []
    except importlib.metadata.PackageNotFoundError:
        if package == "miurafab":
            raise
        return {}
    always = (line for line in lines if "extra ==" not in line)
    found = (re.match(r"([\w.-]+)(?:\[.*\])?\s*(?:.*?>=([\w.]+))?", line) for line in always)
    return {line[1].lower().replace("_", "-"): (line[1], line[2] or "") for line in found if line}


def _library(name: str, least: str, *, loads: bool) -> tuple[str, str | None]:
    """The version of the library ``name``, and what is wrong with it; it is loaded only where what
    it needs ``loads``, so that the blame falls on the library that is broken.
    """
    try:
        version = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "missing", f"{name} is not installed; run {pip_install()} {name}."
    if _numbers(version) < _numbers(least):
        return version, f"{name} is {version}; run {pip_install()} --upgrade '{name}>={least}'."
    if not loads:
        return version, None
    try:
        importlib.import_module(_MODULES.get(name.lower(), name.replace("-", "_")))
    except (ImportError, OSError, ValueError) as fault:  # ValueError: built for another numpy
        told = " ".join(str(fault).split())
        return (
            version,
            f"{name} does not load ({told}); run {pip_install()} --force-reinstall {name}.",
        )
    return version, None


def pip_install() -> str:
    """What installs into this environment, which has no pip of its own where uv made it."""
    python = shlex.quote(sys.executable)
    if importlib.util.find_spec("pip") is None:
        return f"uv pip install --python {python}"
    return f"{python} -m pip install"


def _numbers(version: str) -> tuple[int, ...]:
    """The leading numbers of a version: (2, 1) of ``2.1rc1``."""
    found = re.match(r"\d+(?:\.\d+)*", version)
    return tuple(map(int, found[0].split("."))) if found else ()
