"""The wheel carries the shipped files and finds them, as the checkout does."""

import ast
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
KINDS = ("firmware_profiles", "materials", "patterns")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The wheel, unpacked as an installer would."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT],
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


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
    assert declared - imported == {"networkx"}  # trimesh turns facets the same way with it


def _imports(module):
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module.split(".")[0]


def _plain(name):
    return name.lower().replace("_", "-")
