"""Who has a port: a small file for each port that a session holds, in the user's state folder.

An operating system says that a port is taken, and only Linux says by whom (``/proc``). A sending
process has no name that a person knows, either. So a session writes who holds the port: the command
that a person typed, its process, since when, and the process that has the port open. The file goes
when the session is closed. One whose process is gone counts for nothing, so a crash leaves no lie.

The folder is ``ports`` in that of :func:`~miurafab.files.state_folder`.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from miurafab.errors import InputError
from miurafab.files import state_folder, write_text

_IN_SESSION = {
    "jog": "jog it in that session with the arrow keys",
    "home": "home it in that session with h",
    "unlock": "unlock it in that session with u",
    "frame": "trace the frame in that session with f",
    "cut": "start the job in that session with a and s",
    "console": "talk to it in that session after a colon",
}
"""Where to do the same, by the word of the second command."""


@dataclass(frozen=True)
class Owner:
    """A session that holds a port: the ``command`` and ``process`` that a person started, ``since``
    when (seconds of the epoch), and the process that has the port open, its ``holder``.
    """

    command: str
    process: int
    since: float
    holder: int

    def __str__(self) -> str:
        at = time.localtime(self.since)
        day = "" if at[:3] == time.localtime()[:3] else time.strftime("%d %B, ", at)
        return f"process {self.process} ({self.command}), since {day}{time.strftime('%H:%M', at)}"

    @property
    def way_out(self) -> str:
        """Where to do what this process wanted the port for."""
        if "studio" in self.command.split():
            return "do it there, on the tab Machine"
        if "machine open" not in self.command:
            return "wait for its end, or stop it there"
        here = this_command().split()
        word = next((word for word in here if word in _IN_SESSION), None)
        return _IN_SESSION[word] if word else "do it in that session (? lists its keys)"


def this_command() -> str:
    """The command line of this process, as a person typed it."""
    name, *words = sys.argv or [""]
    path = Path(name)
    name = path.parent.name if path.name == "__main__.py" else path.stem or "python"
    return " ".join((name, *words))[:100]


def this_owner() -> Owner:
    """This process as the owner of a port from now on."""
    return Owner(this_command(), os.getpid(), time.time(), os.getpid())


def claim(port: str, owner: Owner) -> Callable[[], None]:
    """Write that ``owner`` has ``port``; returns what takes that back.

    A machine in memory is nobody else's to want. A folder that cannot be written is no reason not
    to cut: then nobody is named.
    """
    path = _file(port)
    if "://" not in port and not Path(port).exists() and os.name == "posix":
        return lambda: None
    with contextlib.suppress(OSError, InputError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(asdict(owner)))

    def release() -> None:
        with contextlib.suppress(OSError):
            if owner_of(port) == owner:
                path.unlink()

    return release


def owner_of(port: str) -> Owner | None:
    """The session that holds ``port``, None if none says so or its process is gone."""
    try:
        owner = Owner(**json.loads(_file(port).read_text("utf-8")))
        return owner if str(owner) and is_alive(owner.holder) else None
    except (OSError, ValueError, TypeError, OverflowError):  # a damaged file names nobody
        return None


def holder_of(port: str) -> str:
    """Who has ``port`` and where to do the same, as a part of a sentence: the session that says so,
    or on Linux whoever has the device open (``/proc``).
    """
    owner = owner_of(port)
    if owner is not None:
        return f", {owner}; {owner.way_out}"
    device = os.path.realpath(port)
    for link in Path("/proc").glob("[1-9]*/fd/*"):
        process = link.parent.parent
        try:
            if os.path.realpath(link) == device and process.name != str(os.getpid()):
                words = (process / "cmdline").read_bytes().decode("utf-8", "replace").split("\0")
                return f", process {process.name} ({' '.join(words).strip()[:100]}); do it there"
        except OSError:  # it has ended, or belongs to somebody else
            continue
    return "; do it there"


def _file(port: str) -> Path:
    place = port if "://" in port else os.path.realpath(port)
    name = hashlib.sha256(place.encode("utf-8")).hexdigest()[:16]
    return state_folder() / "ports" / f"{name}.json"


def is_alive(process: int) -> bool:
    """Whether there is a process of this number."""
    if sys.platform == "win32":
        import ctypes

        # os.kill ends a process there. PROCESS_QUERY_LIMITED_INFORMATION (winnt.h).
        handle = ctypes.windll.kernel32.OpenProcess(0x1000, False, process)
        if handle:
            ctypes.windll.kernel32.CloseHandle(handle)
        return bool(handle)
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # it lives, and is somebody else's
        return True
    return True
