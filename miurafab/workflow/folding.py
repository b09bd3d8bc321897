"""A folding motion: what it says, and how it is written to a file that moves.

A flat-foldable sheet of degree four goes from flat through its folded form to flat-folded, by
closed form. Any other sheet with a folded form comes from nearly flat to it by bending its facets.
Any other pattern leaves the plane with all creases together. A sheet is never shown by drawing
vertices along straight lines, which no paper could follow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.display import Shown
from miurafab.files import AnyPath, new_file, write_bytes, write_text
from miurafab.findings import Finding, findings_json
from miurafab.geometry.arrays import Floats
from miurafab.options import read_options
from miurafab.options.documented import described
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.continuation import Progress
from miurafab.origami.folding.angles_csv import Contact, angles_csv, contacts
from miurafab.origami.folding.certificate import RigidCertificate
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.folding.facet_energy import facet_energies
from miurafab.origami.folding.judge_motion import median_fold, motion_findings, target_frame
from miurafab.origami.folding.kinematics import (
    CLOSED_FORM,
    FROM_FLAT,
    FoldingMotion,
    facet_strain,
)
from miurafab.origami.folding.layers import LayerOrder, layer_order
from miurafab.origami.folding.layers_apart import CLOSED, layer_shifts, split_facets
from miurafab.origami.folding.motion import FoundMotion, find_motion
from miurafab.origami.folding.ramp_motion import RampVerdict
from miurafab.origami.formats.fold import write_fold
from miurafab.origami.formats.mesh import glb_bytes
from miurafab.workflow.fold_options import ENDINGS, FoldOptions, check_colour
from miurafab.workflow.layers import layer_facts, layer_findings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from miurafab.workflow.page import Curve

_NO_STRAIN, _NO_ENERGY = 1e-9, 1e-12
"""Strains, and energies in k_f times the mean edge, that are rounding."""


@dataclass(frozen=True, eq=False, repr=False)
class Folding(Shown):
    """A folding motion and where it meets itself.

    Parameters
    ----------
    found : FoundMotion
        The frames, how they were found, and whether facets stay flat.
    contacts : tuple of Contact
        The frames in which facets pass through each other.
    layers : LayerOrder, optional
        The order of the layers at the end. None for a motion that does not end folded flat.
    """

    found: FoundMotion
    contacts: tuple[Contact, ...]
    layers: LayerOrder | None = None

    @property
    def motion(self) -> FoldingMotion:
        """The frames."""
        return self.found.motion

    @property
    def mismatch(self) -> float | None:
        """The loop mismatch of the closed form, in mean edges, also where another motion is shown;
        None where the closed form says nothing.
        """
        return self.found.mismatch

    def save(
        self,
        path: AnyPath,
        *,
        title: str = "",
        colour: str | None = None,
        thickness_mm: float = 0.0,
        on_progress: Progress | None = None,
    ) -> None:
        """Write the motion, in the format of the ending of ``path``.

        Parameters
        ----------
        path : str or os.PathLike
            A ``.fold``, ``.gif``, ``.glb`` or ``.html`` file.
        title : str
            The title inside the file. The default is the name of the target.
        {options}
        thickness_mm : float
            How thick a page draws the facets at first; its reader can change it.
        on_progress : callable, optional
            Called with a fraction in 0..1 and a short text.

        Raises
        ------
        InputError
            For another ending, and for a folder that does not exist.
        OptionError
            For colours by strain in a file that has none.
        """
        file = new_file(path, "The motion", ENDINGS)
        by_strain = read_options(FoldOptions, {"colour": colour}).colour == "strain"
        check_colour(file, by_strain=by_strain)
        motion, ending = self.motion, file.suffix.lower()
        pattern, title = motion.pattern, title or motion.pattern.name
        shifts = None if ending == ".fold" else layer_shifts(motion, self.layers)
        if ending == ".fold":
            write_fold(pattern, file, title, motion, self.layers)
        elif ending == ".glb":
            write_bytes(file, _glb(motion, shifts))
        elif ending == ".gif":
            from miurafab.workflow.fold_gif import write_gif

            write_gif(file, motion, _strain(motion) if by_strain else None, on_progress, shifts)
        else:
            from miurafab.workflow.page import Slider, write_page

            slider = Slider(
                names=_names(motion),
                start=target_frame(motion),
                fold_angles=motion.fold_angles,
                strain=_strain(motion),
                show_strain=by_strain,
                shifts=shifts,
                curve=_energy(motion),
                thickness_mm=thickness_mm,
            )
            write_page(file, title=title, pattern=pattern, motion=motion.frames, slider=slider)

    def save_angles(self, path: AnyPath) -> None:
        """Write the fold angle of every crease in every frame, in degrees, to a ``.csv`` file.

        Raises
        ------
        InputError
            For another ending, and for a folder that does not exist.
        """
        file = new_file(path, "The table of angles", (".csv",))
        write_text(file, angles_csv(self.motion))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw five frames of the motion beside each other with matplotlib.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. The default is a new figure.

        Returns
        -------
        matplotlib Axes
        """
        from miurafab.origami.pattern_plot import draw_motion
        from miurafab.origami.plotting import shown

        axes = shown((10.0, 3.2), ax)
        draw_motion(self.motion, axes)
        return axes

    def _summary(self) -> str:
        contacts = f"contacts in {len(self.contacts)} frames" if self.contacts else "no contacts"
        return f"{self.motion._summary()}, {contacts}"

    def _picture(self) -> str:
        return self.motion.pattern._picture()

    def _facts(self) -> Mapping[str, object]:
        told = self.report()
        facts = {key: told[key] for key in ("motion", "max_mismatch", "max_strain", "frames")}
        return facts | {"frames_with_contacts": len(self.contacts)}

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What a person should know of the motion, and of the layers at its end."""
        of_motion = motion_findings(self.found, self.contacts)
        if self.layers is not None:
            return of_motion + layer_findings(self.layers)
        none = "The motion does not end folded flat, so the sheet is given no order of layers."
        return (*of_motion, Finding("no-layer-order", none))

    def report(self) -> dict[str, Any]:
        """The JSON answer of ``fold``; ``states`` are null where they are infinite."""
        motion, verdict = self.motion, self.found.verdict
        strain = facet_strain(motion.pattern, motion.frames)
        return {
            "motion": "rigid" if motion.mismatch is not None else "bending",
            "method": motion.method,
            "rigid": motion.is_rigid,
            "certificate": _certificate(self.found.certificate),
            "max_mismatch": self.mismatch,
            "max_strain": float(strain.max()),
            "frames": len(motion.frames),
            "pieces": motion.pattern.pieces_count,
            "states": motion.states.tolist(),
            **({} if verdict is None else _verdict(verdict)),
            "piercings": max((len(c.facets) for c in self.contacts), default=0),
            "self_contacts": [
                {"frame": c.frame, "state": c.state, "facets": [list(pair) for pair in c.facets]}
                for c in self.contacts
            ],
            "layers": None if self.layers is None else layer_facts(self.layers),
            "findings": findings_json(self.findings),
        }


def _certificate(certificate: RigidCertificate | None) -> dict[str, Any] | None:
    if certificate is None:
        return None
    return {
        "rigid": certificate.rigid,
        "state": certificate.state,
        "residual": certificate.residual,
        "moved_deg": math.degrees(certificate.moved),
    }


def _verdict(verdict: RampVerdict) -> dict[str, Any]:
    return {
        "stable": not verdict.unstable.any(),
        "unstable_directions": verdict.unstable.tolist(),
        "stretch": verdict.strain.tolist(),
        "wrong_signs": verdict.wrong_signs,
        "wrong_edges": verdict.wrong_edges.tolist(),
        "seed_signs": verdict.seed_signs,
        "waiting_edges": verdict.waiting_edges.tolist(),
        "angle_error_deg": math.degrees(verdict.angle_error),
        "snaps": verdict.snaps,
        "contact": verdict.touching,
    }


described(Folding.save, FoldOptions, without=("steps", "timeout", "thickness", "method"))


def folding_of(pattern: CreasePattern, steps: int, on_progress: Progress | None) -> Folding:
    """The motion of a ``pattern`` that does not contradict itself, with its contacts and layers."""
    found = find_motion(pattern, steps, on_progress)
    closed = found.motion.is_rigid and found.motion.method == CLOSED_FORM
    order = layer_order(found.motion.pattern) if closed else None
    return Folding(found, contacts(found.motion, on_progress), order)


def _strain(motion: FoldingMotion) -> Floats | None:
    """(T, F) the strain of the facets; None where it is rounding, which a rigid motion has."""
    strain = facet_strain(motion.pattern, motion.frames)
    return strain if strain.max() > _NO_STRAIN else None


def _energy(motion: FoldingMotion) -> Curve | None:
    """The energy of the facets; None where it is rounding."""
    energies = facet_energies(motion)
    if energies is None or not energies.max() > _NO_ENERGY:
        return None
    from miurafab.workflow.page import Curve

    return Curve(
        "Bending energy of the facets, in k_f times the mean edge",
        energies,
        f"{energies.max():.2g} k_f L",
    )


def _glb(motion: FoldingMotion, shifts: Floats | None) -> bytes:
    """The motion; with ``shifts`` (F, 3) each facet has corners of its own, and in one more frame
    the layers stand apart.
    """
    faces, frames = motion.pattern.faces_vertices, motion.frames
    flat = np.pad(motion.pattern.vertices_coords, ((0, 0), (0, 1)))
    if shifts is not None:
        frames, numbered = split_facets(motion.frames, faces)
        flat, _ = split_facets(flat, faces)
        moves = np.repeat(shifts, (faces >= 0).sum(axis=1), axis=0)
        last = frames[-1:]
        frames = np.concatenate([frames[:-1], last + CLOSED * moves, last + moves])
        faces = numbered
    triangles, _ = triangulate(faces, flat[:, :2])
    return glb_bytes(frames[0], triangles, frames)


def _names(motion: FoldingMotion) -> tuple[str, ...]:
    target = target_frame(motion)
    names = []
    for frame, state in enumerate(motion.states.tolist()):
        if state == 0.0:
            names.append("flat")
        elif motion.method == FROM_FLAT:
            names.append(f"{state:.0%} of the fold angles")
        elif math.isinf(state):
            names.append("folded flat")
        else:
            turned = f"median fold angle {median_fold(motion, frame):.0f}°"
            names.append("the folded form" if frame == target else turned)
    return tuple(names)
