"""What the verbs take for a pattern: the value itself, the result of a fit, or a file."""

from __future__ import annotations

import os
import reprlib
from dataclasses import replace

from miurafab.errors import InputError, PatternError
from miurafab.files import AnyPath
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.result import FitResult
from miurafab.origami.formats.files import load
from miurafab.origami.verify import Audit, audit
from miurafab.surfaces.description import described_surface

PatternLike = CreasePattern | FitResult | AnyPath


def as_pattern(pattern: object) -> CreasePattern:
    """The pattern that ``pattern`` is or names.

    Raises :class:`~miurafab.errors.PatternError` for a fit without a sheet and for a file without a
    pattern, :class:`~miurafab.errors.InputError` for anything else.
    """
    if isinstance(pattern, CreasePattern):
        return pattern
    if isinstance(pattern, FitResult):
        if pattern.pattern is None:
            raise PatternError(f"The fit found no sheet: {pattern.advice}")
        return pattern.pattern
    if isinstance(pattern, str | os.PathLike):
        return load(pattern)
    raise InputError(
        f"{reprlib.repr(pattern)} is no pattern; give a pattern, the result of a fit, or the path "
        "of a pattern file."
    )


@verb
def check(pattern: PatternLike) -> Audit:
    """Recompute every invariant of a pattern, and its distance from its target.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        The pattern, or a file that :func:`load` reads.

    Returns
    -------
    Audit
        ``valid``, ``measurements`` under the names of the fit report, and ``findings``.

    Raises
    ------
    PatternError
        For a file that holds no pattern.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.check(mf.fit("plane", facets=(4, 4)))
    <Audit valid: 16 facets>
    """
    found = as_pattern(pattern)
    surface, missing = described_surface(found.target)
    checked = audit(found, surface)
    return replace(checked, findings=missing + checked.findings)
