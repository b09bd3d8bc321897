"""What the verbs take for a pattern: the value itself, the result of a fit, or a file."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from miurafab.errors import InputError, PatternError
from miurafab.files import AnyPath, Reading, as_path
from miurafab.findings import Finding, refusals
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.result import FitResult
from miurafab.origami.formats.files import load
from miurafab.origami.formats.fold import read_further_frames
from miurafab.origami.formats.fold_states import FurtherFrame
from miurafab.origami.formats.two_forms import ROUNDED
from miurafab.origami.judge_frames import judge_frames
from miurafab.origami.judge_pattern import gather, judge
from miurafab.origami.verify import Audit, audit

_SHAPES = frozenset({"degenerate-edge", "bow-tie", "overlap", "self-intersection"})
_WISHES = frozenset({"flat-folding", "closure"})
_RESIDUALS = frozenset({"planarity", "developability", "isometry"})

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


def sound_pattern(pattern: object) -> CreasePattern:
    """The pattern that ``pattern`` is or names, if it can be made: what is cut goes through here.

    The invariants decide, and not how its fit ended: a sheet that only missed a limit of the fit is
    exact and can be made.

    Raises what :func:`as_pattern` raises, and :class:`~miurafab.errors.PatternError` for a pattern
    that :func:`check` would refuse.
    """
    found = as_pattern(pattern)
    _refuse(refusals(judge(found, gather(found))), _called(pattern))
    return found


def consistent_pattern(pattern: object) -> CreasePattern:
    """The pattern that ``pattern`` is or names, if it does not contradict itself: what is told of a
    pattern goes through here.

    A shape that cannot be made can be shown, and forms that differ by the rounding of a file are
    one. Raises what :func:`sound_pattern` raises.
    """
    found = as_pattern(pattern)
    require_consistent(found, _called(pattern))
    return found


def movable_pattern(pattern: object) -> CreasePattern:
    """The pattern that ``pattern`` is or names, if its mountains and valleys can be tried.

    Without a folded form the fold angles are a wish, which a motion need not reach; so they may
    leave vertices open. Raises what :func:`consistent_pattern` raises otherwise.
    """
    found = as_pattern(pattern)
    require_consistent(found, _called(pattern), wishes_of(found))
    return found


def wishes_of(pattern: CreasePattern) -> frozenset[str]:
    """The codes of findings that are no contradiction of ``pattern``: without a folded form its
    fold angles are a wish.
    """
    return _WISHES if pattern.folded_coords is None else frozenset()


def require_consistent(
    pattern: CreasePattern, name: str, allowed: frozenset[str] = frozenset()
) -> None:
    """Raise :class:`~miurafab.errors.PatternError` if ``pattern`` contradicts itself.

    Findings whose codes are ``allowed`` do not count.
    """
    evidence = gather(pattern)
    shown = _SHAPES | allowed
    if evidence.residuals is not None and evidence.residuals.worst <= ROUNDED:
        shown |= _RESIDUALS
    _refuse([each for each in refusals(judge(pattern, evidence)) if each.code not in shown], name)


def _called(pattern: object) -> str:
    return os.fspath(pattern) if isinstance(pattern, str | os.PathLike) else "The pattern"


def _refuse(faults: Sequence[Finding], name: str) -> None:
    if faults:
        more = f" Of {len(faults)} faults this is the first." if len(faults) > 1 else ""
        raise PatternError(
            f"{name} does not hold, and nothing is made of it: {faults[0].sentence}{more} "
            "'miurafab check' names all."
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

    from miurafab.surfaces.description import described_surface

    named = os.fspath(pattern) if isinstance(pattern, str | os.PathLike) else "The pattern"
    with Reading(named, "a pattern with a target", PatternError):
        surface, missing = described_surface(found.target)
    checked = audit(found, surface)
    if not found.target:
        missing = (Finding("no-target", "The pattern names no target, so distances are left out."),)
    frames = _further_frames(pattern)
    states = tuple(judge_frames(found, frames))
    proved = checked.proved
    if frames and not states:
        proved += (f"Each of the {len(frames)} further frames is a state of the sheet.",)
    findings = found.told + missing + checked.findings + states
    return replace(checked, findings=findings, proved=proved)


def _further_frames(pattern: PatternLike) -> tuple[FurtherFrame, ...]:
    """The frames of the file that ``pattern`` names beside the flat pattern and its folded form."""
    if not isinstance(pattern, str | os.PathLike) or Path(pattern).suffix.lower() != ".fold":
        return ()
    return read_further_frames(as_path(pattern, "The pattern"))
