"""``miurafab tradeoff`` as functions: many fits of one target, here or on a cluster, and a picture.

The corrugation is found once, at the median of the numbers of facets, and held for all of them, so
that the samples differ in their facets alone. Every fit is a function of text (the target and its
options), so it runs the same in this process, in a pool of others, or on a dask cluster.
"""

from __future__ import annotations

import importlib
import importlib.util
import io
import math
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.errors import InputError, OptionError
from miurafab.options import Text, Whole, Written, declared, option, read_options
from miurafab.origami.fitting.fit import fit
from miurafab.origami.tradeoff import WEIGHTS, Sample, Tradeoff, cost, optimal_side, summarise
from miurafab.workflow import plotting
from miurafab.workflow.design import design

SIDES = (8, 12, 16, 24, 32, 48)
Job = tuple[str, dict[str, Any]]
Progress = Callable[[float, str], None]
# Colours that colour-blind eyes keep apart (Okabe and Ito, "Color Universal Design", 2008).
SHEETS, LAW = "#0072b2", "#d55e00"


def _read_sides(value: object) -> tuple[int, ...]:
    words = value.split(",") if isinstance(value, str) else value
    try:
        return tuple(Whole(2).read(word) for word in words)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise ValueError(f"is {value!r}; write whole numbers from 2, such as 8,16,32") from None


def _read_weights(value: object) -> tuple[float, ...]:
    words = value.split(",") if isinstance(value, str) else value
    try:
        weights = tuple(float(word) for word in words)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        weights = ()
    if not weights or not all(0 < weight < 1 for weight in weights):
        raise ValueError(f"is {value!r}; write numbers between 0 and 1, such as 0.2,0.5,0.8")
    return weights


def _listed(values: Sequence[float]) -> str:
    return ",".join(f"{value:g}" for value in values)


@dataclass(frozen=True)
class TradeoffOptions:
    """The options of a trade-off beside those of a fit."""

    sides: tuple[int, ...] = option(
        Written(_read_sides, _listed, "N,N,..."),
        "Facets along a side, three numbers or more, comma-separated.",
        default=SIDES,
    )
    weights: tuple[float, ...] = option(
        Written(_read_weights, _listed, "W,W,..."),
        "Weights of effort in the cost, between 0 and 1, comma-separated.",
        default=WEIGHTS,
    )
    workers: int | None = option(
        Whole(1),
        "Processes on this computer.",
        default_text="one a processor on the command line, 1 in Python",
    )
    cluster: str | None = option(
        Text("ADDRESS"), "Run on the dask cluster at this address (tcp://HOST:8786)."
    )

    def __post_init__(self) -> None:
        if len(set(self.sides)) < 3:
            raise OptionError(
                "sides", f"is {_listed(self.sides)}; three different numbers or more are needed"
            )


