"""Put faults into modules, and tell which of them no test sees.

    python .ci/mutants.py [AREA ...] [--module PATH ...] [--sample 200] [--jobs 2]

``[tool.mutants.areas]`` of ``pyproject.toml`` has the modules of each area and its nearest tests;
``--deselect=`` before one of them leaves it out, as it is slow.
``.ci/mutations.py`` lists the faults, and ``.ci/judging.py`` runs the tests on each; files stay as
they are.

``tests/survivors.toml`` has the faults that no test can see, with the reason. Prints a row for each
module; exits 1 if another fault survives, or if a fault of that list is none or is seen.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from pathlib import Path

from judging import run
from placing import ROOT

TOOLS = ROOT / ".venv" / "tools" / "bin" / "python"
SEED = 18


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
