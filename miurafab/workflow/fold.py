"""``miurafab fold`` as a function: from a pattern to its folding motion."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from miurafab.errors import InputError
from miurafab.options import read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.workflow.fold_options import FoldOptions
from miurafab.workflow.patterns import PatternLike, movable_pattern

if TYPE_CHECKING:
    from miurafab.origami.energy.continuation import Progress
    from miurafab.workflow.folding import Folding


@verb
def fold(
    pattern: PatternLike,
    steps: int | None = None,
    *,
    timeout: float | None = None,
    on_progress: Progress | None = None,
) -> Folding:
    """Compute the folding motion of a pattern.

    A sheet whose motion has a closed form goes from flat through its folded form to flat-folded.
    Any other sheet with a folded form goes from nearly flat to that form by bending its facets. Any
    other pattern goes from flat as far as its mountains and valleys tell.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        The pattern, or a file that :func:`load` reads.
    {options}
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.

    Returns
    -------
    Folding
        ``.save("x.gif")`` writes it, ``.plot()`` draws it.

    Raises
    ------
    PatternError
        For a file that holds no pattern, and for a pattern whose creases do not fold together.
    OptionError
        For ``steps`` or a ``timeout`` out of range.
    InputError
        If the ``timeout`` passes before the motion and its contacts are found.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.fold(mf.fit("plane", facets=(4, 4)), steps=10)
    <Folding rigid, 11 frames of 16 facets, no contacts>
    """
    asked = read_options(FoldOptions, {"steps": steps, "timeout": timeout})
    steps, on_progress = asked.steps, _until(asked.timeout, on_progress)
    pattern = movable_pattern(pattern)
    from miurafab.workflow.folding import folding_of  # what folds, once there is a pattern

    return folding_of(pattern, steps, on_progress)


def _until(timeout: float | None, on_progress: Progress | None) -> Progress | None:
    """``on_progress``, which ends what tells of its progress after ``timeout`` seconds."""
    if timeout is None:
        return on_progress
    end = time.monotonic() + timeout

    def told(part: float, text: str) -> None:
        if time.monotonic() > end:
            raise InputError(
                f"The motion was not ready within the {timeout:g} s of `timeout`: it was at "
                f"{text}. Give it more time, or ask for fewer `steps`."
            )
        if on_progress is not None:
            on_progress(part, text)

    return told


described(fold, FoldOptions, without=("colour", "thickness", "method"))