def tradeoff(
    target: str,
    sides: Sequence[int] | str | None = None,
    *,
    on_progress: Progress | None = None,
    **options: Any,
) -> Tradeoff:
    """Fit ``target`` with n x n facets for each n of ``sides``, and fit the laws.

    Parameters
    ----------
    target : str
        What :func:`~miurafab.workflow.design.design` takes.
    sides : sequence of int, optional
        Facets along a side, three numbers or more.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.
    **options
        ``weights``, ``workers`` and ``cluster`` (:class:`TradeoffOptions`), and the options of a
        fit. The workers of a cluster need miurafab and must see the same files.

    Raises
    ------
    InputError
        For options that cannot be taken, a target that cannot be read, a cluster that does not
        answer.
    """
    own = {name: options.pop(name) for name in declared(TradeoffOptions) if name in options}
    asked = read_options(TradeoffOptions, own | {"sides": sides} if sides is not None else own)
    given = {key: value for key, value in options.items() if value is not None}
    ordered = sorted(set(asked.sides))
    pilot = ordered[len(ordered) // 2]
    if on_progress is not None:
        on_progress(0.0, f"pilot with {pilot}x{pilot} facets")
    first = sample((target, given | {"facets": f"{pilot}x{pilot}"}))
    if first.status == "converged":
        held = {"amplitude": repr(first.amplitude), "zigzag": repr(first.zigzag)}
        given = held | given
    jobs: list[Job] = [(target, given | {"facets": f"{n}x{n}"}) for n in ordered if n != pilot]
    samples = [first]
    for found in _run(jobs, asked.workers or 1, asked.cluster):
        samples.append(found)
        if on_progress is not None:
            word = f"{found.columns}x{found.rows} facets {found.status}"
            on_progress(len(samples) / len(ordered), word)
    return summarise(samples, asked.weights)


def sample(job: Job) -> Sample:
    """One fit: ``job`` is a target and the options of its design."""
    target, options = job
    request = design(target, **options).request
    result = fit(request)
    if result.measurements is None:
        return Sample(request.columns, request.rows, result.status)
    found, last = result.measurements, result.attempts[-1]
    return Sample(
        request.columns,
        request.rows,
        result.status,
        last.corrugation.amplitude,
        last.corrugation.zigzag,
        found.hausdorff_mm,
        found.hausdorff_relative,
        found.hausdorff_midsurface_mm,
        found.area_ratio,
        found.min_edge_mm,
    )


def _run(jobs: list[Job], workers: int, cluster: str | None) -> Iterator[Sample]:
    # the largest first, so that none is left over when the others have ended
    jobs = jobs[::-1]
    if cluster is not None:
        yield from _on_cluster(jobs, cluster)
    elif workers == 1:
        yield from map(sample, jobs)
    else:
        # forking a process with threads (the progress bar is one) is not safe
        context = multiprocessing.get_context("spawn")
        count = min(workers, len(jobs))
        with ProcessPoolExecutor(count, mp_context=context, initializer=_ignore_ctrl_c) as pool:
            try:
                with _deaf_children():
                    running = [pool.submit(sample, job) for job in jobs]
                for done in as_completed(running):
                    yield done.result()
            except BaseException:
                for worker in multiprocessing.active_children():
                    worker.terminate()
                raise


def _ignore_ctrl_c() -> None:
    """Leave Ctrl-C, which reaches every process of a terminal, to the process that waits."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Start processes here that Ctrl-C does not reach even while they load their modules.

    A blocked signal stays blocked in a new process; here it comes when the block ends. Windows has
    no such block.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _on_cluster(jobs: list[Job], address: str) -> Iterator[Sample]:
    if importlib.util.find_spec("distributed") is None:
        raise InputError(
            "`cluster` needs dask.distributed; install it with pip install 'miurafab[cluster]'."
        )
    distributed: Any = importlib.import_module("distributed")
    try:
        client = distributed.Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as fault:
        reason = " ".join(str(fault).split()).rstrip(".")
        raise InputError(f"The `cluster` {address} does not answer: {reason}.") from None
    with client:
        if not client.scheduler_info()["workers"]:
            raise InputError(f"The cluster at {address} has no workers; start one and try again.")
        for future in client.map(sample, jobs, pure=False):
            found: Sample = future.result()
            yield found


def check_writable(path: Path) -> None:
    """Refuse, before any work is done, a file that :func:`write_tradeoff` could not write."""
    plotting.check_writable(path, "the trade-off")


def write_tradeoff(found: Tradeoff, path: str | Path, title: str = "") -> None:
    """Write ``found`` to ``path``: a plot (.png, .svg) or a table (.csv), by the ending.

    Raises :class:`~miurafab.errors.InputError` for another ending, or where matplotlib is missing.
    """
    plotting.write_result(
        Path(path),
        "the trade-off",
        lambda: tradeoff_table(found),
        lambda kind: tradeoff_plot(found, kind, title),
    )


def tradeoff_table(found: Tradeoff) -> str:
    """One line a sheet as CSV: what was measured, and its cost at each weight."""
    names = ("hausdorff_mm", "hausdorff_relative", "hausdorff_midsurface_mm", "area_ratio")
    header = ["facets", "columns", "rows", "status", *names, "min_edge_mm"]
    header += [f"cost_{curve.weight:g}" for curve in found.curves]
    lines = [",".join(header)]
    place = 0
    for s in found.samples:
        values = [getattr(s, name) for name in (*names, "min_edge_mm")]
        costs: list[float | None] = [None] * len(found.curves)
        if s.status == "converged" and found.curves:
            costs = [curve.costs[place] for curve in found.curves]
            place += 1
        cells = [str(s.columns * s.rows), str(s.columns), str(s.rows), s.status]
        cells += ["" if value is None else repr(float(value)) for value in (*values, *costs)]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def tradeoff_plot(found: Tradeoff, kind: str, title: str) -> bytes:
    """Distance, area ratio and cost over the number of facets as a picture, ``kind`` png or svg;
    the same bytes for the same trade-off. Raises ``InputError`` where there is no law to draw.
    """
    if found.coefficient is None or found.area_limit is None or found.area_slope is None:
        raise InputError("There is nothing to plot: fewer than three sheets were found.")
    from matplotlib import colormaps, rc_context
    from matplotlib.figure import Figure
    from matplotlib.ticker import ScalarFormatter

    facets = np.array([s.columns * s.rows for s in found.found], dtype=np.float64)
    n = np.geomspace(math.sqrt(facets[0]) / 1.15, math.sqrt(facets[-1]) * 1.15, 200)
    law = found.coefficient / n
    with rc_context({"svg.hashsalt": "miurafab", "font.size": 9}):
        figure = Figure(figsize=(12.0, 3.8), layout="constrained")
        distance, area, costs = figure.subplots(1, 3)
        distance.loglog(
            n**2, 100 * law, color=LAW, lw=1.2, label=f"{100 * found.coefficient:.3g} % / n"
        )
        distance.loglog(
            facets, [100 * (s.hausdorff_relative or 0.0) for s in found.found], "o", color=SHEETS,
            label=f"sheets (free power: n$^{{{found.exponent:.2f}}}$)",
        )  # fmt: skip
        distance.set_ylabel("Hausdorff distance (% of the diagonal)")
        area.semilogx(
            n**2, found.area_limit + found.area_slope / n, color=LAW, lw=1.2,
            label=f"{found.area_limit:.3f} {found.area_slope:+.2g} / n",
        )  # fmt: skip
        area.axhline(found.area_limit, color=LAW, lw=0.8, ls=":")
        area.semilogx(
            facets, [s.area_ratio for s in found.found], "o", color=SHEETS, label="sheets"
        )
        area.set_ylabel("area of the paper over that of the target")
        shades = colormaps["viridis"](np.linspace(0.0, 0.85, len(found.curves)))
        for curve, shade in zip(found.curves, shades, strict=True):
            costs.loglog(n**2, cost(curve.weight, n, law), color=shade, lw=1.0)
            costs.loglog(facets, curve.costs, ".", color=shade, ms=4, label=f"w = {curve.weight:g}")
            best = np.array([optimal_side(curve.weight, found.coefficient)])
            if n[0] <= best[0] <= n[-1]:
                least = cost(curve.weight, best, found.coefficient / best)
                costs.loglog(best**2, least, "v", color=shade, ms=6)
        costs.set_ylabel("cost: (1 - w) distance / 1 %  +  w facets / 1000")
        for axes in (distance, area, costs):
            axes.set_xlabel("facets (n$^2$)")
            for side in ("top", "right"):
                axes.spines[side].set_visible(False)
        for axes in (distance, costs):
            axes.yaxis.set_major_formatter(ScalarFormatter())
            axes.yaxis.set_minor_formatter(ScalarFormatter())
        for axes in (distance, area):
            axes.legend(frameon=False, fontsize=8)
        costs.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
        figure.suptitle(title)
        picture = io.BytesIO()
        without = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(picture, format=kind, dpi=150, metadata=without)
    return picture.getvalue()
