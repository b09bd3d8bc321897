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
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.errors import InputError
from miurafab.origami.fitting.fit import fit
from miurafab.origami.tradeoff import WEIGHTS, Sample, Tradeoff, cost, optimal_side, summarise
from miurafab.workflow import plotting
from miurafab.workflow.design import design

SIDES = (8, 12, 16, 24, 32, 48)
Job = tuple[str, dict[str, str | None]]
Progress = Callable[[float, str], None]
# Colours that colour-blind eyes keep apart (Okabe and Ito, "Color Universal Design", 2008).
SHEETS, LAW = "#0072b2", "#d55e00"


def tradeoff(
    target: str,
    sides: Sequence[int] = SIDES,
    *,
    options: Mapping[str, str | None] | None = None,
    weights: tuple[float, ...] = WEIGHTS,
    workers: int = 1,
    cluster: str | None = None,
    on_progress: Progress | None = None,
) -> Tradeoff:
    """Fit ``target`` with n x n facets for each n of ``sides``, and fit the laws.

    ``options`` are those of :func:`~miurafab.workflow.design.design`; ``workers`` processes run
    here, or ``cluster`` is the address of a dask scheduler whose workers have miurafab and see the
    same files. Raises :class:`~miurafab.errors.InputError` for what cannot be asked.
    """
    if len(set(sides)) < 3 or min(sides) < 2:
        raise InputError("--sides needs three different numbers of facets a side or more, from 2.")
    for weight in weights:
        if not 0 < weight < 1:
            raise InputError(f"--weights holds {weight:g}; each must lie between 0 and 1.")
    if workers < 1:
        raise InputError(f"--workers is {workers}; it must be one or more.")
    given: dict[str, str | None] = {
        key: text for key, text in (options or {}).items() if text is not None
    }
    ordered = sorted(set(sides))
    pilot = ordered[len(ordered) // 2]
    if on_progress is not None:
        on_progress(0.0, f"pilot with {pilot}x{pilot} facets")
    first = sample((target, given | {"facets": f"{pilot}x{pilot}"}))
    if first.status == "converged":
        held: dict[str, str | None] = {
            "amplitude": repr(first.amplitude),
            "zigzag": repr(first.zigzag),
        }
        given = held | given
    jobs: list[Job] = [(target, given | {"facets": f"{n}x{n}"}) for n in ordered if n != pilot]
    samples = [first]
    for found in _run(jobs, workers, cluster):
        samples.append(found)
        if on_progress is not None:
            word = f"{found.columns}x{found.rows} facets {found.status}"
            on_progress(len(samples) / len(ordered), word)
    return summarise(samples, weights)


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
            "--cluster needs dask.distributed; install it with pip install 'miurafab[cluster]'."
        )
    distributed: Any = importlib.import_module("distributed")
    try:
        client = distributed.Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError) as fault:
        reason = " ".join(str(fault).split()).rstrip(".")
        raise InputError(f"--cluster {address} does not answer: {reason}.") from None
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
