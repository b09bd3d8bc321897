"""Put faults into modules, and tell which of them no test sees.

    python .ci/mutants.py [AREA ...] [--module PATH ...] [--sample 200] [--jobs 2]

``[tool.mutants.areas]`` of ``pyproject.toml`` has the modules of each area and its nearest tests;
``--deselect=`` before one of them leaves it out, as it is slow.
Each fault (``.ci/mutations.py``) is run in a process of its own, forked from one that has loaded
the libraries and our modules that need none of the area: the module is loaded with the fault, files
stay as they are, and the tests stop at the first that fails. The tests that run the faulty line
come first, quick ones before slow ones; a fault survives if all tests of the area pass. Limits of
time, by what each test takes without a fault, end loops that never end.

``tests/survivors.toml`` has the faults that no test can see, with the reason. Prints a row for each
module; exits 1 if another fault survives, or if a fault of that list is none or is seen.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import importlib
import importlib.abc
import importlib.machinery
import json
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
import traceback
import types
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOOLS = ROOT / ".venv" / "tools" / "bin" / "python"
OPTIONS = ("-q", "-x", "-n", "0", "-p", "no:cacheprovider", "--no-header", "--tb=no")
PLAIN = ("--assert=plain",)
"""Nobody reads how a test fails, and to rewrite its assertions takes longer than most tests."""
SLOW_S = 0.5
SEED = 18
BROKEN = 99
ENDS = {0: "survived", 1: "killed", 2: "killed", 4: "killed", -1: "timeout"}
"""What became of a fault by the exit code of pytest; 2 is a module that cannot be loaded, 4
one that a ``conftest.py`` loads.
"""
FORK = multiprocessing.get_context("fork")


def name_of(path: str) -> str:
    """The name by which the module at ``path`` is loaded."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


