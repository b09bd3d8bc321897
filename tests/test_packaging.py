"""The wheel carries the shipped files and finds them, as the checkout does."""

import ast
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from email.parser import Parser
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import miurafab

ROOT = Path(__file__).resolve().parent.parent
BUILD = (sys.executable, "-m", "build", "--wheel", "--sdist", "--no-isolation")
KINDS = ("firmware_profiles", "materials", "patterns")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The wheel, unpacked as an installer would."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [*BUILD, "--outdir", folder, ROOT],
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def test_the_same_source_gives_the_same_packages(installed, tmp_path):
    """Built from a copy at another place, whose files are of another time."""
    named = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, named.split("\0")):
        copy = tmp_path / "copy" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, copy)
        os.utime(copy, (1e9, 1e9))
        copy.chmod((ROOT / name).stat().st_mode & 0o777)
    subprocess.run(
        [*BUILD, "--outdir", tmp_path, tmp_path / "copy"], check=True, capture_output=True
    )
    for kind in ("*.whl", "*.tar.gz"):
        (first,), (second,) = installed.parent.glob(kind), tmp_path.glob(kind)
        assert first.read_bytes() == second.read_bytes(), kind


LOCKS = {
    "run": ("build.in", ()),
    "dev": ("build.in", ("dev",)),
    "extras": (None, ("cluster", "host", "layers", "step")),
    "bench": (None, ("bench",)),
    "tools": ("tools.in", None),
}
"""What `make lock` makes each file of: a list beside it, and extras of pyproject.toml."""


def pinned(lock):
    """The entry of each library, with its hashes, by its plain name."""
    text = (ROOT / "locks" / f"{lock}.txt").read_text()
    entries = re.split(r"^(?=[\w.-]+==)", text, flags=re.MULTILINE)[1:]
    return {_plain(entry.partition("==")[0]): entry for entry in entries}


def asked(lock):
    """The requirements that the entries of ``lock`` come from."""
    beside, extras = LOCKS[lock]
    found = [] if beside is None else (ROOT / "locks" / beside).read_text().splitlines()
    if extras is not None:
        project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        found += project["dependencies"]
        found += [line for each in extras for line in project["optional-dependencies"][each]]
    return [Requirement(line) for line in found if line and not line.startswith("#")]


@pytest.mark.parametrize("lock", LOCKS)
def test_the_lock_files_pin_what_is_declared(lock):
    """Each dependency in a version that is allowed, each entry with hashes and with who needs it,
    which is another entry or what the file is made of.
    """
    pins = pinned(lock)
    for each in asked(lock):
        version = re.match(r"[^=]+==([^ ;]+)", pins[_plain(each.name)])[1]
        assert each.specifier.contains(version), each
    sources = {f"-r locks/{LOCKS[lock][0]}", "miurafab (pyproject.toml)"}
    for name, entry in pins.items():
        hashes = re.findall(r"--hash=(\S+)", entry)
        assert hashes, name
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", each) for each in hashes), name
        users = [
            line.removeprefix("via").strip()
            for line in re.findall(r"^ *# *(.*\S)", entry, re.MULTILINE)
            if line != "via" and "-c locks/" not in line
        ]
        assert users, name
        assert {each for each in users if _plain(each) not in pins} <= sources, name


def test_the_lock_files_pin_what_their_libraries_ask_for():
    """As the installed ones say it: an installation with hashes admits no other."""
    pins = pinned("dev")
    judged = 0
    for name in pins:
        try:
            needs = [Requirement(line) for line in requires(name) or ()]
        except PackageNotFoundError:  # for another system or Python
            continue
        for each in needs:
            if each.marker is None or each.marker.evaluate({"extra": ""}):
                assert _plain(each.name) in pins, f"{each} of {name}"
                judged += 1
    assert judged > 50


def test_the_lock_files_agree_on_versions():
    run, dev, *others = (
        {name: entry.split()[0] for name, entry in pinned(lock).items()}
        for lock in ("run", "dev", "extras", "bench")
    )
    assert run.items() <= dev.items()
    for lock in others:
        assert {name: lock[name] for name in lock.keys() & dev.keys()}.items() <= dev.items()


