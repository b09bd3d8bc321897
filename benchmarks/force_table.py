"""The tables in docs/forces.md: the force that pulls a sheet, and on what it depends.

    python benchmarks/force_table.py [docs/forces.md]

Prints the tables, or writes them into the page between ``<!-- force_table: NAME -->`` and
``<!-- end -->``. Everything is computed afresh, and the same every time.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from page_tables import Rows, markdown, write_tables

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.energy.path import main_crease
from miurafab.origami.energy.pull import PullCurve, pull
from miurafab.origami.energy.yielding import YieldingDriven
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.fitting.scaling import with_residual, worst_residual
from miurafab.surfaces.catalogue import make_surface

PAPER = Paper(0.2, 3e9, crease_length_mm=33.0, yield_angle=0.3, hardening=0.1)
"""Thickness and modulus of the experiment of Dudte et al. (2016); a crease length of 165
thicknesses, between the two folded papers of docs/forces.md; the rest is assumed."""
DISTANCE_MM, STRAIN, MEASURED_N = 90.0, 0.2, 0.431
FACETS = 10
CORNER = FACETS
LAST = (FACETS + 1) ** 2 - 1
MIDDLE = FACETS // 2
POINTS = {
    "corners": (0, LAST),
    "other corners": (CORNER, LAST - CORNER),
    "middles of the sides across the rows": (MIDDLE, LAST - MIDDLE),
    "middles of the sides along the rows": (
        MIDDLE * CORNER + MIDDLE,
        LAST - MIDDLE * CORNER - MIDDLE,
    ),
}


@cache
def fitted(polish: str = "on", limit: float | None = None) -> CreasePattern:
    """The hypar of the tables, with or without a limit on the residual in radians."""
    surface, _ = make_surface("hypar", {"height": 0.5})
    request = FitRequest(
        surface=surface,
        facets=(FACETS, FACETS),
        size_mm=200.0,
        polish=polish,
        flat_foldable=limit,
    )
    pattern = fit(request).pattern
    assert pattern is not None
    return pattern


def pairs() -> dict[str, tuple[CreasePattern, CreasePattern]]:
    """Two sheets of one target, the first with ten times the residual."""
    fair, plain = fitted(), fitted("off")
    worst = worst_residual(fair)
    return {
        "fitted": (fair, fitted(limit=worst / 10)),
        "fitted, all residuals scaled": (with_residual(fair, 0.16), with_residual(fair, 0.016)),
        "not polished, all residuals scaled": (plain, with_residual(plain, 0.016)),
    }


def pulled(
    pattern: CreasePattern, ends: tuple[int, int], paper: Paper = PAPER, **how: float
) -> PullCurve:
    """``pattern`` at the size at which ``ends`` are 90 mm apart, pulled to a strain of 0.2."""
    assert pattern.folded_coords is not None
    apart = float(np.linalg.norm(pattern.folded_coords[ends[0]] - pattern.folded_coords[ends[1]]))
    options = {"steps": 20, "cycles": 3, "uncut": 1.0} | how
    curve = pull(
        pattern.scaled(DISTANCE_MM / apart),
        paper,
        ends,
        strain=STRAIN,
        steps=int(options["steps"]),
        cycles=int(options["cycles"]),
        uncut=options["uncut"],
    )
    assert curve.converged
    return curve


@cache
def forces() -> tuple[tuple[str, ...], Rows]:
    """Every pair of sheets at every pair of points."""
    head = (
        "sheets",
        "worst residuals",
        "pulled at",
        "force (N)",
        "ratio",
        "stays longer by (mm)",
        "cycle 2 against 1 (N)",
        "cycle 3 against 2 (N)",
    )
    rows = []
    for name, pair in pairs().items():
        for where, ends in POINTS.items():
            a, b = (pulled(pattern, ends).report() for pattern in pair)
            rows.append(
                (
                    name,
                    " / ".join(f"{worst_residual(pattern):.2g}" for pattern in pair),
                    where,
                    f"{a['force_n']:.3f} / {b['force_n']:.3f}",
                    f"{a['force_n'] / b['force_n']:.2f}",
                    f"{a['set_mm']:.1f} / {b['set_mm']:.1f}",
                    f"{a['second_cycle_change_n']:.3f} / {b['second_cycle_change_n']:.3f}",
                    f"{_small(a['third_cycle_change_n'])} / {_small(b['third_cycle_change_n'])}",
                )
            )
    return head, rows


def summary() -> list[str]:
    """What the first table says, in sentences."""
    found = forces()[1]

    def pair_of(row: tuple[str, ...], column: int) -> list[float]:
        return [float(cell.replace("< ", "")) for cell in row[column].split(" / ")]

    corners = [pair_of(row, 3)[0] / MEASURED_N for row in found if row[2] == "corners"]
    every = [force for row in found for force in pair_of(row, 3)]
    ratios = {
        kind: [float(r[4]) for r in found if (r[0] == "fitted") is kind] for kind in (True, False)
    }
    last = max(change for row in found for change in pair_of(row, 7))
    first = min(change for row in found for change in pair_of(row, 6))
    return [
        f"Pulled at its corners a sheet takes {min(corners):.2f} to {max(corners):.2f} times the "
        f"force that was measured; at all points {min(every):.2f} to {max(every):.2f} N.",
        f"The second cycle differs from the first by {first:.2f} N or more, and the third from the "
        f"second by {last:g} N at most.",
        "Of two fitted sheets, that with the larger residual takes "
        f"{min(ratios[True]):.2f} to {max(ratios[True]):.2f} times the force of the other. Where "
        f"all residuals of one sheet are scaled, it takes {min(ratios[False]):.2f} to "
        f"{max(ratios[False]):.2f} times the force: at some points it is the softer one.",
    ]


def _small(force: float) -> str:
    return "< 1e-6" if force < 1e-6 else f"{force:.0e}"


def sensitivity() -> tuple[tuple[str, ...], Rows]:
    """The fitted pair at its corners, with one constant changed at a time."""
    changes: list[tuple[str, Paper, dict[str, float]]] = [("as above", PAPER, {})]
    changes += [
        (f"crease length {v:g} mm", replace(PAPER, crease_length_mm=v), {})
        for v in (15.0, 25.0, 66.0, 100.0)
    ]
    changes += [
        (f"thickness {v:g} mm", replace(PAPER, thickness_mm=v), {}) for v in (0.1, 0.15, 0.25)
    ]
    changes += [(f"modulus {v:g} GPa", replace(PAPER, modulus_pa=v * 1e9), {}) for v in (1.5, 5.0)]
    changes += [(f"share left uncut {v:g}", PAPER, {"uncut": v}) for v in (0.4, 0.1)]
    changes += [
        (f"yield angle {v:g} rad", replace(PAPER, yield_angle=v), {}) for v in (0.15, 0.6, math.inf)
    ]
    changes += [(f"hardening {v:g}", replace(PAPER, hardening=v), {}) for v in (0.02, 0.3)]
    changes += [(f"{v} steps", PAPER, {"steps": v}) for v in (40, 80)]
    head = ("changed", "force (N)", "over the first row", "ratio of the pair", "yielded creases")
    rows, first = [], 0.0
    for name, paper, how in changes:
        a, b = (
            pulled(pattern, POINTS["corners"], paper, cycles=1, **how).report()
            for pattern in pairs()["fitted"]
        )
        first = first or a["force_n"]
        rows.append(
            (
                name.replace("inf rad", "infinite"),
                f"{a['force_n']:.3f}",
                f"{a['force_n'] / first:.2f}",
                f"{a['force_n'] / b['force_n']:.2f}",
                f"{a['yielded']:.0%}",
            )
        )
    return head, rows


def bistability() -> tuple[tuple[str, ...], Rows]:
    """With ever softer creases: the force, and whether the sheet has a second stable state."""
    head = ("share left uncut", "force (N)", "second stable state", "with yielding creases")
    ends = POINTS["corners"]
    pattern = fitted("off")
    apart = float(np.linalg.norm(pattern.folded_coords[ends[0]] - pattern.folded_coords[ends[1]]))
    pattern = pattern.scaled(DISTANCE_MM / apart)
    rows = []
    for share in (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 0.0):
        model = sheet_model(pattern, paper=PAPER, uncut=share)
        elastic = energy_curve(pattern, 24, model=model).bistable
        rows.append(
            (
                f"{share:g}",
                f"{pulled(pattern, ends, cycles=1, uncut=share).report()['force_n']:.2g}",
                "yes" if elastic else "no",
                "yes" if _holds_open(pattern, share) else "no",
            )
        )
    return head, rows


def _holds_open(pattern: CreasePattern, share: float) -> bool:
    """Whether the sheet, opened to 8 degrees of a crease in its middle, goes on towards flat."""
    model = sheet_model(pattern, paper=PAPER, uncut=share)
    yields = np.full(len(model.hinges), math.inf)
    yields[-len(model.creases) :] = PAPER.yield_angle
    stencil = model.creases[main_crease(model)]
    driven = YieldingDriven(model, stencil, yields=yields, hardening=PAPER.hardening)
    start = driven.value(model.points)
    drives = np.linspace(start, math.copysign(math.radians(8), start), 31)
    states = follow(driven, driven.rest, drives)
    assert len(states) == len(drives)
    loads = [driven.load(*pair) for pair in zip(states, drives, strict=True)]
    # the sheet opens while the load is against the folded angle; then it goes on by itself
    return bool(max(np.sign(start) * np.array(loads)) > 1e-12)


TABLES: dict[str, Callable[[], str]] = {
    "forces": lambda: markdown(*forces()),
    "summary": lambda: "".join(f"- {sentence}\n" for sentence in summary()),
    "sensitivity": lambda: markdown(*sensitivity()),
    "bistability": lambda: markdown(*bistability()),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", nargs="?", type=Path, help="The page to write the tables into.")
    options = parser.parse_args()
    tables = {name: make() for name, make in TABLES.items()}
    write_tables(options.page, "force_table", tables)


if __name__ == "__main__":
    main()
