"""What is wrong with a pattern, and what is hard to fold in it: the findings of the audit.

:func:`gather` recomputes what the judgement needs, once: residuals and facets that meet.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from miurafab.findings import Finding, counted
from miurafab.geometry.arrays import Bools, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami import invariants
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import opened_cuts
from miurafab.origami.flat_folding import judge_flat_folding
from miurafab.origami.folding.contact import (
    TOGETHER,
    lie_together,
    overlaps,
    self_intersections,
)
from miurafab.origami.invariants import DEGENERATE, EXACT, ROUNDINGS, Residuals
from miurafab.origami.judge_creases import (
    MeasuredFolds,
    judge_creases,
    measured_folds,
    unmeasured,
)
from miurafab.origami.meeting_borders import meeting_borders

if TYPE_CHECKING:
    from miurafab.origami.verify import Measurements

STEEP_FOLD = math.radians(165)
"""A crease beyond this angle nearly lies on its neighbour."""

MUCH_PAPER = 4.0
"""From this area ratio on, the paper lies in more than four layers on average."""

LITTLE_COVERED, MUCH_OVERHANG = 0.95, 0.01


@dataclass(frozen=True, eq=False)
class Evidence:
    """The pairs of facets (n, 2) that overlap when flat and cross when folded, and the residuals,
    which are None without a folded form.
    """

    overlaps: Ints
    crossings: Ints
    residuals: Residuals | None
    folds: MeasuredFolds | None


def gather(pattern: CreasePattern) -> Evidence:
    """Everything that :func:`judge` needs of ``pattern``."""
    if pattern.folded_coords is None:
        return Evidence(overlaps(pattern), np.empty((0, 2), dtype=np.int64), None, None)
    found = invariants.residuals(pattern)
    return Evidence(
        overlaps(pattern), self_intersections(pattern), found, measured_folds(pattern, found)
    )


def judge_quality(measured: Measurements, *, fitted: bool) -> Iterator[Finding]:
    """What makes a sheet hard to fold or leaves target out; all of it is left to the maker.

    Only one that is ``fitted`` to a target can be asked for with other creases.
    """
    shape = measured.quality
    if shape is not None and shape.fold_angles[2] > STEEP_FOLD:
        yield Finding(
            "steep-folds",
            f"Creases fold by up to {math.degrees(shape.fold_angles[2]):.0f} degrees, and facets "
            "nearly lie on each other there"
            + ("; ask for other `facets`, or a lower `amplitude` or `zigzag`." if fitted else "."),
        )
    if measured.area_ratio is not None and measured.area_ratio > MUCH_PAPER:
        yield Finding(
            "much-paper",
            f"The sheet takes {measured.area_ratio:.1f} times the area of the target under it, so "
            "it is thick and steep; lower `zigzag` or `amplitude`.",
        )
    if measured.coverage is not None and measured.coverage < LITTLE_COVERED:
        yield Finding(
            "coverage",
            f"The sheet covers {100 * measured.coverage:.1f} % of the target's area.",
        )
    if measured.overhang is not None and measured.overhang > MUCH_OVERHANG:
        yield Finding(
            "overhang",
            f"{100 * measured.overhang:.1f} % of the sheet reaches beyond the border of the target "
            "or lies over its holes.",
        )


def _target(pattern: CreasePattern) -> Iterator[Finding]:
    """Whether the target and its scale are known to be those of the folded form."""
    if pattern.target_kept is None:
        yield Finding(
            "not-proven",
            "The file has no `miurafab:target_sha256`, so it is not known whether its target and "
            "`miurafab:scale` are those of the folded form.",
        )
    elif not pattern.target_kept:
        yield Finding(
            "scale",
            "The target or its scale is not the one that the pattern was written with, and "
            "distances to it would be untrue; fit again, or take `miurafab:target` out.",
        )


def judge(pattern: CreasePattern, evidence: Evidence) -> Iterator[Finding]:
    """The faults of ``pattern``."""
    edges = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    short = np.flatnonzero(edges < DEGENERATE * edges.mean())
    if len(short):
        yield Finding(
            "degenerate-edge",
            f"{_these(short, 'edge')} shorter than a millionth of the mean edge (down to "
            f"{edges[short].min():.1e} mm): they cannot be creased or cut, so the sheet cannot "
            "be made. Fit again with `min_edge`, or convert a file of another program with a "
            "`tolerance` above that.",
            tuple(short.tolist()),
        )
    yield from _shapes(pattern)
    yield from _target(pattern)
    yield from opened_cuts(pattern)
    yield from judge_creases(pattern, evidence.folds)
    if evidence.folds is None:
        yield from judge_flat_folding(pattern)
        says = (
            "Without a folded form it is not known whether the facets stay flat and keep clear of "
            "each other."
        )
        yield Finding("not-proven", says)
    else:
        yield from unmeasured(evidence.folds, pattern)
    if len(evidence.overlaps):
        yield _overlap(pattern, evidence.overlaps)
    found = evidence.residuals
    exact = EXACT if found is None else found.exact
    gaps = invariants.seam_gaps(pattern)
    open_seams = np.flatnonzero(~(gaps <= exact))
    if len(open_seams):
        yield Finding(
            "seam",
            f"{_these(open_seams, 'seam')} not closed: the two edges differ by up to "
            f"{gaps[open_seams].max():.1e} mean edges in length or in place.",
            tuple(open_seams.tolist()),
        )
    yield from _unlisted(pattern)
    if found is not None:
        yield from _inexact(found)
    pairs = evidence.crossings
    if found is not None and pattern.grid is None and pattern.cells is None:
        lying = _lie_together(pattern, pairs, found.worst)
        if lying.any():
            one, other = pairs[lying][0].tolist()
            yield Finding(
                "not-proven",
                counted(int(lying.sum()), "pair of facets lies", "pairs of facets lie")
                + f" on each other in the folded form, the first being facets {one} and {other}; "
                "the order of such layers is not judged.",
            )
        pairs = pairs[~lying]
    if len(pairs):
        one, other = pairs[0].tolist()
        yield Finding(
            "self-intersection",
            counted(
                len(pairs),
                "pair of facets passes through or lies",
                "pairs of facets pass through or lie",
            )
            + f" on each other in the folded form, the first being facets {one} and {other}.",
            tuple(np.unique(pairs).tolist()),
        )


def _lie_together(pattern: CreasePattern, pairs: Ints, worst: float) -> Bools:
    """(n,) whether the two facets of each of ``pairs`` lie in one plane of the folded form, whose
    largest residual is ``worst``.
    """
    assert pattern.folded_coords is not None
    return lie_together(pattern, pattern.folded_coords, pairs, TOGETHER + ROUNDINGS * worst)


def proved(
    pattern: CreasePattern, evidence: Evidence, findings: Iterable[Finding]
) -> tuple[str, ...]:
    """What the audit with these ``findings`` has proved of ``pattern``, in sentences."""
    broken = {finding.code for finding in findings}
    facets, edges = len(pattern.faces_vertices), len(pattern.edges_vertices)
    lattice = pattern.grid is not None or pattern.cells is not None
    claims = [
        (
            {"double-edge", "facets", "turned-over", "bow-tie", "degenerate-edge"},
            f"The {counted(facets, 'facet fits', 'facets fit')}"
            + f" the {edges} edges"
            + (" and the lattice." if lattice else "."),
        ),
        ({"assignment"}, f"The letters of {edges} edges agree with their facets and fold angles."),
        ({"overlap"}, "No facets overlap in the flat pattern."),
    ]
    folds = evidence.folds
    if folds is not None:
        sized, signed = int(folds.known.sum()), int(folds.signed.sum())
        claims += [
            (
                {"fold-angle", "assignment"},
                f"{sized} fold angles, {signed} of them with their sign, are those of the folded "
                "form.",
            ),
            (
                {"planarity", "isometry", "developability"},
                f"The {facets} facets are flat, and the same in both forms{_within(evidence)}.",
            ),
        ]
        if not len(evidence.crossings):
            claims.append((set(), "No facets meet in the folded form."))
    if pattern.seams is not None:
        claims.append(({"seam"}, f"The two edges of each of {len(pattern.seams)} seams fit."))
    return tuple(sentence for codes, sentence in claims if not codes & broken)


def _within(evidence: Evidence) -> str:
    """How well forms agree of which more is not known than the digits of their file tell."""
    assert evidence.residuals is not None
    left = evidence.residuals.worst
    return f" within {left:.2g} mean edges or radians" if left > EXACT else ""


def unlisted_seams(pattern: CreasePattern) -> Ints:
    """(n, 2) the border edges that meet in the folded form and are in none of the seams that the
    pattern names.
    """
    if pattern.seams is None:
        return np.empty((0, 2), dtype=np.int64)
    pairs = meeting_borders(pattern)
    return np.asarray(pairs[~np.isin(pairs, pattern.seams).any(axis=1)])


def _unlisted(pattern: CreasePattern) -> Iterator[Finding]:
    pairs = unlisted_seams(pattern)
    if pattern.seams is not None and len(pairs):
        one, other = pairs[0].tolist()
        yield Finding(
            "seam",
            counted(len(pairs), "pair of border edges meets", "pairs of border edges meet")
            + f" in the folded form outside the {len(pattern.seams)} seams, the first being edges "
            f"{one} and {other}; name them in `miurafab:seams`, or leave that out, and all are "
            "found.",
            tuple(np.unique(pairs).tolist()),
        )


def _shapes(pattern: CreasePattern) -> Iterator[Finding]:
    """Facets of a shape that does not unfold, and of one that is hard to fold."""
    crossed = invariants.crossed_facets(pattern)
    if len(crossed):
        yield Finding(
            "bow-tie",
            f"{_these(crossed, 'facet')} folded over, two sides crossing as in a bow-tie: no piece "
            "of paper has that shape.",
            tuple(crossed.tolist()),
        )
    dented = invariants.dented_facets(pattern)
    if len(dented):
        yield Finding(
            "dented",
            f"{_these(dented, 'facet')} not convex, which folds badly.",
            tuple(dented.tolist()),
        )


def _overlap(pattern: CreasePattern, pairs: Ints) -> Finding:
    within = pairs
    if pattern.pieces is not None:
        within = pairs[pattern.pieces[pairs[:, 0]] == pattern.pieces[pairs[:, 1]]]
    (one, other), *_ = pairs if not len(within) else within
    if len(within):
        sentence = (
            counted(len(within), "pair of facets overlaps", "pairs of facets overlap")
            + f" in the flat pattern, the first being facets {one} and {other}: it cannot be cut "
            "from one piece."
        )
    else:
        sentence = (
            "Pieces lie on each other in the flat pattern ("
            + counted(len(pairs), "pair of facets", "pairs of facets")
            + f", the first being {one} and {other}): they have to lie apart."
        )
    return Finding("overlap", sentence, tuple(np.unique(pairs).tolist()))


def _inexact(found: Residuals) -> Iterator[Finding]:
    """Where planarity, developability and isometry are not exact."""
    facets = np.arange(len(found.planarity))
    checks = (
        ("planarity", "planar", "facet", facets, found.planarity),
        ("developability", "developable", "vertex", found.interior, found.developability),
        ("isometry", "the same flat and folded", "facet", facets, found.isometry),
    )
    for code, virtue, noun, names, values in sorted(
        checks, key=lambda check: -check[-1].max(initial=0.0)
    ):
        over = ~(values <= found.exact)
        if over.any():
            where = names[over]
            yield Finding(
                code,
                f"{_these(where, noun)} not {virtue}: up to {values.max():.1e}, over "
                f"{found.exact:.0e}.",
                tuple(where.tolist()),
            )


def _these(numbers: Ints, noun: str) -> str:
    """``Edge 7 is`` or ``12 edges (3, 4, 5, 6, 7, ...) are``."""
    if len(numbers) == 1:
        return f"{noun.capitalize()} {numbers[0]} is"
    shown = ", ".join(str(n) for n in numbers[:5]) + (", ..." if len(numbers) > 5 else "")
    several = "vertices" if noun == "vertex" else noun + "s"
    return f"{len(numbers)} {several} ({shown}) are"
