"""``miurafab tradeoff`` as a function: many fits of one target, here or on a cluster.

The corrugation is found once, at the median of the numbers of facets, and held for all of them, so
that the samples differ in their facets alone. Every fit is a function of text (the target and its
options), so it runs the same in this process, in a pool of others, or on a dask cluster.
"""

from __future__ import annotations

import importlib
import importlib.util
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from typing import Any

from miurafab.child import safe_path
from miurafab.errors import InputError
from miurafab.options import declared, read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.fitting.request import FitOptions
from miurafab.origami.tradeoff import Sample, Tradeoff, summarise
from miurafab.workflow.design import design
from miurafab.workflow.tradeoff_options import TradeoffOptions

_JOINING_S = 20.0
"""How long a cluster that was just started may take until its first worker has joined."""

Job = tuple[str | Mapping[str, Any], dict[str, Any]]
Progress = Callable[[float, str], None]


@verb
def tradeoff(
    target: object,
    sides: Sequence[int] | str | None = None,
    *,
    on_progress: Progress | None = None,
    **options: Any,
) -> Tradeoff:
    """Fit a target with more and more facets, and compare accuracy and effort.

    Parameters
    ----------
    target : str, os.PathLike, Design, trimesh.Trimesh, callable or array
        What :func:`fit` takes; the parameters of a surface are keywords here too.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.
    {options}

    Returns
    -------
    Tradeoff
        ``.plot()`` draws it, ``.save("x.png")`` writes it.

    Raises
    ------
    OptionError
        For options that cannot be taken.
    TargetError
        For a target that cannot be read.
    InputError
        For a cluster that does not answer. Its workers need miurafab and must see the same files.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.tradeoff("hypar", (4, 6, 8))
    <Tradeoff 3 sheets, 3 converged, distance 60.5 % / n>
    """
    own = {name: options.pop(name) for name in declared(TradeoffOptions) if name in options}
    asked = read_options(TradeoffOptions, own | {"sides": sides} if sides is not None else own)
    text, given = _as_text(target, {k: v for k, v in options.items() if v is not None})
    ordered = sorted(set(asked.sides))
    pilot = ordered[len(ordered) // 2]
    if on_progress is not None:
        on_progress(0.0, f"pilot with {pilot}x{pilot} facets")
    first = sample((text, given | {"facets": f"{pilot}x{pilot}"}))
    if first.status == "converged":
        held = {"amplitude": repr(first.amplitude), "zigzag": repr(first.zigzag)}
        given = held | given
    jobs: list[Job] = [(text, given | {"facets": f"{n}x{n}"}) for n in ordered if n != pilot]
    samples = [first]
    for found in _run(jobs, asked.workers or 1, asked.cluster):
        samples.append(found)
        if on_progress is not None:
            word = f"{found.columns}x{found.rows} facets {found.status}"
            on_progress(len(samples) / len(ordered), word)
    return summarise(samples, asked.weights)


described(tradeoff, TradeoffOptions, FitOptions, without=("facets",))


def _as_text(
    target: object, given: dict[str, Any]
) -> tuple[str | Mapping[str, Any], dict[str, Any]]:
    """A target and options that another process can be given: a text, or the description that a
    pattern file would hold.
    """
    if isinstance(target, str | os.PathLike):
        return os.fspath(target), given
    request = design(target, **given).request
    written = {
        name: entry.kind.show(getattr(request, entry.field))
        for name, entry in declared(FitOptions).items()
        if getattr(request, entry.field) not in (None, entry.default)
        and name not in ("facets", "close", "region", "rotate", "poles", "polar_hole")
    }
    return request.target, written


def sample(job: Job) -> Sample:
    """One fit: ``job`` is a target and the options of its design."""
    target, options = job
    request = design(target, **options).request

    from miurafab.origami.fitting.fit import fit  # only now: a target may be none

    result = fit(request)
    if result.status == "interrupted":
        raise KeyboardInterrupt  # one sheet of the series is no answer
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
                with _deaf_children(), safe_path():
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
    """Start processes here, whole, and such that Ctrl-C does not reach them while they load.

    A blocked signal stays blocked in a new process (Windows has no such block). In this process
    Ctrl-C comes when the block ends: a process that is started half complains of its missing input.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    blocks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if blocks else set()
    try:
        yield
    finally:
        if blocks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)


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
        try:
            client.wait_for_workers(1, timeout=_JOINING_S)
        except TimeoutError:
            raise InputError(
                f"The cluster at {address} has no workers; start one and try again."
            ) from None
        yield from _results(client.map(sample, jobs, pure=False), address)


def _results(futures: Iterable[Any], address: str) -> Iterator[Sample]:
    """The results in their order. A fit whose worker dies is made again by another worker."""
    lost: Any = importlib.import_module("distributed.client").FutureCancelledError
    killed: Any = importlib.import_module("distributed.scheduler").KilledWorker
    for future in futures:
        try:
            found: Sample = future.result()
        except ImportError as fault:
            raise InputError(
                f"The workers of the cluster at {address} cannot load miurafab: {fault}. Install "
                "it there, in this version."
            ) from None
        except (lost, killed) as fault:
            raise InputError(
                f"The cluster at {address} lost its workers or its scheduler in mid-run "
                f"({type(fault).__name__}); start them anew, with more memory if they need it."
            ) from None
        yield found
