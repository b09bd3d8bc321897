"""Build the wheel and the sdist, install them as users do, and run the first commands.

    python .ci/packages.py [--python PATH ...] [--only pip|uv|pipx|extras|broken]

In a new environment for each Python that ``pyproject.toml`` promises and this computer has (on the
PATH, of pyenv, or given): the libraries of ``locks/run.txt`` by their hashes and the wheel, and in
the first of them the sdist. Then ``uv tool install`` and ``pipx install`` of the wheel, with the
programs of ``locks/tools.txt``. In each, from an empty folder and without the checkout: the
version, ``doctor``, completion for four shells, and a job from a target to ``check``.

Then each extra in turn is added to the environment that pip made for each Python, by the command
that ``doctor`` prints, and what needs it runs. In the first of them, each library in turn
is removed, replaced by one that does not load, and made too old: ``doctor`` must name it, and the
command that it prints must mend it.

Prints one row for each, with the size of the environment or of what it adds; exits 1 if one of them
fails, or if a promised Python is not there.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

Install = Callable[[Path, Path, Path], tuple[Path, Path]]
Step = tuple[str, str, Callable[[], float | None]]

ROOT = Path(__file__).resolve().parents[1]
TOOLS = ROOT / ".venv" / "tools" / "bin"
QUIET = ("--quiet", "--disable-pip-version-check")
FIRST = (
    ("--version",),
    ("fit", "hypar", "--rigid", "--facets", "4x4", "--size", "120mm", "-o", "a.fold"),
    ("sheets", "a.fold", "-o", "job", "--machine", "grbl-laser-400", "--material", "card-250"),
    ("check", "job"),
    ("fold", "a.fold", "--thickness", "2mm", "--method", "bennett", "--panels", "plates.dxf"),
    ("convert", "a.fold", "a.dxf"),
    *(("completion", shell) for shell in ("bash", "zsh", "fish", "powershell")),
)
"""What a user runs first; ``doctor`` comes beside these."""


EXTRAS = {
    "cluster": ("tradeoff", "hypar", "--sides", "2,3,4", "--cluster", "ADDRESS"),
    "host": ("studio", "--host", "127.0.0.1", "--password-file", "password", "--no-browser"),
    "layers": ("layers", "a.fold", "--orders", "3"),
    "step": ("fit", "hypar.step", "--facets", "4x4", "-o", "step.fold"),
}
"""A command that needs each extra. A server is stopped when it has said where it serves."""

MODULES = {"fonttools": "fontTools", "pillow": "PIL", "pyserial": "serial"}


def promised() -> list[str]:
    """The Pythons of the classifiers, such as 3.11."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return re.findall(r"Python :: (\d\.\d+)", " ".join(project["classifiers"]))


def at_hand(version: str) -> Path | None:
    """A Python of ``version`` on the PATH or of pyenv."""
    pyenv = sorted((Path.home() / ".pyenv" / "versions").glob(f"{version}.*/bin/python"))
    found = [str(each) for each in pyenv] + [shutil.which(f"python{version}") or ""]
    for each in filter(None, found):
        asked = "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])"
        done = subprocess.run([each, "-c", asked], capture_output=True, text=True, check=False)
        if done.stdout.strip() == version:
            return Path(each)
    return None


def run(*words: object, cwd: Path, clean: bool = True) -> subprocess.CompletedProcess[str]:
    """Run a command, without this checkout on its path."""
    keep = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        list(map(str, words)), cwd=cwd, env=keep, capture_output=True, text=True, check=clean
    )


def tried(program: Path, folder: Path) -> None:
    """Run the first commands of ``program`` in a new ``folder``; raises if one of them fails."""
    folder.mkdir()
    for words in FIRST:
        run(program, *words, cwd=folder)
    examined = run(program, "doctor", cwd=folder, clean=False)
    # a computer may lack a port or a permission, but the installation must be whole
    broken = re.findall(r"Would stop a job: (.*(?:install|load|drawn).*)", examined.stdout)
    if examined.returncode not in (0, 1) or broken:
        raise RuntimeError(f"doctor: {broken or examined.stderr}")


