"""Child processes run the code of this installation, and nothing from the working directory.

``python -c`` and ``python -m`` search the working directory before the standard library, so that a
``json.py`` beside a pattern would run in place of Python's own. A child is therefore started in
Python's isolated mode (``-I``), which searches neither it nor ``PYTHONPATH``. It is given the
search path of this process without the working directory, and the folder of the package last, but
before any other copy of the package.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_ROOT = str(Path(__file__).resolve().parents[1])


def python_command(module: str) -> list[str]:
    """The command line of a child that runs the function ``main`` of ``module``."""
    try:
        here = Path.cwd().resolve()
    except FileNotFoundError:  # it was removed: there is nothing in it
        here = None
    search = [place for place in sys.path if place and Path(place).resolve() != here]
    if _ROOT not in search:
        copies = [(Path(place) / "miurafab").is_dir() for place in search]
        search.insert(copies.index(True) if True in copies else len(search), _ROOT)
    code = f"import sys; sys.path[:] = {search!r}; from {module} import main; main()"
    return [sys.executable, "-I", "-c", code]


@contextmanager
def safe_path() -> Iterator[None]:
    """Processes that ``multiprocessing`` starts here do not search the working directory.

    It writes their command lines itself, and so the environment says it (``PYTHONSAFEPATH``).
    """
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before
