"""Run the tests of an area on faults, each in a process of its own, forked from another.

A fault in the body of a function is put into it (``.ci/placing.py``) in a fork of a process that
has collected the tests. With others their module is loaded, in a fork of a process that has loaded
the libraries and our modules that need none of the area. The tests that run the faulty line come
first, quick ones before slow ones, and end at the first that fails; tests that run nothing of the
faulty function are left out. A fault survives if all others pass. Limits of time, by what each test
takes without a fault, end loops that never end.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import importlib
import itertools
import json
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

from placing import ROOT, Faulty, Held, Place, exchange, faulty, lines_of, loaded, name_of, place_of

OPTIONS = ("-q", "-x", "-n", "0", "-p", "no:cacheprovider", "--no-header", "--tb=no")
PLAIN = ("--assert=plain",)
"""Nobody reads how a test fails, and to rewrite its assertions takes longer than most tests."""
SLOW_S = 0.5
FORKED_S = 0.05  # what a test takes beside its own work
TOGETHER = 40
"""Faults for which the tests are collected once."""
BROKEN = 99
ENDS = {0: "survived", 1: "killed", 2: "killed", 4: "killed", -1: "timeout"}
"""What became of a fault by the exit code of pytest; 2 is a module that cannot be loaded, 4
one that a ``conftest.py`` loads.
"""
FORK = multiprocessing.get_context("fork")


class Ordered:
    """Runs the tests in ``order``, each for five times its ``seconds`` at most and as long as the
    slowest of all, whose work it may have to do in another order, or ten times as long on the
    clock; examples of Hypothesis are not made smaller.
    """

    def __init__(self, order: list[str], seconds: dict[str, float]) -> None:
        self.order, self.failing = order, ""
        self.seconds, self.slowest = seconds, max(seconds.values())

    def pytest_runtest_logstart(self, nodeid):
        limit = 5 + self.slowest + 5 * self.seconds[nodeid]
        signal.setitimer(signal.ITIMER_PROF, limit)
        signal.setitimer(signal.ITIMER_REAL, 10 * limit)

    def pytest_sessionstart(self):
        from hypothesis import Phase, settings

        phases = (Phase.explicit, Phase.generate)
        settings.register_profile("mutants", settings(), phases=phases, report_multiple_bugs=False)
        settings.load_profile("mutants")

    def pytest_runtestloop(self, session):
        """Runs them, and nothing after the first that fails."""
        items = {item.nodeid: item for item in session.items}
        chosen = [items[name] for name in self.order if name in items]
        for item, following in itertools.pairwise([*chosen, None]):
            if session.testsfailed:
                break
            self.failing = item.nodeid
            item.ihook.pytest_runtest_protocol(item=item, nextitem=following)
        return True


class Host(Ordered):
    """Runs the tests on one fault after another, each in a fork, when they are collected; tests
    that saw most faults in their time before come first.
    """

    def __init__(self, faults: list[dict], known: dict) -> None:
        super().__init__([], known["seconds"])
        self.faults, self.known = faults, known
        self.ends: list[tuple[str, float]] = []
        self.seen: Counter[str] = Counter()

    def pytest_runtestloop(self, session):
        functions = loaded({fault["module"] for fault in self.faults})
        for fault in self.faults:
            was, becomes = exchange(fault)
            lines = {(fault["module"], line) for line in lines_of(was)}
            ran = self.known["lines"]
            order = [n for n in order_of(fault, self.known) if not lines.isdisjoint(ran[n])]
            self.order = sorted(order, key=self._worth)

            def work(was=was, becomes=becomes):
                for function in functions[place_of(was)]:
                    function.__code__ = becomes
                try:
                    super(Host, self).pytest_runtestloop(session)
                except KeyboardInterrupt:  # a test that is stopped has not passed
                    return 1, self.failing
                return int(session.testsfailed > 0), self.failing

            how, took, failing = end_of(work, self.order, self.known)
            self.ends.append((how, took))
            self.seen[failing] += how == "killed"
        return True

    def _worth(self, name: str) -> float:
        return -self.seen[name] / (self.known["seconds"][name] + FORKED_S)

    def pytest_internalerror(self, excrepr):
        self.ends = [(str(excrepr), 0.0)]


class Watched:
    """Which lines of the modules each test runs, and how long the test takes; and which functions
    run before the first test.
    """

    def __init__(self, modules: list[str]) -> None:
        self.names = [name_of(path) for path in modules]
        self.modules = {str(ROOT / path) for path in modules}
        self.seconds: dict[str, float] = {}
        self.lines: dict[str, list[tuple[str, int]]] = {}
        self.failed: list[str] = []
        self.before: set[Place] = set()
        self._now: set[tuple[str, int]] | None = None
        self.watch(self._call)

    @staticmethod
    def watch(call) -> None:
        """Has ``call`` told of each function that begins, in any thread."""
        sys.settrace(call)
        threading.settrace(call)

    def _call(self, frame, event, _):
        path = frame.f_code.co_filename
        if path not in self.modules:
            return None
        if self._now is None:
            self.before.add(place_of(frame.f_code))
            return None

        def line(frame, event, _, now=self._now):
            now.add((path, frame.f_lineno))
            return line

        return line(frame, event, None)

    def pytest_collection_finish(self):
        """Loads what a test would load later."""
        for name in self.names:
            importlib.import_module(name)

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_runtest_protocol(self, item, nextitem):
        from _pytest.runner import runtestprotocol

        now = self._now = set()
        begun = time.process_time()
        self.watch(self._call)
        try:
            item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
            runtestprotocol(item, nextitem=nextitem)
        finally:
            self.watch(None)
        self.seconds[item.nodeid] = time.process_time() - begun
        self.lines[item.nodeid] = [
            (str(Path(path).relative_to(ROOT)), number) for path, number in list(now)
        ]
        return True


def in_child(work, limit: float) -> tuple[int, object]:
    """(status, answer) of ``work()`` in a forked process, which ends after ``limit`` seconds of
    processor time or twenty times as long on the clock; the status is -1 for one ended so.
    """
    with tempfile.TemporaryFile() as answer:
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            os.setsid()
            status = BROKEN
            try:
                quiet = os.open(os.devnull, os.O_RDWR)
                for number in (0, 1, 2):
                    os.dup2(quiet, number)
                resource.setrlimit(resource.RLIMIT_CPU, (int(limit) + 1, int(limit) + 1))
                status, value = work()
                answer.write(json.dumps(value).encode())
            except BaseException:  # noqa: BLE001 (a child must never go on as its parent)
                answer.write(json.dumps(traceback.format_exc()).encode())
            finally:
                answer.flush()
                os._exit(status)
        end = time.monotonic() + 20 * limit
        ended, status = 0, 0
        while not ended and time.monotonic() < end:
            ended, status = os.waitpid(child, os.WNOHANG)
            time.sleep(0 if ended else 0.02)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        if not ended:
            os.waitpid(child, 0)
        if not ended or os.WIFSIGNALED(status):
            return -1, None
        answer.seek(0)
        text = answer.read()
        return os.waitstatus_to_exitcode(status), json.loads(text) if text else None


def run_tests(tests: list[str], plugin: object) -> int:
    """Runs ``tests`` with ``plugin`` in this process; the exit code of pytest."""
    import pytest

    sys.path.insert(0, str(ROOT))
    os.chdir(ROOT)
    chosen = [*OPTIONS, *PLAIN, *(["--basetemp", tempfile.mkdtemp()]), *tests]
    if isinstance(plugin, Watched):
        chosen.remove("-x")
    return int(pytest.main(chosen, plugins=[plugin]))


def _ours(name: str) -> bool:
    return name.partition(".")[0] == "miurafab"


def watched(area: dict[str, list[str]]) -> dict[str, object]:
    """What the tests of ``area`` run and take without a fault."""

    def work():
        found = Watched(area["modules"])
        status = run_tests(area["tests"], found)
        libraries = [
            name
            for name, module in sys.modules.items()
            if ("site-packages" in str(getattr(module, "__file__", "")) or _ours(name))
            and not name.startswith("_pytest")
        ]
        before = sorted(found.before)
        return status, [found.seconds, found.lines, found.failed, before, libraries]

    status, answer = in_child(work, 1800)
    if status:
        raise SystemExit(f"The tests fail without a fault: {answer and answer[2]}")
    seconds, lines, _, before, libraries = answer
    return {
        "seconds": seconds,
        "lines": {name: {(path, line) for path, line in ran} for name, ran in lines.items()},
        "before": {tuple(place) for place in before},
        "libraries": libraries,
    }


def order_of(fault: dict, known: dict) -> list[str]:
    """The tests, those that run the lines of ``fault`` first, slow ones after the others; within
    a file quick ones first.
    """
    first, last = fault["statement"]
    lines = {(fault["module"], number) for number in range(first, last + 1)}
    runs = {name: not lines.isdisjoint(ran) for name, ran in known["lines"].items()}
    if not any(runs.values()):  # the line runs as the module is loaded
        runs = {name: bool(ran) for name, ran in known["lines"].items()}
    seconds = known["seconds"]

    def group(name: str) -> tuple[bool, bool, str]:
        return not runs[name], seconds[name] > SLOW_S, name.partition("::")[0]

    quickest = defaultdict(lambda: float("inf"))
    for name, took in seconds.items():
        quickest[group(name)] = min(quickest[group(name)], took)

    def place(name: str) -> tuple[object, ...]:
        *first, file = group(name)
        return *first, quickest[group(name)], file, seconds[name]

    return sorted(seconds, key=place)


def end_of(work, tests: list[str], known: dict) -> tuple[str, float, object]:
    """What became of a fault if ``work()`` runs ``tests`` on it in a child, the seconds of
    processor time it took, and what it answers.
    """
    begun = resource.getrusage(resource.RUSAGE_CHILDREN)
    status, answer = in_child(work, 20 + 10 * sum(known["seconds"][name] for name in tests))
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    if status not in ENDS:
        raise RuntimeError(f"The tests ended with {status}: {answer}")
    took = ended.ru_utime + ended.ru_stime - begun.ru_utime - begun.ru_stime
    return ENDS[status], took, answer


def judged_together(faults: list[dict], area: dict, known: dict) -> list[tuple[str, float]]:
    """``killed``, ``timeout`` or ``survived`` of faults in bodies of functions, and the seconds."""

    def work():
        host = Host(faults, known)
        return run_tests(area["tests"], host), host.ends

    status, ends = in_child(work, 1800)
    if status or len(ends) < len(faults):
        raise RuntimeError(f"The tests ended with {status}: {ends}")
    return ends


def judged_alone(faults: list[dict], area: dict, known: dict) -> list[tuple[str, float]]:
    """The same of a fault with which its module is loaded."""
    (fault,) = faults
    order = order_of(fault, known)
    files = [name.partition("::")[0] for name in order]
    alike = next((n for n, file in enumerate(files) if file != files[0]), len(files))
    took = 0.0
    for part in filter(None, (order[:alike], order[alike:])):  # one file sees most faults

        def work(part=part):
            sys.meta_path.insert(0, Faulty(fault["module"], faulty(fault)))
            files = list(dict.fromkeys(name.partition("::")[0] for name in part))
            return run_tests(files, Ordered(part, known["seconds"])), None

        how, seconds, _ = end_of(work, part, known)
        took += seconds
        if how != "survived":
            break
    return [(how, took)]


def run(name: str, area: dict, faults: list[dict], jobs: int) -> Iterator[tuple[dict, str, float]]:
    """Each of ``faults`` in ``area`` with what became of it, as they end."""
    known = watched(area)
    held = Held(area["modules"])
    sys.path.insert(0, str(ROOT))
    sys.meta_path.insert(0, held)
    for library in known["libraries"]:
        with contextlib.suppress(Exception):
            importlib.import_module(library)
    sys.meta_path.remove(held)
    alone, together = [], []
    for fault in faults:
        changed = exchange(fault)
        loads = changed is None or place_of(changed[0]) in known["before"]
        (alone if loads else together).append(fault)
    print(
        f"{name}: {len(faults)} faults, {len(alone)} of them each with its module loaded, "
        f"{len(known['seconds'])} tests",
        flush=True,
    )
    parts = [(judged_alone, [fault]) for fault in alone]
    parts += [
        (judged_together, together[i : i + TOGETHER]) for i in range(0, len(together), TOGETHER)
    ]
    done = 0
    with concurrent.futures.ProcessPoolExecutor(jobs, mp_context=FORK) as pool:
        calls = {pool.submit(judge, some, area, known): some for judge, some in parts}
        for call in concurrent.futures.as_completed(calls):
            for fault, (how, took) in zip(calls[call], call.result(), strict=True):
                yield fault, how, took
            if (done + len(calls[call])) // 50 > done // 50:
                print(f"  {done + len(calls[call])}", flush=True)
            done += len(calls[call])
