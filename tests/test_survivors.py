"""The faults that ``make mutants`` leaves: each is in the code still, and the command tells a fault
that a test sees from one that none sees.
"""

import ast
import json
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
AREAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mutants"]["areas"]
SURVIVORS = tomllib.loads((ROOT / "tests" / "survivors.toml").read_text()).get("survivor", [])

JUDGE = """
import json, sys
sys.path.insert(0, sys.argv[1])
import mutants
area, faults = json.loads(sys.argv[2])
print(json.dumps({fault["becomes"]: how for fault, how, _ in mutants.run("", area, faults, 1)}))
"""


@cache
def within(path, name):
    """The lines of a function or class of a module, without what stands before them."""
    text = (ROOT / path).read_text(encoding="utf-8")
    node = ast.parse(text)
    for part in filter(None, name.split(".")):
        bodies = [each for each in ast.walk(node) if getattr(each, "name", None) == part]
        assert len(bodies) == 1, f"{path} has {len(bodies)} of {name}"
        node = bodies[0]
    lines = text.splitlines()
    lines = lines[node.lineno - 1 : node.end_lineno] if name else lines
    return "\n".join(line.strip() for line in lines)


def test_each_area_has_its_modules_and_tests():
    named = [path for area in AREAS.values() for path in [*area["modules"], *area["tests"]]]
    files = {name.removeprefix("--deselect=").partition("::")[0] for name in named}
    assert [name for name in files if not (ROOT / name).exists()] == []


def test_each_survivor_is_in_the_code_and_has_a_reason():
    modules = {path for area in AREAS.values() for path in area["modules"]}
    for entry in SURVIVORS:
        assert set(entry) == {"module", "within", "was", "becomes", "why"}
        assert entry["module"] in modules
        was = "\n".join(line.strip() for line in entry["was"].strip().splitlines())
        assert was in within(entry["module"], entry["within"]), entry
        assert len(entry["why"].split()) >= 4
        assert was not in entry["becomes"]


@pytest.mark.skipif(sys.platform == "win32", reason="the command forks")
def test_a_fault_that_a_test_sees_is_told_from_one_that_none_sees():
    module = "miurafab/wire/line_reader.py"
    lines = (ROOT / module).read_text(encoding="utf-8").splitlines()
    (place,) = [i for i, line in enumerate(lines) if line.strip().startswith("def ")][-1:]
    fault = {"module": module, "within": "", "statement": [place + 1, place + 1]}
    within = fault | {"lines": [place + 1, place + 1], "was": ""}
    harmless = [
        within | {"lines": [place, place], "becomes": "    # Nothing."},
        within | {"becomes": "        pass"},
    ]
    fatal = [
        within | {"lines": [place, place + 1], "becomes": "    def no(self):"},
        within | {"becomes": "        raise KeyboardInterrupt"},
        within | {"becomes": "        return 3"},
    ]
    area = {"modules": [module], "tests": ["tests/wire/test_line_reader.py"]}
    call = [sys.executable, "-c", JUDGE, str(ROOT / ".ci")]
    done = subprocess.run(
        [*call, json.dumps([area, harmless + fatal])], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    first, *_, last = done.stdout.splitlines()
    assert "5 faults, 2 of them each with its module loaded" in first
    assert json.loads(last) == {
        fault["becomes"]: how
        for faults, how in ((harmless, "survived"), (fatal, "killed"))
        for fault in faults
    }
