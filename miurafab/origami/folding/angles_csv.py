"""Results of a folding motion besides its shapes: fold angles as CSV, and self-contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from miurafab.origami.energy.triangles import facet_triangles
from miurafab.origami.folding.contact import meeting_facets
from miurafab.origami.folding.kinematics import FoldingMotion

ON_EACH_OTHER = np.pi - 1e-3
"""Larger fold angles lay facets on each other: flat-folded, and no collision."""


@dataclass(frozen=True)
class Contact:
    """The pairs of ``facets`` that pass through each other in ``frame``, at ``state``."""

    frame: int
    state: float
    facets: tuple[tuple[int, int], ...]


def contacts(
    motion: FoldingMotion, on_progress: Callable[[float, str], None] | None = None
) -> tuple[Contact, ...]:
    """The frames of ``motion`` in which facets pass through each other.

    Bent facets are the triangles of the bar-and-hinge model. Frames in which a crease is folded
    past :data:`ON_EACH_OTHER` are left out: paper folded flat lies on itself, and coordinates do
    not tell which layer is above.
    """
    pattern, crossing = motion.pattern, []
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    split = facet_triangles(flat, pattern.faces_vertices) if motion.mismatch is None else None
    for frame, (points, angles) in enumerate(zip(motion.frames, motion.fold_angles, strict=True)):
        if on_progress is not None:
            on_progress(frame / len(motion.frames), "self-contact")
        if np.abs(angles).max(initial=0.0) > ON_EACH_OTHER:
            continue
        pairs = meeting_facets(pattern, points, split)
        if len(pairs):
            named = tuple((int(a), int(b)) for a, b in pairs)
            crossing.append(Contact(frame, float(motion.states[frame]), named))
    return tuple(crossing)


def angles_csv(motion: FoldingMotion) -> str:
    """The fold angles as CSV, degrees: one row for each crease, one column for each frame.

    A crease is an edge with a facet on either side. The head of a column is its state.
    """
    pattern = motion.pattern
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    head = ",".join(f"s={state:.9g}" for state in motion.states)
    rows = [f"edge,tail,head,assignment,{head}"]
    degrees = np.degrees(motion.fold_angles[:, inner].T).tolist()
    for edge, (tail, tip), letter, angles in zip(
        inner.tolist(),
        pattern.edges_vertices[inner].tolist(),
        pattern.edges_assignment[inner].tolist(),
        degrees,
        strict=True,
    ):
        values = ",".join(f"{angle:.9g}" for angle in angles)
        rows.append(f"{edge},{tail},{tip},{letter},{values}")
    return "\n".join(rows) + "\n"
