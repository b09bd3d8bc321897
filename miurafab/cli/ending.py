"""How a command ends: an exit code, and for a failure one sentence on standard error.

With ``--json`` a failure is also one object ``{"error": ..., "kind": ...}`` on standard output.
A sentence of a room below names options in backticks; here they are written ``--min-edge``.

An exception that no command expects comes of a library that is missing or broken, which is told
with the command that mends it. Else it is a defect of miurafab: the traceback goes to a log file,
and the sentence (and ``"log"`` in the object) says where it is.
"""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from miurafab.cli.ctrl_c import CtrlC
from miurafab.errors import (
    BAD_INPUT,
    DEFECT,
    DONE,
    INTERRUPTED,
    InputError,
    MiurafabError,
    shown,
    spell_options,
)
from miurafab.files import state_folder, write_text
from miurafab.version import __version__
from miurafab.workflow.json_text import json_text
from miurafab.workflow.libraries import library_problems


def flag(name: str) -> str:
    """How the command line writes the option ``name``, a field of a dataclass."""
    return "--" + name.replace("_", "-")


def spelled(value: Any) -> Any:
    """``value`` with the options that its sentences name as the command line writes them, and no
    control characters, which a terminal would obey.
    """
    if isinstance(value, str):
        return shown(spell_options(value, flag))
    if isinstance(value, Mapping):
        return {key: spelled(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [spelled(item) for item in value]
    return value


def exit_code_of(command: Callable[[], int]) -> int:
    """Run ``command``, report how it failed if it did, and return the exit code."""
    ctrl_c = CtrlC()
    try:
        with ctrl_c:
            code = command()
            if code == DONE:
                ctrl_c.check()
            return code
    except KeyboardInterrupt:
        return _interrupted()
    except Exception as error:  # noqa: BLE001 - this is the last net: nothing catches it above
        # What fails after Ctrl-C fails because of it, such as a module that was half loaded.
        return _interrupted() if ctrl_c.came else _failed(error)


def _interrupted() -> int:
    return _fail("Interrupted.", "Interrupted", INTERRUPTED)


def _failed(error: Exception) -> int:
    if isinstance(error, MiurafabError):
        return _fail(error.sentence, type(error).__name__, error.exit_code)
    if isinstance(error, OSError):
        return _end_of_os_error(error)
    if not isinstance(error, MemoryError) and (broken := library_problems(error)):
        return _fail(" ".join(broken), "LibraryError", BAD_INPUT)
    return _defect(error)


def _end_of_os_error(error: OSError) -> int:
    if isinstance(error, BrokenPipeError) and _nobody_reads():
        return DONE  # as in 'miurafab surfaces | head'
    context = error.__context__
    while context is not None and not isinstance(context, MiurafabError):
        context = context.__context__
    if context is not None:  # the terminal went away while this was being shown
        return _fail(context.sentence, type(context).__name__, context.exit_code)
    where = f"{error.filename}: " if error.filename else ""
    return _fail(f"{where}{error.strerror or error}.", type(error).__name__, BAD_INPUT)


def _nobody_reads() -> bool:
    """Whether the reader of standard output has gone away, by another attempt to write."""
    try:
        sys.stdout.write("\n")
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return True
    return False


def _defect(error: Exception) -> int:
    kind = type(error).__name__
    reason = " ".join(f"{kind}: {error}".split())[:200].rstrip(".: ")
    log = _write_log(traceback.format_exc())
    where = "no log could be written" if log is None else f"please report it with the log {log}"
    if isinstance(error, MemoryError):
        sentence = f"There is not enough memory for this; {where}."
    else:
        sentence = f"This is a defect of miurafab ({reason}); {where}."
    return _fail(sentence, kind, DEFECT, {"log": None if log is None else str(log)})


def _write_log(trace: str) -> Path | None:
    """The file that holds ``trace`` and what it takes to understand it; None if none can be."""
    text = "\n".join(
        (
            f"miurafab {__version__}",
            f"Python {platform.python_version()} on {platform.platform()}",
            f"Arguments: {sys.argv[1:]!r}",
            "",
            trace,
        )
    )
    name = f"defect-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
    for folder in (state_folder(), Path(tempfile.gettempdir())):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / name
            write_text(path, text)
        except (OSError, InputError):
            continue
        return path
    return None


def _fail(sentence: str, kind: str, exit_code: int, more: Mapping[str, Any] | None = None) -> int:
    sentence = spelled(sentence)
    try:
        if "--json" in sys.argv:
            sys.stdout.write(json_text({"error": sentence, "kind": kind, **(more or {})}) + "\n")
            sys.stdout.flush()
        sys.stderr.write(f"miurafab: {sentence}\n")
    except OSError:  # nobody is there to read it; the exit code still says it
        os._exit(exit_code)
    return exit_code
