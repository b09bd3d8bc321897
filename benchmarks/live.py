"""How long the studio's coarse answers take, in processor time.

    python benchmarks/live.py [--facets 10x10] [--meshes]

For each built-in surface the coarse fit, its figures and what it needs of the bed, as the process
that answers the page computes them: the least of five answers, each at another size. With
``--meshes`` also the shipped saddle, a cap and a ball, the first answer and the next. At the end
the whole way through a process: what an answer costs it beyond the computing, and its start.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import trimesh

from miurafab.child import python_command
from miurafab.studio.glance import Glances
from miurafab.surfaces.catalogue import CATALOGUE

LAYOUT = {"machine": "grbl-laser-400", "material": "card-250", "options": {}}
SADDLE = Path(__file__).parents[1] / "patterns" / "saddle.stl"


def question(target: str, facets: str, size: int) -> dict[str, Any]:
    """What the page asks while a hand drags the size."""
    options = {"facets": facets, "size": f"{size}mm"}
    return {"do": "coarse", "target": target, "options": options, "layout": LAYOUT}


def answers(target: str, facets: str, count: int = 5) -> list[float]:
    """The seconds of processor time of so many answers in a row."""
    glances, taken = Glances(), []
    for number in range(count):
        begun = time.process_time()
        glances.answer(question(target, facets, 100 + 10 * number), lambda _fraction, _note: None)
        taken.append(time.process_time() - begun)
    return taken


def meshes(folder: Path) -> list[Path]:
    """A saddle, a cap of a sphere, and a ball."""
    ball = trimesh.creation.icosphere(4, 50)
    ball.export(folder / "ball.stl")
    ball.slice_plane([0, 0, 10], [0, 0, 1]).export(folder / "cap.stl")
    return [SADDLE, folder / "cap.stl", folder / "ball.stl"]


def processor_seconds(process: int) -> float:
    """What a process has used up to now (Linux)."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100


def through_a_process(facets: str, count: int = 20) -> tuple[float, float]:
    """The seconds of processor time up to the first answer, and of each later one."""
    with subprocess.Popen(
        python_command("miurafab.studio.live_worker"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        used = []
        for number in range(count + 1):
            asked = {"number": number, **question("hypar", facets, 100 + number)}
            process.stdin.write(json.dumps(asked) + "\n")
            process.stdin.flush()
            assert "answer" in json.loads(process.stdout.readline())
            used.append(processor_seconds(process.pid))
        process.stdin.close()
    return used[0], (used[-1] - used[0]) / count


def main() -> None:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--facets", default="10x10")
    parser.add_argument("--meshes", action="store_true")
    options = parser.parse_args()
    print(f"{options.facets} facets, seconds of processor time")
    for name in CATALOGUE:
        print(f"  {name:12} {min(answers(name, options.facets)):.3f}")
    if options.meshes:
        with tempfile.TemporaryDirectory() as folder:
            for path in meshes(Path(folder)):
                first, *later = answers(str(path), options.facets)
                print(f"  {path.name:12} {first:.3f} first, {min(later):.3f} then")
    if sys.platform == "linux":
        first, each = through_a_process(options.facets)
        print(f"  a process: {first:.2f} up to its first answer, {each:.3f} for each later one")


if __name__ == "__main__":
    main()
