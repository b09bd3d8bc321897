"""Fold named patterns from flat: processor time, strain, certificate, signs, stability.

    python benchmarks/from_flat.py [NAME ...]

Without names all patterns of tests/named_patterns.py but the largest are folded; ``miura-60`` has
3,600 facets.
"""

from __future__ import annotations

import math
import sys
import time
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import named_patterns

from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.certificate import certified
from miurafab.origami.folding.kinematics import facet_strain
from miurafab.origami.folding.ramp_motion import ramp_motion

STEPS = 20
PATTERNS = {
    "miura-10": partial(named_patterns.miura, 10),
    "miura-20": partial(named_patterns.miura, 20),
    "waterbomb-base": named_patterns.waterbomb_base,
    "bird-base": named_patterns.bird_base,
    "square-twist": named_patterns.square_twist,
    "yoshimura": partial(named_patterns.yoshimura, 8, 8, 60.0),
    "kresling": named_patterns.kresling,
    "waterbombs": named_patterns.waterbombs,
    "resch": named_patterns.resch,
    "pleated-hypar": named_patterns.pleated_hypar,
    "miura-60": partial(named_patterns.miura, 60),
}


def row(name: str) -> str:
    """What the motion of one pattern takes and shows."""
    pattern = PATTERNS[name]()
    started = time.process_time()
    motion, verdict = ramp_motion(pattern, STEPS)
    walked = time.process_time()
    motion, certificate = certified(motion)
    met = contacts(motion)
    ended = time.process_time()
    cells = (
        name,
        len(pattern.faces_vertices),
        f"{walked - started:.1f} + {ended - walked:.1f}",
        f"{facet_strain(pattern, motion.frames).max():.0e}",
        "yes" if motion.is_rigid else f"no, at {certificate.state:.0%}",
        f"{certificate.residual:.0e}",
        f"{verdict.wrong_signs:.1%}",
        "no" if verdict.unstable.any() else "yes",
        f"{math.degrees(verdict.angle_error):.1f}",
        max((len(each.facets) for each in met), default=0),
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main(names: list[str]) -> None:
    """Print the table of ``names``."""
    print(
        "| pattern | facets | s | strain | rigid | residual | wrong | stable | error deg | pairs |"
    )
    print("| --- " * 10 + "|")
    for name in names or [name for name in PATTERNS if name != "miura-60"]:
        print(row(name), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