def test_make_lock_makes_each_lock_file():
    """From the lists and extras that the tests above take, and every other recipe installs them."""
    recipe = (ROOT / "Makefile").read_text()
    made = dict(re.findall(r"^\t\$\(COMPILE\) (.*) --output-file locks/(.*)\.txt$", recipe, re.M))
    made = {lock: inputs.split() for inputs, lock in made.items()}
    assert made.keys() == LOCKS.keys() == {p.stem for p in (ROOT / "locks").glob("*.txt")}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    locked = [extra for _, extras in LOCKS.values() for extra in extras or ()]
    assert sorted(locked) == sorted(project["optional-dependencies"])
    for lock, (beside, extras) in LOCKS.items():
        given = [] if extras is None else ["pyproject.toml"]
        given += [] if beside is None else [f"locks/{beside}"]
        assert [word for word in made[lock] if "." in word and "txt" not in word] == given
        told = re.findall(r"--extra (\S+)", " ".join(made[lock]))
        assert told == list(extras or ())
    for line in recipe.splitlines():
        if "pip install" in line:
            assert "--require-hashes" in line or "--no-deps" in line, line
    audited = re.findall(r"\$\(AUDIT\) --requirement locks/(.*)\.txt", recipe)
    assert sorted([*audited, "run"]) == sorted(LOCKS)  # what runs is part of dev


def test_the_lock_file_of_npm_has_a_sum_for_each_package():
    folder = ROOT / "tests" / "interop"
    packages = json.loads((folder / "package-lock.json").read_text())["packages"]
    wanted = json.loads((folder / "package.json").read_text())
    root = packages.pop("")
    for kind in ("dependencies", "devDependencies"):
        assert root[kind] == wanted[kind]
        for name, version in wanted[kind].items():
            assert packages[f"node_modules/{name}"]["version"] == version
    assert all(each["integrity"].startswith("sha512-") for each in packages.values())


def test_the_bill_of_materials_lists_every_library_of_the_lock_file():
    spec = importlib.util.spec_from_file_location("sbom", ROOT / "locks" / "sbom.py")
    sbom = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sbom)
    text = (ROOT / "locks" / "run.txt").read_text()
    bill = sbom.bill(text, "1.2.3")
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    refs = [each["bom-ref"] for each in bill["components"]]
    assert len(refs) == len(set(refs)) == len(re.findall(r"^[\w.-]+==", text, re.MULTILINE))
    assert all(re.fullmatch(r"[0-9a-f]{64}", h["content"])
               for each in bill["components"] for h in each["hashes"])  # fmt: skip
    (ours, *_) = bill["dependencies"]
    assert {ref.partition("@")[0] for ref in ours["dependsOn"]} >= {
        "pkg:pypi/numpy",
        "pkg:pypi/rich",
    }
    assert {ref for each in bill["dependencies"] for ref in each["dependsOn"]} <= set(refs)


def test_the_wheel_holds_what_the_checkout_holds(installed):
    for kind in KINDS:
        shipped = {p.name: p.read_bytes() for p in (ROOT / kind).iterdir() if p.is_file()}
        carried = installed / "miurafab" / "shipped" / kind
        assert shipped
        assert {p.name: p.read_bytes() for p in carried.iterdir()} == shipped
    assert (installed / "miurafab" / "py.typed").exists()
    for page in ("workflow/page", "studio/page"):
        parts = {
            p.name: p.read_bytes() for p in (ROOT / "miurafab" / page).iterdir() if p.is_file()
        }
        found = {name: (installed / "miurafab" / page / name).read_bytes() for name in parts}
        assert found == parts


