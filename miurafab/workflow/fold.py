"""Folding, from a pattern to a file that moves: the motion, what it says, and how it is written.

A sheet that folds rigidly goes from flat through its folded form to flat-folded, by closed form.
Any other sheet goes from nearly flat to its folded form by bending its facets; it is never shown
by drawing vertices along straight lines, which no paper could follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.errors import InputError, PatternError
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.angles_csv import Contact, angles_csv, contacts
from miurafab.origami.folding.bending import bending_motion
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.folding.kinematics import (
    FoldingMotion,
    facet_strain,
    rigid_motion,
    states_between,
)
from miurafab.origami.folding.thick_panels import ThickPanels
from miurafab.origami.formats.fold import write_fold
from miurafab.origami.formats.mesh import glb_bytes
from miurafab.workflow.fold_gif import target_frame, write_gif
from miurafab.workflow.page import Slider, write_page

DEFAULT_STEPS = 40
ENDINGS = (".fold", ".gif", ".glb", ".html")
"""What a motion can be written as."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False)
class Folding:
    """A ``motion`` and its ``contacts``; ``mismatch`` is the loop mismatch of the rigid motion, in
    mean edges, whether that motion was taken or not.
    """

    motion: FoldingMotion
    contacts: tuple[Contact, ...]
    mismatch: float

    def report(self) -> dict[str, Any]:
        """The JSON answer of ``fold``; ``states`` are null where they are infinite."""
        motion = self.motion
        strain = facet_strain(motion.pattern, motion.frames)
        return {
            "motion": "rigid" if motion.mismatch is not None else "bending",
            "rigid": motion.is_rigid,
            "max_mismatch": self.mismatch,
            "max_strain": float(strain.max()),
            "frames": len(motion.frames),
            "states": motion.states.tolist(),
            "self_contacts": [
                {"frame": c.frame, "state": c.state, "facets": [list(pair) for pair in c.facets]}
                for c in self.contacts
            ],
        }


def fold(
    pattern: CreasePattern,
    steps: int = DEFAULT_STEPS,
    on_progress: Progress | None = None,
) -> Folding:
    """The folding motion of ``pattern`` in ``steps`` steps, and where it meets itself.

    Raises :class:`~miurafab.errors.PatternError` for a sheet that does not fold rigidly and has no
    folded form towards which its facets could be bent, and
    :class:`~miurafab.errors.InputError` for a number of steps that is none.
    """
    if not 2 <= steps <= 1000:
        raise InputError(f"`steps` is {steps}; a motion has between 2 and 1000 steps.")
    motion = rigid_motion(pattern, states_between(pattern, steps))
    assert motion.mismatch is not None
    mismatch = float(motion.mismatch.max())
    if not motion.is_rigid:
        if pattern.folded_coords is None:
            raise PatternError(
                f"The sheet does not fold rigidly: its facets miss each other by up to "
                f"{mismatch:.2g} mean edges, and without a folded form in the file it is not known "
                "towards what they would have to bend."
            )
        try:
            motion = bending_motion(pattern, steps, on_progress)
        except InputError as fault:
            raise PatternError(
                f"The sheet does not fold rigidly (its facets miss each other by up to "
                f"{mismatch:.2g} mean edges), and it cannot be bent either: {fault}"
            ) from None
    return Folding(motion, contacts(motion, on_progress), mismatch)


def check_motion_file(path: Path) -> None:
    """Raise :class:`~miurafab.errors.InputError` for a path that no motion can be written to."""
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path} does not end in one of {', '.join(ENDINGS)}.")
    if not path.resolve().parent.is_dir():
        raise InputError(f"The folder of {path} does not exist.")


def write_motion(
    folding: Folding,
    path: Path,
    title: str = "",
    *,
    by_strain: bool = False,
    on_progress: Progress | None = None,
) -> None:
    """Write the motion to ``path`` in the format of its ending, one of :data:`ENDINGS`.

    ``by_strain`` colours facets by their strain instead of by side, in ``.gif`` and ``.html``.
    """
    check_motion_file(path)
    motion, ending = folding.motion, path.suffix.lower()
    if ending == ".fold":
        write_fold(motion.pattern, path, title, motion)
    elif ending == ".glb":
        triangles, _ = triangulate(motion.pattern.faces_vertices, motion.pattern.vertices_coords)
        path.write_bytes(glb_bytes(motion.frames[0], triangles, motion.frames))
    elif ending == ".gif":
        strain = _strain(motion) if by_strain else None
        write_gif(path, motion, strain, on_progress)
    else:
        slider = Slider(_names(motion), target_frame(motion), _strain(motion), by_strain)
        write_page(path, title=title, pattern=motion.pattern, motion=motion.frames, slider=slider)


def write_angles(folding: Folding, path: Path) -> None:
    """Write the fold angle of every crease in every frame as CSV."""
    path.write_text(angles_csv(folding.motion), encoding="utf-8", newline="\n")


def _strain(motion: FoldingMotion) -> Floats:
    """Strains as the page shows them: rounding, which a rigid motion has for strain, is none."""
    strain = facet_strain(motion.pattern, motion.frames)
    return np.where(strain < 1e-9, 0.0, strain)


def _names(motion: FoldingMotion) -> tuple[str, ...]:
    target = target_frame(motion)
    names = []
    for frame, state in enumerate(motion.states.tolist()):
        if state == 0.0:
            names.append("flat")
        elif math.isinf(state):
            names.append("folded flat")
        else:
            names.append("the folded form" if frame == target else f"s = {state:.3g}")
    return tuple(names)


def thickness_report(panels: ThickPanels) -> dict[str, Any]:
    """The part of the JSON answer of ``fold`` about thick panels."""
    pattern = panels.pattern
    creases = np.flatnonzero(panels.hinge_side != "")
    finite = panels.offset_mm[creases][np.isfinite(panels.offset_mm[creases])]
    return {
        "thickness_mm": panels.thickness_mm,
        "folds": panels.folds,
        "least_scale": panels.least_scale,
        "greatest_thickness_mm": float(panels.limit_mm.min()),
        "max_offset_mm": float(finite.max(initial=0.0)),
        "facets_too_small": [
            {"facet": int(facet), "greatest_thickness_mm": float(panels.limit_mm[facet])}
            for facet in panels.too_small
        ],
        "collisions": [
            {"state": state, "facets": [one, other]} for state, one, other in panels.collisions
        ],
        "creases": [
            {
                "edge": int(edge),
                "assignment": str(pattern.edges_assignment[edge]),
                "fold_deg": math.degrees(pattern.edges_fold_angle[edge]),
                "hinge_side": str(panels.hinge_side[edge]),
                "offset_mm": float(panels.offset_mm[edge]),
            }
            for edge in creases
        ],
    }