def megabytes(folder: Path) -> float:
    """The size of the files below ``folder``."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return sum(path.stat().st_size for path in files) / 1e6


def with_pip(python: Path, package: Path, at: Path) -> tuple[Path, Path]:
    """The program and the folder of ``package`` in a new environment with the locked libraries."""
    run(python, "-m", "venv", at, cwd=ROOT)
    pip = (at / "bin" / "python", "-m", "pip", "install", *QUIET)
    run(*pip, "--require-hashes", "--requirement", ROOT / "locks" / "run.txt", cwd=ROOT)
    # locks/run.txt has what builds the sdist, too
    run(*pip, "--no-deps", "--no-build-isolation", package, cwd=ROOT)
    return at / "bin" / "miurafab", at


def with_uv(python: Path, package: Path, at: Path) -> tuple[Path, Path]:
    """``uv tool install`` into folders of its own."""
    os.environ |= {"UV_TOOL_DIR": str(at / "tools"), "UV_TOOL_BIN_DIR": str(at / "bin")}
    locked = ("--constraints", ROOT / "locks" / "run.txt")
    run(TOOLS / "uv", "tool", "install", "--python", python, *locked, package, cwd=ROOT)
    return at / "bin" / "miurafab", at / "tools"


def with_pipx(python: Path, package: Path, at: Path) -> tuple[Path, Path]:
    """``pipx install`` into folders of its own."""
    os.environ |= {"PIPX_HOME": str(at / "home"), "PIPX_BIN_DIR": str(at / "bin")}
    run(TOOLS / "pipx", "install", "--python", python, package, cwd=ROOT)
    return at / "bin" / "miurafab", at / "home" / "venvs"


def with_extra(extra: str, at: Path, folder: Path) -> float:
    """Add ``extra`` to the environment ``at``, as ``doctor`` says, and run in ``folder`` what needs
    it; its MB.
    """
    program, before = at / "bin" / "miurafab", megabytes(at)
    notes = json.loads(run(program, "doctor", "--json", cwd=folder, clean=False).stdout)["notes"]
    (note,) = (each for each in notes if f"miurafab[{extra}]" in each)
    run(*shlex.split(note.partition("is not installed: ")[2]), cwd=folder)
    shutil.copy(ROOT / "tests" / "data" / "hypar.step", folder)
    (folder / "password").write_text("a long enough password\n")
    (folder / "password").chmod(0o600)
    words = EXTRAS[extra]
    if extra == "cluster":
        with cluster(program.with_name("dask"), folder) as address:
            run(program, *(address if word == "ADDRESS" else word for word in words), cwd=folder)
    elif extra == "host":
        with started(program, *words, cwd=folder) as server:
            said = server.stdout.readline()
            if not said.startswith("https://127.0.0.1:"):
                raise RuntimeError(f"{extra}: {said}")
    else:
        run(program, *words, cwd=folder)
    return megabytes(at) - before


@contextmanager
def started(*words: object, cwd: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that serves, interrupted at the end."""
    with subprocess.Popen(
        list(map(str, words)), cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as server:
        try:
            yield server
        finally:
            server.send_signal(signal.SIGINT)


@contextmanager
def cluster(dask: Path, folder: Path) -> Iterator[str]:
    """The address of a scheduler with one worker."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    plain = {"cwd": folder}
    with (
        started(dask, "scheduler", "--port", port, "--no-dashboard", **plain),
        started(dask, "worker", address, "--nthreads", "1", "--no-dashboard", **plain),
    ):
        code = (
            f"from distributed import Client; Client({address!r}, timeout=60).wait_for_workers(1)"
        )
        run(dask.with_name("python"), "-c", code, **plain)
        yield address


def mended(at: Path, folder: Path) -> None:
    """Break each library that is needed, in three ways; ``doctor`` must tell how to mend it."""
    program, python = at / "bin" / "miurafab", at / "bin" / "python"
    code = (
        "from miurafab.workflow.libraries import examined_libraries as all_, pip_install\n"
        "import sysconfig; print(pip_install(), sysconfig.get_path('purelib'), sep=chr(10))\n"
        "print(*(name for name, _, _ in all_()))"
    )
    pip, site, names = run(python, "-c", code, cwd=folder).stdout.splitlines()
    for name in names.split():
        for broken in ("gone", "does not load", "too old"):
            _break(name, broken, python, Path(site))
            told = run(program, "doctor", "--json", cwd=folder, clean=False)
            answer = json.loads(told.stdout)
            problems = [p for p in answer.get("problems", [answer.get("error", "")]) if name in p]
            command = re.search(rf"run ({re.escape(pip)} .*)\.$", problems[0] if problems else "")
            if told.returncode not in (1, 2) or command is None:
                raise RuntimeError(f"{name}, {broken}: {told.stdout}")
            run(*shlex.split(command[1]), cwd=folder)
            after = json.loads(run(program, "doctor", "--json", cwd=folder, clean=False).stdout)
            if [each for each in after.get("problems", ["?"]) if "run " + pip in each]:
                raise RuntimeError(f"{name}, {broken}: {command[1]} does not mend it: {after}")


def _break(name: str, how: str, python: Path, site: Path) -> None:
    if how == "gone":
        run(python, "-m", "pip", "uninstall", "--yes", *QUIET, name, cwd=site)
    elif how == "does not load":
        (module,) = site.glob(f"{MODULES.get(name, name.replace('-', '_'))}/__init__.py")
        module.write_text("raise ImportError('broken on purpose')\n")
    else:
        plain = name.lower().replace("-", "_")
        (about,) = (
            each
            for each in site.glob("*.dist-info/METADATA")
            if each.parent.name.lower().partition("-")[0] == plain
        )
        text = about.read_text(encoding="utf-8")
        about.write_text(re.sub(r"^Version: .*$", "Version: 0.0.1", text, count=1, flags=re.M))


def installed(install: Install, python: Path, package: Path, at: Path, work: Path) -> float:
    """Install ``package`` into ``at``, run the first commands in ``work``; its MB."""
    program, folder = install(python, package, at)
    tried(program, work)
    return megabytes(folder)


def steps(pythons: dict[str, Path], wheel: Path, sdist: Path, scratch: Path) -> Iterator[Step]:
    """All that is tried, in order: its kind, its title, and what tries it."""
    for number, (version, python) in enumerate(pythons.items()):
        places = scratch / f"env-{number}", scratch / f"work-{number}"
        yield "new", f"pip, wheel, {version}", partial(installed, with_pip, python, wheel, *places)
        for extra in EXTRAS:
            yield "extras", f"  and {extra}", partial(with_extra, extra, *places)
        if number == 0:
            yield "broken", "  each library broken and mended", partial(mended, *places)
    version, python = next(iter(pythons.items()))
    for kind, install, package in (
        ("pip, sdist", with_pip, sdist),
        ("uv tool", with_uv, wheel),
        ("pipx", with_pipx, wheel),
    ):
        places = scratch / f"env-{kind}", scratch / f"work-{kind}"
        step = partial(installed, install, python, package, *places)
        yield kind.split()[0].rstrip(","), f"{kind}, {version}", step


NEEDS_NEW = {"pip", "extras", "broken"}
"""What is tried in the environments that pip makes of the wheel."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", type=Path, action="append", default=[])
    parser.add_argument("--only", choices=("pip", "uv", "pipx", "extras", "broken"))
    options = parser.parse_args()
    pythons = {str(each): each for each in options.python}
    if not pythons:
        pythons = {version: at_hand(version) for version in promised()}
    failed = None in pythons.values()
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        build = (sys.executable, "-m", "build", "--wheel", "--sdist", "--no-isolation")
        run(*build, "--outdir", scratch / "dist", ROOT, cwd=ROOT)
        (wheel,) = (scratch / "dist").glob("*.whl")
        (sdist,) = (scratch / "dist").glob("*.tar.gz")
        for package in (wheel, sdist):
            print(f"{package.name:<40} {package.stat().st_size / 1e6:8.1f} MB", flush=True)
        there = {version: path for version, path in pythons.items() if path is not None}
        for kind, title, step in steps(there, wheel, sdist, scratch):
            if options.only not in (None, kind) and not (
                kind == "new" and options.only in NEEDS_NEW
            ):
                continue
            try:
                size = step()
                told = "as promised" if size is None else f"{size:8.0f} MB"
            except (subprocess.CalledProcessError, RuntimeError, OSError, ValueError) as fault:
                failed = True
                told = f"failed: {fault} {getattr(fault, 'stderr', '')}"
            print(f"{title:<40} {told}", flush=True)
        for version in pythons.keys() - there.keys():
            print(f"{version:<40} there is no Python {version} on this computer")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
