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
from closest_sheet import closest
from page_tables import Rows, markdown, write_tables

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.path import main_crease
from miurafab.origami.energy.pull import PullCurve, pull
from miurafab.origami.energy.yielding import YieldingDriven
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.fitting.scaling import with_residual, worst_residual
from miurafab.origami.verify import measure, with_distances
from miurafab.surfaces.catalogue import make_surface

PAPER = Paper(0.2, 3e9, crease_length_mm=33.0, yield_angle=0.3, hardening=0.1)
"""Thickness and modulus of the experiment of Dudte et al. (2016); a crease length of 165
thicknesses, between the two folded papers of docs/forces.md; the rest is assumed."""
DISTANCE_MM, STRAIN, MEASURED_N = 90.0, 0.2, 0.431
FACETS = 10
MIDDLE = FACETS // 2
SHARES = (1.0, 0.1, 0.01, 1e-3, 1e-4, 0.0)
INWARD = (0, 1, 2)
"""Vertices from the border."""


def points(inward: int = 0) -> dict[str, tuple[int, int]]:
    """The pairs of vertices that are pulled, so many vertices from the border."""

    def at(row: int, column: int) -> int:
        return row * (FACETS + 1) + column

    near, far = inward, FACETS - inward
    return {
        "corners": (at(near, near), at(far, far)),
        "other corners": (at(near, far), at(far, near)),
        "middles of the sides across the rows": (at(near, MIDDLE), at(far, MIDDLE)),
        "middles of the sides along the rows": (at(MIDDLE, near), at(MIDDLE, far)),
    }


POINTS = points()


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


@cache
def nearest() -> tuple[CreasePattern, CreasePattern]:
    """The sheet nearest to the target, and the nearest one within a tenth of its residual."""
    surface, _ = make_surface("hypar", {"height": 0.5})
    request = FitRequest(surface=surface, facets=(FACETS, FACETS), size_mm=200.0)
    plain = closest(request)
    within = closest(replace(request, flat_foldable=plain.worst / 10))
    assert plain.sheet.pattern is not None
    assert within.sheet.pattern is not None
    return plain.sheet.pattern, within.sheet.pattern


def pairs() -> dict[str, tuple[CreasePattern, CreasePattern]]:
    """Two sheets of one target, the first with ten times the residual."""
    fair, plain = fitted(), fitted("off")
    worst = worst_residual(fair)
    return {
        "nearest": nearest(),
        "fitted": (fair, fitted(limit=worst / 10)),
        "fitted, all residuals scaled": (with_residual(fair, 0.16), with_residual(fair, 0.016)),
        "not polished, all residuals scaled": (plain, with_residual(plain, 0.016)),
    }


def pulled(
    pattern: CreasePattern, ends: tuple[int, int], paper: Paper = PAPER, **how: float
) -> PullCurve:
    """``pattern`` at the size at which ``ends`` are 90 mm apart, pulled to a strain of 0.2."""
    options = {"steps": 20, "cycles": 3, "uncut": 1.0} | how
    curve = pull(
        pattern.scaled(DISTANCE_MM / _apart(pattern, ends)),
        paper,
        ends,
        strain=STRAIN,
        steps=int(options["steps"]),
        cycles=int(options["cycles"]),
        uncut=options["uncut"],
    )
    assert curve.converged
    return curve


def _apart(pattern: CreasePattern, ends: tuple[int, int]) -> float:
    assert pattern.folded_coords is not None
    return float(np.linalg.norm(pattern.folded_coords[ends[0]] - pattern.folded_coords[ends[1]]))


def _residuals(pair: tuple[CreasePattern, CreasePattern]) -> str:
    return " / ".join(f"{worst_residual(pattern):.2g}" for pattern in pair)


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
                    _residuals(pair),
                    where,
                    f"{a['force_n']:.3f} / {b['force_n']:.3f}",
                    f"{a['force_n'] / b['force_n']:.2f}",
                    f"{a['set_mm']:.1f} / {b['set_mm']:.1f}",
                    f"{a['second_cycle_change_n']:.3f} / {b['second_cycle_change_n']:.3f}",
                    f"{_small(a['third_cycle_change_n'])} / {_small(b['third_cycle_change_n'])}",
                )
            )
    return head, rows


@cache
def sheets() -> tuple[tuple[str, ...], Rows]:
    """What the sheets of each pair have in common, and what not."""
    head = ("sheets", "worst residuals", "distance from the target (mm)", "folded by (deg)")
    rows = []
    surface, _ = make_surface("hypar", {"height": 0.5})
    for name, pair in pairs().items():
        away, folded = [], []
        for pattern in pair:
            found = with_distances(measure(pattern), pattern, surface)
            assert found.hausdorff_midsurface_mm is not None
            away.append(f"{found.hausdorff_midsurface_mm:.2f}")
            model = sheet_model(pattern)
            angles = np.degrees(np.abs(hinge_angles(model.points, model.creases)))
            folded.append(f"{np.median(angles):.0f}")
        rows.append((name, _residuals(pair), " / ".join(away), " / ".join(folded)))
    return head, rows


@cache
def inward() -> tuple[tuple[str, ...], Rows]:
    """The ratio of each pair where it is pulled at the border, and one and two vertices inside."""
    head = (
        "sheets",
        "pulled at",
        "share of the facets at the ends",
        "ratio",
        "one vertex further in",
        "two vertices further in",
    )
    rows = []
    for name, pair in pairs().items():
        for where in POINTS:
            ratios, shares = [], []
            for steps in INWARD:
                ends = points(steps)[where]
                a, b = (pulled(pattern, ends, cycles=1) for pattern in pair)
                ratios.append(f"{a.report()['force_n'] / b.report()['force_n']:.2f}")
                if not steps:
                    shares = [
                        f"{end_share(pattern, curve):.0%}"
                        for pattern, curve in zip(pair, (a, b), strict=True)
                    ]
            rows.append((name, where, " / ".join(shares), *ratios))
    return head, rows


