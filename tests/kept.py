"""A fit or a time estimate that the same run of the tests has made already is not made again.

Tests and examples in print ask for the same few sheets and jobs over and over. A fit gives the same
bytes each time, and so does an estimate, so that the answer may be kept: in the folder of the run,
for all workers, under the digest of the whole request. What is read from there is made of objects
of its own, so that a test may change it.

Made anew is all of a process without other workers (``pytest -n 0``, ``make mutants``), of programs
that a test starts, in tests of fits and of motion (:data:`ABOUT`), and in tests marked ``anew``, of
which one holds that a fit gives the same bytes; and a fit with a limit of time.
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
ABOUT = (TESTS / "origami" / "fitting", TESTS / "motion", TESTS / "simulate")


@dataclass(frozen=True)
class Kept:
    """Stands before ``make``, whose answers are kept in ``folder``; ``running`` gives the test that
    runs.
    """

    folder: Path
    running: Callable[[], pytest.Item]
    make: Callable[..., Any]

    def find(self, digest: str) -> Any:
        """The answer that is kept under ``digest``, or None."""
        kept = next(self.folder.glob(f"{digest}-*"), None)
        return None if kept is None else pickle.loads(kept.read_bytes())

    def keep(self, digest: str, result: Any) -> Any:
        """Keep ``result``; the first test gets what all others get."""
        written = pickle.dumps(result)
        # whole or not at all; two workers that make the same thing at once write a file each
        own = uuid.uuid4().hex
        begun = self.folder / f"begun-{own}"
        begun.write_bytes(written)
        begun.rename(self.folder / f"{digest}-{own}")
        return pickle.loads(written)


class KeptFits(Kept):
    """``make`` is ``_fitted`` of ``miurafab/origami/fitting/fit.py``: every fit goes through it."""

    def __call__(self, request: Any, on_progress: Any, search: type) -> Any:
        if request.timeout is not None or made_anew(self.running()):
            return self.make(request, on_progress, search)
        digest = digest_of(request, search.__name__)
        kept = self.find(digest)
        if kept is not None:
            if on_progress is not None:
                on_progress(1.0, "done")
            return kept
        result = self.make(request, on_progress, search)
        if result.status == "interrupted":
            return result
        return self.keep(digest, result)


class KeptTimes(Kept):
    """``make`` is ``estimate`` of ``miurafab/motion/estimate.py``, where a module calls it."""

    def __call__(
        self, program: Any, parameters: Any, link: Any = None, on_share: Any = None
    ) -> Any:
        if made_anew(self.running()):
            return self.make(program, parameters, link, on_share)
        digest = digest_of(program, parameters, link)
        kept = self.find(digest)
        if kept is not None:
            if on_share is not None:
                on_share(1.0)
            return kept
        return self.keep(digest, self.make(program, parameters, link, on_share))


def digest_of(*asked: Any) -> str:
    """The same for the same request."""
    return hashlib.sha256(cloudpickle.dumps(asked)).hexdigest()


def made_anew(test: pytest.Item) -> bool:
    """Whether all that ``test`` asks for is to be made."""
    about = any(folder in test.path.parents for folder in ABOUT)
    return about or test.get_closest_marker("anew") is not None
