"""Safe names for uploaded files: no path, blank, option or device."""

from __future__ import annotations

import re
import unicodedata

_LONGEST = 60
_DEVICES = re.compile(r"(con|prn|aux|nul|(com|lpt)[0-9])(\..*)?", re.IGNORECASE)


def safe_stem(name: str) -> str:
    """The part of ``name`` before its ending, in letters, digits, dots, dashes and underscores.

    The result is never empty, begins with a letter or digit, and names no device of Windows.
    """
    base, suffix = _parted(name)
    stem = unicodedata.normalize("NFKD", base or suffix)
    plain = stem.encode("ascii", "ignore").decode("ascii")
    words = re.sub(r"[^A-Za-z0-9._-]+", "-", plain)[:_LONGEST].strip("-._")
    return f"file-{words}".strip("-") if not words or _DEVICES.fullmatch(words) else words


def suffix_of(name: str) -> str:
    """The ending of ``name`` with its dot, in lower case; empty if it has none.

    The ending of a compressed file is that of its content too, ``.stl.gz``.
    """
    return _parted(name)[1].lower()


def _parted(name: str) -> tuple[str, str]:
    base = re.split(r"[/\\]", name)[-1]
    found = re.search(r"(\.[^.]*\.gz|\.[^.]*)\Z", base, re.IGNORECASE)
    return (base[: found.start()], found[0]) if found else (base, "")