def test_the_wheel_says_what_the_project_says(installed):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (info,) = installed.glob("*.dist-info")
    told = Parser().parsestr((info / "METADATA").read_text(encoding="utf-8"))
    assert told["Version"] == miurafab.__version__
    assert told["Requires-Python"] == project["requires-python"]
    assert set(told.get_all("Provides-Extra")) == set(project["optional-dependencies"])
    urls = dict(line.split(", ", 1) for line in told.get_all("Project-URL"))
    assert urls == project["urls"]
    assert (info / "entry_points.txt").read_text().split() == [
        *("[console_scripts]", "miurafab", "=", "miurafab.__main__:main"),
    ]
    assert (info / "licenses" / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_the_container_copies_all_that_its_installation_needs(installed, tmp_path):
    """It makes the same wheel from what it copies, to the byte."""
    text = (ROOT / "Containerfile").read_text()
    copied = [line.split()[1:] for line in text.splitlines() if line.startswith("COPY")]
    for *sources, target in copied:
        folder = tmp_path / target.removeprefix("/")
        for source in sources:
            if (ROOT / source).is_dir():
                shutil.copytree(ROOT / source, folder, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                folder.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / source, folder)
    source = tmp_path / "source"
    build = (sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", tmp_path)
    subprocess.run([*build, source], check=True, capture_output=True)
    (wheel,), (ours,) = tmp_path.glob("*.whl"), installed.parent.glob("*.whl")
    assert wheel.read_bytes() == ours.read_bytes()
    assert (source / "locks" / "run.txt").exists()
    assert "pip install --require-hashes --requirement /source/locks/run.txt" in text


@pytest.mark.large
def test_the_first_commands_run_from_the_wheel(installed, tmp_path):
    """As `make packages` runs them in each Python."""
    spec = importlib.util.spec_from_file_location("packages", ROOT / ".ci" / "packages.py")
    packages = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(packages)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert [f">={packages.promised()[0]}"] == [project["requires-python"]]
    program = tmp_path / "miurafab"
    program.write_text(
        f"#!{sys.executable}\nimport sys\nsys.path.insert(0, {str(installed)!r})\n"
        "from miurafab.__main__ import main\nsys.exit(main())\n"
    )
    program.chmod(0o755)
    packages.tried(program, tmp_path / "work")
    job = {path.name for path in (tmp_path / "work" / "job").iterdir()}
    assert {"manifest.json", "sheet-01.nc", "assembly.pdf"} <= job
    program.write_text("#!/bin/sh\nexit 2\n")
    with pytest.raises(subprocess.CalledProcessError):
        packages.tried(program, tmp_path / "again")


@pytest.mark.parametrize(("taken", "exit_code", "share"), [(18, 0, "95.00"), (17, 1, "90.00")])
def test_make_coverage_judges_the_branches_of_the_whole_package(tmp_path, taken, exit_code, share):
    """A module under the limit is named; it fails nothing while the package holds."""
    of = {"miurafab/grbl/a.py": (taken, 18), "miurafab/units.py": (1, 2), "miurafab/b.py": (0, 0)}
    files = {
        name: {"summary": {"covered_branches": some, "num_branches": count}}
        for name, (some, count) in of.items()
    }
    (tmp_path / "report.json").write_text(json.dumps({"files": files}))
    done = subprocess.run(
        [sys.executable, ROOT / ".ci" / "branches.py", tmp_path / "report.json"],
        capture_output=True,
        text=True,
    )
    rooms, below, whole = (part.splitlines() for part in done.stdout.split("\n\n"))
    assert done.returncode == exit_code, done
    assert [row.split()[0] for row in rooms] == ["grbl", "units"]
    assert below[-1].split() == ["miurafab/units.py", "1", "of", "2", "50.00", "%"]
    assert len(below) == 1 + exit_code
    assert " ".join(whole).split() == ["the", "package", f"{taken + 1}", "of", "20", share, "%"]


@pytest.mark.parametrize("place", ["wheel", "checkout"])
def test_shipped_files_are_found(installed, tmp_path, place):
    """From an empty folder, so that nothing is found by accident."""
    path = installed if place == "wheel" else ROOT
    code = (
        "import miurafab, json; from miurafab.profiles import *;"
        "from miurafab.workflow.design import design;"
        "print(json.dumps([miurafab.__file__, load_machine('grbl-laser-400').title,"
        "load_material('card-250').title, design('hypar.toml').title]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(path)},
        check=True,
        capture_output=True,
        text=True,
    )
    file, machine, material, pattern = json.loads(done.stdout)
    assert Path(file).is_relative_to(path)
    assert machine
    assert material
    assert pattern == "Hyperbolic paraboloid"


def test_the_workflow_runs_on_the_systems_and_pythons_that_are_promised():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    promised = re.findall(r"Python :: (\d\.\d+)", " ".join(project["classifiers"]))
    workflow = (ROOT / ".github" / "workflows" / "tests.yml").read_text()
    installs = re.findall(r"pip install (.*)", workflow)
    assert all("--require-hashes" in each or "--no-deps" in each for each in installs)
    pythons = re.search(r"python: \[(.*)\]", workflow)[1]
    assert re.findall(r"[\d.]+", pythons) == promised
    assert re.search(r"os: \[(.*)\]", workflow)[1].split(", ") == [
        "ubuntu-latest",
        "macos-latest",
        "windows-latest",
    ]


def test_the_libraries_that_the_package_imports_are_its_dependencies():
    """Nothing that README shows needs more than ``pip install .`` brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = {_plain(re.split(r"[<>=; ]", line)[0]) for line in project["dependencies"]}
    distributions = packages_distributions()
    imported = {
        _plain(distributions[name][0])
        for path in (ROOT / "miurafab").rglob("*.py")
        for name in _imports(ast.parse(path.read_text()))
        if name not in sys.stdlib_module_names and name != "miurafab"
    }
    assert imported - {"distributed"} <= declared  # for tradeoff --cluster alone: an extra
    assert declared - imported == set()


def _imports(module):
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module.split(".")[0]


def _plain(name):
    return name.lower().replace("_", "-")


def test_the_citation_names_this_version():
    lines = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    assert f"version: {miurafab.__version__}" in lines
