"""A fit that the same run of the tests has made already is not made again.

Tests and examples in print ask for the same few sheets over and over. A fit gives the same bytes
each time, so that its answer may be kept: in the folder of the run, for all workers, under the
digest of the whole request. What is read from there is made of objects of its own, so that a test
may change it.

Made anew are the fits of a process without other workers (``pytest -n 0``, ``make mutants``), of
programs that a test starts, with a limit of time, in tests of fits (:data:`ABOUT_FITS`), and in
tests marked ``anew``, of which one holds that a fit gives the same bytes.
"""

from __future__ import annotations

import hashlib
import pickle
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cloudpickle  # a request holds functions, which pickle cannot write
import pytest

TESTS = Path(__file__).parent
ABOUT_FITS = TESTS / "origami" / "fitting"


@dataclass(frozen=True)
class KeptFits:
    """Stands before ``make``, which is ``_fitted`` of ``miurafab/origami/fitting/fit.py``: every
    fit goes through it. Fits are kept in ``folder``; ``running`` gives the test that runs.
    """

    folder: Path
    running: Callable[[], pytest.Item]
    make: Callable[..., Any]

    def __call__(self, request: Any, on_progress: Any, search: type) -> Any:
        if request.timeout is not None or made_anew(self.running()):
            return self.make(request, on_progress, search)
        asked = hashlib.sha256(cloudpickle.dumps((request, search.__name__))).hexdigest()
        kept = next(self.folder.glob(f"{asked}-*"), None)
        if kept is not None:
            if on_progress is not None:
                on_progress(1.0, "done")
            return pickle.loads(kept.read_bytes())
        result = self.make(request, on_progress, search)
        if result.status == "interrupted":
            return result
        written = pickle.dumps(result)
        # whole or not at all; two workers that make the same fit at once write a file each
        own = uuid.uuid4().hex
        begun = self.folder / f"begun-{own}"
        begun.write_bytes(written)
        begun.rename(self.folder / f"{asked}-{own}")
        return pickle.loads(written)  # the first test gets what all others get


def made_anew(test: pytest.Item) -> bool:
    """Whether the fits of ``test`` are to be made."""
    return ABOUT_FITS in test.path.parents or test.get_closest_marker("anew") is not None
