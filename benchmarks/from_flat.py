"""Fold named patterns from flat: processor time, strain, certificate, signs, stability.

    python benchmarks/from_flat.py [NAME ...]
    python benchmarks/from_flat.py contact [NAME ...]
    python benchmarks/from_flat.py kresling-storey

Without names all patterns of tests/named_patterns.py but the largest are folded; ``miura-60`` has
3,600 facets. With ``contact``, sheets that come to touch themselves are folded without contact and
with it: processor time, pairs of facets that pass through each other, and how far they get. With
``kresling-storey``, a closed storey with elastic creases shows its two stable heights.
"""

from __future__ import annotations

import math
import sys
import time
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "origami" / "energy"))

import energy_problems
import named_patterns
import numpy as np

from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.driven import Driven
from miurafab.origami.energy.equilibrium import Balance, solve
from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.certificate import certified
from miurafab.origami.folding.kinematics import facet_strain
from miurafab.origami.folding.ramp_motion import ramp_motion
from miurafab.origami.folding.ramp_walk import unstable_directions

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

TOUCHING = {
    "roll": partial(named_patterns.roll, 8, 100.0),
    "spiral": partial(named_patterns.roll, 10, 95.0, 0.93),
    "kresling to 72": partial(named_patterns.kresling, 8, 4, 72.0),
    "kresling to 120": partial(named_patterns.kresling, 8, 4, 120.0),
    "pleated hypar to 162": partial(named_patterns.pleated_hypar, 8, 162.0),
    "yoshimura to 60": partial(named_patterns.yoshimura, 8, 8, 60.0),
    "yoshimura to 72": partial(named_patterns.yoshimura, 8, 8, 72.0),
    "miura 20x20": partial(named_patterns.miura, 20),
    "yoshimura 13x16 to 60": partial(named_patterns.yoshimura, 13, 16, 60.0),
}


def contact_row(name: str) -> str:
    """What contact takes and keeps apart in one pattern."""
    pattern = TOUCHING[name]()
    cells = [name, str(len(pattern.faces_vertices))]
    for touching in (False, True):
        started = time.process_time()
        motion, verdict = ramp_motion(pattern, STEPS, touching=touching)
        walked = time.process_time() - started
        pairs = max((len(each.facets) for each in contacts(motion)), default=0)
        error = f"{math.degrees(verdict.angle_error):.1f}"
        cells += [f"{walked:.1f}", str(pairs), f"{motion.states[-1]:.0%}", error]
    return "| " + " | ".join([*cells, str(verdict.snaps)]) + " |"


def storey() -> None:
    """Print the balances of a closed Kresling storey, and in how many directions each falls."""
    model = energy_problems.kresling(1e-3)
    tips = np.array([2 * energy_problems.SIDES, 2 * energy_problems.SIDES + 1])
    driven, free = Driven(model, tips), Balance(model)
    ends = (energy_problems.HEIGHT, energy_problems.kresling_other_state()[0])
    heights = np.linspace(*ends, 31) + 2 * energy_problems.APEX
    way = follow(driven, driven.rest, heights)
    top = way[int(np.argmax([model.energy(state.points) for state in way]))]
    print("| balance | height | closed form | energy | unstable directions |")
    print("| --- | --- | --- | --- | --- |")
    balances = (("high", way[0], ends[0]), ("saddle", top, None), ("low", way[-1], ends[1]))
    for name, state, wanted in balances:
        found = solve(free, state._replace(mu=0.0), 0.0).state
        height = driven.value(found.points) - 2 * energy_problems.APEX
        told = "" if wanted is None else f"{wanted:.6f}"
        energy, falls = model.energy(found.points), unstable_directions(free, found, 0.0)
        print(f"| {name} | {height:.6f} | {told} | {energy:.3g} | {falls} |")


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
    if names[:1] == ["contact"]:
        print("| pattern | facets | s | pairs | end | error | s | pairs | end | error | snaps |")
        print("| --- " * 11 + "|")
        for name in names[1:] or TOUCHING:
            print(contact_row(name), flush=True)
        return
    if names == ["kresling-storey"]:
        storey()
        return
    print(
        "| pattern | facets | s | strain | rigid | residual | wrong | stable | error deg | pairs |"
    )
    print("| --- " * 10 + "|")
    for name in names or [name for name in PATTERNS if name != "miura-60"]:
        print(row(name), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
