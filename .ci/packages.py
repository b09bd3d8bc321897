"""Build the wheel and the sdist, install them as users do, and run the first commands.

    python .ci/packages.py [--python PATH ...] [--only pip|uv|pipx]

In a new environment for each Python that ``pyproject.toml`` promises and this computer has (on the
PATH, of pyenv, or given): the libraries of ``locks/run.txt`` by their hashes and the wheel, and in
the first of them the sdist. Then ``uv tool install`` and ``pipx install`` of the wheel, with the
programs of ``locks/tools.txt``. In each, from an empty folder and without the checkout: the
version, ``doctor``, completion for four shells, and a job from a target to ``check``.

Prints one row for each, with the size of the environment; exits 1 if one of them fails, or if a
promised Python is not there.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

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


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", type=Path, action="append", default=[])
    parser.add_argument("--only", choices=("pip", "uv", "pipx"))
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
        rows = [
            (f"pip, wheel, {version}", with_pip, path, wheel) for version, path in there.items()
        ]
        for version, path in list(there.items())[:1]:
            rows.append((f"pip, sdist, {version}", with_pip, path, sdist))
            rows.append((f"uv tool, {version}", with_uv, path, wheel))
            rows.append((f"pipx, {version}", with_pipx, path, wheel))
        for number, (title, install, python, package) in enumerate(rows):
            if options.only and not install.__name__.endswith(f"with_{options.only}"):
                continue
            try:
                program, folder = install(python, package, scratch / f"env-{number}")
                tried(program, scratch / f"work-{number}")
                told = f"{megabytes(folder):8.0f} MB"
            except (subprocess.CalledProcessError, RuntimeError, OSError) as fault:
                failed = True
                told = f"failed: {fault} {getattr(fault, 'stderr', '')}"
            print(f"{title:<40} {told}", flush=True)
        for version in pythons.keys() - there.keys():
            print(f"{version:<40} there is no Python {version} on this computer")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