class Faulty(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Loads one module from ``source`` instead of from its file."""

    def __init__(self, path: str, source: str) -> None:
        self.name = name_of(path)
        self.path, self.source = ROOT / path, source

    def find_spec(self, name, path=None, target=None):
        if name != self.name:
            return None
        packages = [str(self.path.parent)] if self.path.name == "__init__.py" else None
        spec = importlib.machinery.ModuleSpec(name, self, origin=str(self.path))
        spec.submodule_search_locations, spec.has_location = packages, True
        return spec

    def exec_module(self, module: types.ModuleType) -> None:
        exec(compile(self.source, self.path, "exec"), module.__dict__)


class Held(importlib.abc.MetaPathFinder):
    """Loads none of ``modules``, nor what needs one of them."""

    def __init__(self, modules: list[str]) -> None:
        self.names = {name_of(path) for path in modules}

    def find_spec(self, name, path=None, target=None):
        if name in self.names:
            raise RuntimeError(name)


class Ordered:
    """Runs the tests in ``order``, each for five times its ``seconds`` at most and as long as the
    slowest of all, whose work it may have to do in another order, or ten times as long on the
    clock; examples of Hypothesis are not made smaller.
    """

    def __init__(self, order: list[str], seconds: dict[str, float]) -> None:
        self.order = {name: place for place, name in enumerate(order)}
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

    def pytest_collection_modifyitems(self, items):
        items[:] = [item for item in items if item.nodeid in self.order]
        items.sort(key=lambda item: self.order[item.nodeid])


class Watched:
    """Which lines of the modules each test runs, and how long the test takes."""

    def __init__(self, modules: set[str]) -> None:
        self.modules = {str(ROOT / path) for path in modules}
        self.seconds: dict[str, float] = {}
        self.lines: dict[str, list[tuple[str, int]]] = {}
        self.failed: list[str] = []
        self._now: set[tuple[str, int]] = set()

    def _call(self, frame, event, _):
        path = frame.f_code.co_filename
        if path not in self.modules:
            return None

        def line(frame, event, _):
            self._now.add((path, frame.f_lineno))
            return line

        return line(frame, event, None)

    def pytest_runtest_logreport(self, report):
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_runtest_protocol(self, item, nextitem):
        from _pytest.runner import runtestprotocol

        self._now = set()
        begun = time.process_time()
        sys.settrace(self._call)
        try:
            item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
            runtestprotocol(item, nextitem=nextitem)
        finally:
            sys.settrace(None)
        self.seconds[item.nodeid] = time.process_time() - begun
        self.lines[item.nodeid] = [
            (str(Path(path).relative_to(ROOT)), number) for path, number in self._now
        ]
        return True


def in_child(work, limit: float) -> tuple[int, object]:
    """(status, answer) of ``work()`` in a forked process, which ends after ``limit`` seconds of
    processor time or twenty times as long on the clock; the status is None for one ended so.
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
        found = Watched(set(area["modules"]))
        status = run_tests(area["tests"], found)
        libraries = [
            name
            for name, module in sys.modules.items()
            if ("site-packages" in str(getattr(module, "__file__", "")) or _ours(name))
            and not name.startswith("_pytest")
        ]
        return status, [found.seconds, found.lines, found.failed, libraries]

    status, answer = in_child(work, 1800)
    if status:
        raise SystemExit(f"The tests fail without a fault: {answer and answer[2]}")
    names = ("seconds", "lines", "failed", "libraries")
    return dict(zip(names, answer, strict=True))


def order_of(fault: dict, known: dict) -> list[str]:
    """The tests, those that run the lines of ``fault`` first, slow ones after the others; within
    a file quick ones first.
    """
    first, last = fault["statement"]
    lines = {(fault["module"], number) for number in range(first, last + 1)}
    runs = {name: any(tuple(line) in lines for line in ran) for name, ran in known["lines"].items()}
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


def judged(fault: dict, area: dict, known: dict) -> tuple[str, float]:
    """``killed``, ``timeout`` or ``survived``, and the seconds of processor time it took."""
    lines = (ROOT / fault["module"]).read_text(encoding="utf-8").splitlines()
    first, last = fault["lines"]
    lines[first:last] = fault["becomes"].split("\n") if fault["becomes"] else []
    order = order_of(fault, known)
    files = [name.partition("::")[0] for name in order]
    alike = next((n for n, file in enumerate(files) if file != files[0]), len(files))

    def work(tests: list[str]):
        sys.meta_path.insert(0, Faulty(fault["module"], "\n".join(lines) + "\n"))
        files = list(dict.fromkeys(name.partition("::")[0] for name in tests))
        return run_tests(files, Ordered(tests, known["seconds"])), None

    begun = resource.getrusage(resource.RUSAGE_CHILDREN)
    for part in filter(None, (order[:alike], order[alike:])):  # one file sees most faults
        limit = 20 + 10 * sum(known["seconds"][name] for name in part)
        status, answer = in_child(lambda part=part: work(part), limit)
        if status:
            break
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = ended.ru_utime + ended.ru_stime - begun.ru_utime - begun.ru_stime
    if status not in ENDS:
        raise RuntimeError(f"The tests ended with {status}: {answer}")
    return ENDS[status], took


def key(fault: dict) -> tuple[str, ...]:
    """What names a fault while other lines of its module change."""
    parts = ("module", "within", "was", "becomes")
    return tuple(
        "\n".join(line.strip() for line in fault[part].strip().splitlines()) for part in parts
    )


def shown(fault: dict, how: str) -> str:
    """The fault for reading, and as it goes into the list of survivors."""
    was, becomes = key(fault)[2:]
    return (
        f"{how}: {fault['module']}:{fault['statement'][0]} in {fault['within'] or 'the module'}\n"
        + "".join(f"  - {line}\n" for line in was.splitlines())
        + "".join(f"  + {line}\n" for line in becomes.splitlines())
    )


def explained() -> dict[tuple[str, ...], str]:
    """The reasons of ``tests/survivors.toml`` by the keys of faults."""
    listed = tomllib.loads((ROOT / "tests" / "survivors.toml").read_text(encoding="utf-8"))
    return {
        key({**entry, "becomes": becomes}): entry["why"]
        for entry in listed.get("survivor", [])
        for becomes in entry["becomes"]
    }


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
    print(f"{name}: {len(faults)} faults, {len(known['seconds'])} tests", flush=True)
    with concurrent.futures.ProcessPoolExecutor(jobs, mp_context=FORK) as pool:
        calls = {pool.submit(judged, fault, area, known): fault for fault in faults}
        for done, call in enumerate(concurrent.futures.as_completed(calls), start=1):
            if done % 50 == 0:
                print(f"  {done}", flush=True)
            yield calls[call], *call.result()


def listed(modules: list[str], python: Path) -> list[dict]:
    """The faults of ``modules``, by the program that lists them."""
    call = [str(python), str(ROOT / ".ci" / "mutations.py"), *modules]
    done = subprocess.run(call, cwd=ROOT, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def main() -> int:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    areas = settings["tool"]["mutants"]["areas"]
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("areas", nargs="*", choices=[*areas, []], metavar="AREA")
    parser.add_argument("--module", nargs="*", default=[], help="only these modules of the areas")
    parser.add_argument("--sample", type=int, help="faults of each area, drawn by a fixed seed")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--tools", type=Path, default=TOOLS, help="the Python that has mutmut")
    asked = parser.parse_args()
    reasons = explained()
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    wrong = []
    for name in asked.areas or areas:
        area = areas[name]
        modules = [path for path in area["modules"] if not asked.module or path in asked.module]
        faults = listed(modules, asked.tools) if modules else []
        known = {key(fault) for fault in faults}
        wrong += [
            f"explained, and no fault: {entry}\n"
            for entry in sorted(reasons)
            if entry[0] in modules and entry not in known
        ]
        if asked.sample and asked.sample < len(faults):
            faults = random.Random(SEED).sample(faults, asked.sample)
        for fault, how, took in run(name, area, faults, asked.jobs) if faults else ():
            if key(fault) in reasons:
                if how != "survived":
                    wrong.append(shown(fault, f"explained, and yet {how}"))
                how = "explained"
            elif how == "survived":
                wrong.append(shown(fault, how))
                print(wrong[-1], flush=True)
            counts[fault["module"]][how] += 1
            counts[fault["module"]]["seconds"] += took
    print("\nTo kill or to explain:" if wrong else "", *wrong, sep="\n")
    columns = ("killed", "timeout", "explained", "survived", "seconds")
    print(f"{'module':44}" + "".join(f"{column:>10}" for column in columns))
    for path, count in counts.items():
        print(f"{path:44}" + "".join(f"{count[column]:10.0f}" for column in columns))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
