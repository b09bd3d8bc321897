"""Fitting: from a target to a tessellation that lies on it and folds from flat sheets.

A fit makes starts, which are cheap and tell how steep a slide their seed asks for, and puts them in
order. The likeliest few are brought to fair sheets, exact and judged, and the best is the answer: a
sheet without faults and with the least score. The search ends early at a sheet that is as good as
asked. Without such a sheet more pieces are tried, if the number of pieces is free; without any
clean sheet, steeper starts and, on a mesh, smaller parts of the target.

A generalized cylinder is constructed directly. The result says what was tried and, without a sheet,
what to change.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from miurafab.errors import OptionError
from miurafab.findings import Finding
from miurafab.origami.fitting.candidate import Candidate
from miurafab.origami.fitting.polish import plain, polished
from miurafab.origami.fitting.request import BED, FitRequest
from miurafab.origami.fitting.result import INTERRUPTED, TIME_RAN_OUT, Attempt, FitResult
from miurafab.origami.fitting.score import ENOUGH, GOOD
from miurafab.origami.fitting.search import coarsest
from miurafab.origami.fitting.starts import STEEP, Start, direct, starts_elsewhere, starts_for
from miurafab.origami.verify import Measurements
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution
from miurafab.surfaces.tube import TubeSurface

TRIED = 3
"""The starts that are brought to fair sheets, for each number of pieces. Where the number of pieces
is asked for, more are tried until one will do: the globe in two pieces needs its fourth. Where the
best sheet only takes much paper, more are tried too: the candlestick takes 4.2 times its area with
three, and 3.6 times with five."""
LARGE = 900
"""A sheet of more facets is brought to the end from the likeliest start alone, if that one will
do."""
PIECES = (1, 2, 3, 4)
PIECES_ROUND = (1, 2, 6, 8, 12)
"""The numbers of pieces that ``auto`` tries, on a sheet and all round an axis."""
MORE_GORES = (0, 2, 4)
"""What ``auto`` adds to the number of gores that the map of a body asks for."""
PATIENCE = 25.0
"""Seconds of processor time for 400 facets, after which no new start is begun."""
TOO_FAR = 1.2
"""A size whose first sheets miss a limit on the distance by this factor is too coarse."""
FAR = 4.0
"""The plain search goes on while the deviation is over this many times that of a good sheet."""
USUAL_STEPS = 30
"""The steps of the fair objective in which two thirds of an attempt are told as done."""
GLANCES = 6
"""So many starts a coarse fit makes at most, if none is a clean sheet."""

__all__ = ["Attempt", "FitRequest", "FitResult", "coarse", "fit"]


class _TimeUp(Exception):
    """The time of the request is over."""


def fit(
    request: FitRequest,
    on_progress: Callable[[float, str], None] | None = None,
) -> FitResult:
    """Fit a sheet to the target of ``request``.

    ``on_progress`` gets the fraction done and a description of the start. A fit without a sheet is
    a result with advice. Ctrl-C ends the search: the result is then the best exact sheet so far,
    with status ``interrupted``; ``KeyboardInterrupt`` is raised only if there is none.
    """
    if request.size_mm == BED:
        raise OptionError(
            "size", "is bed, which only `fit` and `cut` know, with a machine; give mm"
        )
    started = time.perf_counter()
    result = _fitted(request, on_progress, _FitSearch)
    if request.barrier is None:
        return result
    from miurafab.origami.energy.tuning import tuned

    ends_at = math.inf if request.timeout is None else started + request.timeout

    def alone(other: FitRequest) -> FitResult:
        return _fitted(other, None, _SheetAlone)

    result = tuned(request, result, alone, on_progress, ends_at)
    return replace(result, seconds=time.perf_counter() - started)


def _fitted(
    request: FitRequest,
    on_progress: Callable[[float, str], None] | None,
    search: type[_FitSearch],
) -> FitResult:
    """The sheet of ``request``, whatever its barrier; one ``search`` where the size is known."""
    if not request.search:
        return search(request, on_progress).result()

    def at(size: FitRequest) -> FitResult:
        return _FitSearch(size, None, ends_at=ENOUGH).result()

    return coarsest(request, at, on_progress)


def coarse(
    request: FitRequest, on_progress: Callable[[float, str], None] | None = None
) -> FitResult:
    """The first clean sheet that the projection alone finds, as a picture of what a fit will give.

    The sheet is exact, and its residuals, its clashes and the deviation of its middle are measured.
    What takes longer than the sheet itself is left out: the fair objective, the cut along the
    outline of a mesh (the sheet ends with whole facets), pieces that nobody asked for, the search
    of a number of facets or of a barrier, and the distances between the whole sheet and the whole
    target (``hausdorff_mm``, ``coverage``, ``area_ratio`` are None).

    Parameters
    ----------
    request : FitRequest
        What is asked of the fit; a size in mm, or none.
    on_progress : callable, optional
        As for :func:`fit`. An exception that it raises ends the fit.

    Returns
    -------
    FitResult
        ``stalled`` where no exact sheet was found in so many starts.
    """
    edge = "whole" if request.edge == "trim" else request.edge
    return _Glance(replace(request, polish="off", edge=edge), on_progress).result()


class _FitSearch:
    """One search at one number of facets; holds what was made and the best sheet so far.

    A sheet without faults whose score is at most ``ends_at`` ends it.
    """

    def __init__(
        self,
        request: FitRequest,
        on_progress: Callable[[float, str], None] | None,
        ends_at: float = GOOD,
    ) -> None:
        self.request = request
        self.ends_at = ends_at
        self.on_progress = on_progress
        self.started = time.perf_counter()
        self.began = time.process_time()
        self.made: list[Attempt] = []
        self.best: Candidate | None = None
        self.nearest = math.inf
        self.trying, self.before, self.steps = "", 0, 0

    def result(self) -> FitResult:
        """Run to the end, the time limit or Ctrl-C."""
        ended: Finding | None = None
        try:
            for outcome in self._outcomes():
                self.made.append(outcome if isinstance(outcome, Attempt) else outcome.attempt)
                if isinstance(outcome, Attempt):
                    continue
                self.nearest = min(self.nearest, outcome.closeness.factor)
                if self.best is None or outcome.rank < self.best.rank:
                    self.best = outcome
        except _TimeUp:
            ended = TIME_RAN_OUT
        except KeyboardInterrupt:
            if self.best is None:
                raise
            ended = INTERRUPTED
        if self.on_progress is not None:
            self.on_progress(1.0, "done")
        return self._result(ended)

    def _outcomes(self) -> Iterator[Candidate | Attempt]:
        """Everything that is tried, in order."""
        request = self.request
        if isinstance(request.surface, GeneralizedCylinder):
            yield from self._direct()
            if request.is_tube or (self.best is not None and not self.best.faults):
                return
        for pieces in self._pieces():
            starts = starts_for(request, pieces)
            likely = [s for s in starts if s.steepest < STEEP]
            yield from self._tried(likely)
            if self._settled() or self._one_will_do():
                return
        if self.best is None or self.best.rank[0]:
            fewest = self._pieces()[0]
            steep = [s for s in starts_for(request, fewest) if s.steepest >= STEEP]
            yield from self._tried(steep + starts_elsewhere(request, fewest))

    def _direct(self) -> Iterator[Candidate | Attempt]:
        """The closed forms on a cylinder; the best of them is polished if it is not good."""
        best: tuple[tuple[int, int, float, float], Start] | None = None
        for start in direct(self.request):
            made = plain(self.request, start)
            yield made
            if isinstance(made, Candidate):
                if made.good or (self.request.is_tube and not made.faults):
                    return
                best = min(best or (made.rank, start), (made.rank, start), key=lambda pair: pair[0])
        if best is not None and not self.request.is_tube and self.request.polish == "on":
            yield from polished(self.request, best[1], self._step)

    def _pieces(self) -> tuple[int, ...]:
        request = self.request
        if request.cut_columns is not None:
            return (len(request.cut_columns) + 1,)
        if request.pieces is not None:
            return (request.pieces,)
        if isinstance(request.surface, TubeSurface):
            return tuple(request.surface.gores + more for more in MORE_GORES)
        closed = isinstance(request.surface, Revolution) and request.surface.closed
        if request.polish == "off":
            return (1,)
        return PIECES_ROUND if closed else PIECES

    def _settled(self) -> bool:
        """Whether more is not worth trying: the sheet is good, or only limits are in its way, or
        the time that a fit may take without being asked is over.
        """
        best = self.best
        if best is not None and self.request.polish == "off":
            return not best.faults and best.score.deviation <= FAR
        if best is not None and not best.faults and best.score.total <= self.ends_at:
            return True
        facets = self.request.columns * self.request.rows
        return time.process_time() - self.began > PATIENCE * max(1.0, facets / 400)

    def _one_will_do(self) -> bool:
        """Whether more pieces are not worth their seams: they are for a sheet that crosses itself,
        that is over 1 % of its diagonal off, or that misses a limit on the distance.
        """
        best = self.best
        if best is None or best.rank[0] or best.score.total > ENOUGH:
            return False
        return not any(fault.code in ("max-deviation", "max-distance") for fault in best.faults)

    def _tried(self, starts: list[Start]) -> Iterator[Candidate | Attempt]:
        request = self.request
        if request.polish == "off":
            for start in starts:
                self._tell(start)
                yield plain(request, start)
                if self._settled():
                    return
            return
        if starts and request.timeout is not None and self.best is None:
            yield plain(request, starts[0])
        large = request.columns * request.rows > LARGE
        pieces = self._pieces()
        # of pieces whose number is asked for there are no more to try
        last = len(pieces) == 1 and pieces[0] > 1
        for number, start in enumerate(starts):
            more = self._much_paper() or (last and not self._one_will_do())
            if number >= TRIED and not more:
                return
            self._tell(start)
            shaken = start.shaken(request.seed) if request.seed else start
            yield from polished(request, shaken, self._step)
            if self._settled() or (large and self._one_will_do()) or self._too_far():
                return

    def _much_paper(self) -> bool:
        """Whether the best sheet has no fault but that it takes much paper."""
        best = self.best
        return best is not None and not best.faults and best.score.total == best.score.paper

    def _too_far(self) -> bool:
        """Whether a search of sizes is to go on to the next, since no start will mend this one."""
        return self.ends_at > GOOD and self.nearest > TOO_FAR

    def _tell(self, start: Start) -> None:
        self._check_time()
        self.trying, self.before, self.steps = start.describe(), len(self.made), 0
        if self.on_progress is not None:
            # the number of attempts is not known beforehand; most sheets need one or two
            self.on_progress(1 - 0.8**self.before, self.trying)

    def _step(self, _number: int, objective: float) -> None:
        """A step of the fair objective: a part of an attempt, the less the more there were."""
        self._check_time()
        self.steps += 1
        if self.on_progress is not None:
            part = 1 - math.exp(-self.steps / USUAL_STEPS)
            note = f"{self.trying}, step {self.steps}, objective {objective:.3g}"
            self.on_progress(1 - 0.8 ** (self.before + part), note)

    def _measured(self, best: Candidate) -> Measurements:
        return best.with_distances()

    def _check_time(self) -> None:
        limit = self.request.timeout
        if limit is not None and time.perf_counter() - self.started > limit:
            raise _TimeUp

    def _result(self, ended: Finding | None) -> FitResult:
        best, made = self.best, tuple(self.made)
        iterations = sum(a.iterations for a in made)
        seconds = time.perf_counter() - self.started
        if best is None:
            why = _no_sheet(made, ended)
            return FitResult(
                "stalled", why.sentence, None, None, made, iterations, seconds, findings=(why,)
            )
        status = "infeasible" if best.faults else "converged"
        if ended is INTERRUPTED:
            status = "interrupted"
        findings = [*([ended] if ended is not None else []), *best.faults]
        if place := best.attempt.place:
            sentence = f"On the whole target no clean sheet was found; this one has {place}."
            findings.append(Finding("smaller-part", sentence))
        if self.request.edge == "trim" and best.pattern.target.get("edge") == "whole":
            sentence = (
                "A cut along the outline would leave edges shorter than the `min_edge` of "
                f"{self.request.min_edge_mm:.3g} mm, so the sheet ends with whole facets; lower "
                "`min_edge`, or ask for fewer `facets` or a larger `size`."
            )
            findings.append(Finding("whole-facets", sentence))
        if best.score.deviation > ENOUGH:
            sentence = (
                f"The sheet lies up to {best.deviation_mm:.3g} mm from the target, over 1 % of its "
                "size; ask for other `facets`, more `pieces`, or a smaller part of the target."
            )
            findings.append(Finding("far-from-target", sentence))
        return FitResult(
            status,
            " ".join(finding.sentence for finding in findings),
            best.pattern,
            self._measured(best),
            made,
            iterations,
            seconds,
            best.deviation_mm,
            best.score,
            best.polished,
            best.active_bounds,
            findings=tuple(findings),
        )


class _SheetAlone(_FitSearch):
    """The search of a sheet whose distances nobody asks for."""

    def _measured(self, best: Candidate) -> Measurements:
        return best.measurements


class _Glance(_SheetAlone):
    """The search of a coarse fit: few starts."""

    def _settled(self) -> bool:
        best = self.best
        return (best is not None and best.rank[0] == 0) or len(self.made) >= GLANCES


def _no_sheet(attempts: tuple[Attempt, ...], ended: Finding | None) -> Finding:
    if ended is not None:
        sentence = "The `timeout` ended the search before an exact sheet was found; allow more."
        return Finding("no-sheet", sentence)
    residual = min((a.residual for a in attempts), default=float("inf"))
    return Finding(
        "no-sheet",
        f"No exact sheet was found in {len(attempts)} attempts (best residual {residual:.1e}): "
        "the target bends too much for this pattern. Ask for more `facets` or `pieces`, raise "
        "`zigzag` and `amplitude`, drop `flat_foldable`, or take a smaller part of the target.",
    )