@cache
def softened() -> tuple[tuple[str, ...], Rows]:
    """The two nearest sheets with ever softer creases, pulled at the four places."""
    rows = []
    for share in SHARES:
        cells = []
        for ends in POINTS.values():
            a, b = (
                pulled(pattern, ends, cycles=1, uncut=share).report()["force_n"]
                for pattern in nearest()
            )
            cells.append(f"{a:.2g} / {b:.2g} = {a / b:.2f}")
        rows.append((f"{share:g}", *cells))
    return ("share left uncut", *(f"{where} (N)" for where in POINTS)), rows


def end_share(pattern: CreasePattern, curve: PullCurve) -> float:
    """The part of the turning of all creases, weighed by their stiffness and squared, that is in
    the creases of the facets at the two pulled vertices.
    """
    model = sheet_model(pattern.scaled(curve.distances[0] / _apart(pattern, curve.ends)))
    most = curve.coords[int(np.argmax(curve.distances))] / model.unit_mm
    turned = hinge_angles(most, model.creases) - hinge_angles(model.points, model.creases)
    along = model.points[model.creases[:, 1]] - model.points[model.creases[:, 0]]
    work = np.linalg.norm(along, axis=1) * turned**2
    at_ends = [bool({*curve.ends} & {*face.tolist()}) for face in pattern.faces_vertices]
    mine = np.array(at_ends)[pattern.edges_faces[model.creases_edges]].any(axis=1)
    return float(work[mine].sum() / work.sum())


def summary() -> list[str]:
    """What the first table says, in sentences."""
    found = forces()[1]

    def pair_of(row: tuple[str, ...], column: int) -> list[float]:
        return [float(cell.replace("< ", "")) for cell in row[column].split(" / ")]

    corners = [pair_of(row, 3)[0] / MEASURED_N for row in found if row[2] == "corners"]
    every = [force for row in found for force in pair_of(row, 3)]
    last = max(change for row in found for change in pair_of(row, 7))
    first = min(change for row in found for change in pair_of(row, 6))
    return [
        f"Pulled at its corners a sheet takes {min(corners):.2f} to {max(corners):.2f} times the "
        f"force that was measured; at all points {min(every):.2f} to {max(every):.2f} N.",
        f"The second cycle differs from the first by {first:.2f} N or more, and the third from the "
        f"second by {last:g} N at most.",
        *_ratios(),
    ]


def _ratios() -> list[str]:
    """What the table of ratios says, in sentences."""
    rows = inward()[1]

    def spread(kinds: tuple[str, ...]) -> str:
        all_of = [float(n) for row in rows if row[0] in kinds for n in row[3:6]]
        return f"{min(all_of):.2f} to {max(all_of):.2f}"

    scaled = tuple({row[0] for row in rows} - {"fitted", "nearest"})
    worst = min((row for row in rows if row[0] in scaled), key=lambda row: float(row[3]))
    free = [float(cell.split(" = ")[1]) for cell in softened()[1][-1][1:]]
    return [
        f"The sheet with the larger residual takes {spread(('fitted',))} times the force of the "
        f"other where both are fitted, {spread(('nearest',))} times where both are the nearest to "
        f"the target, and {spread(scaled)} times where all residuals of one are scaled.",
        f"With creases that turn freely it takes {min(free):.1f} to {max(free):.1f} times the "
        "force of the other at the four places of the nearest pair.",
        f"Where residuals are scaled it is softest at the {worst[1]} of the sheets {worst[0]} "
        f"({worst[3]}); one vertex further in it takes {worst[4]} times the force there.",
    ]


def _small(force: float) -> str:
    return "< 1e-6" if force < 1e-6 else f"{force:.0e}"


def sensitivity() -> tuple[tuple[str, ...], Rows]:
    """The fitted pair at its corners and elsewhere, with one constant changed at a time."""
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
    head = (
        "changed",
        "force (N)",
        "over the first row",
        "ratio of the pair",
        "least ratio at the four places",
        "yielded creases",
    )
    rows, first = [], 0.0
    for name, paper, how in changes:
        found = {
            where: [
                pulled(pattern, ends, paper, cycles=1, **how).report()
                for pattern in pairs()["fitted"]
            ]
            for where, ends in POINTS.items()
        }
        a, b = found["corners"]
        first = first or a["force_n"]
        rows.append(
            (
                name.replace("inf rad", "infinite"),
                f"{a['force_n']:.3f}",
                f"{a['force_n'] / first:.2f}",
                f"{a['force_n'] / b['force_n']:.2f}",
                f"{min(x['force_n'] / y['force_n'] for x, y in found.values()):.2f}",
                f"{a['yielded']:.0%}",
            )
        )
    return head, rows


def bistability() -> tuple[tuple[str, ...], Rows]:
    """With ever softer creases: the force, and whether the sheet has a second stable state."""
    head = ("share left uncut", "force (N)", "second stable state", "with yielding creases")
    ends = POINTS["corners"]
    pattern = fitted("off")
    pattern = pattern.scaled(DISTANCE_MM / _apart(pattern, ends))
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
    "sheets": lambda: markdown(*sheets()),
    "inward": lambda: markdown(*inward()),
    "softened": lambda: markdown(*softened()),
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
