"""The loop closed: what a job burns, folded and glued in memory, is the shell.

The programs of the job run on the controller in memory. From its beam log alone the pieces are
measured (:mod:`~miurafab.fabrication.recover`), folded by the angles of the pattern and glued
(:mod:`~miurafab.fabrication.glue`); the layout only says which line is which. The shell is then
laid on the folded form, and compared with the target.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from miurafab.display import Shown
from miurafab.errors import InputError, JobStopped, PatternError
from miurafab.fabrication.glue import glued_shell, laid_on
from miurafab.fabrication.recover import recovered_corners
from miurafab.fabrication.retrace import patches_on_sheets
from miurafab.files import AnyPath, as_path
from miurafab.gcode.job import Job
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import facet_means
from miurafab.machine.dialects import virtual_machine
from miurafab.machine.planning import plan_job
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import VirtualTransport
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.fold import read_fold
from miurafab.origami.nearness import uncut
from miurafab.profiles import MachineProfile
from miurafab.surfaces.description import described_surface
from miurafab.workflow.job_directory import read_written
from miurafab.workflow.job_files import job_material
from miurafab.workflow.manifest import pattern_name, read_manifest


@dataclass(frozen=True, repr=False)
class Rebuilt(Shown):
    """A shell that was made in memory from what a job burnt.

    Attributes
    ----------
    corners, measured : int
        The vertices of the shell, and those of them that the burnt lines fix.
    worst_mm : float
        The largest distance of a measured vertex from its place in the folded form.
    target_mm : float or None
        The largest distance of the mean of a whole facet of the shell from the target; None
        without a target.
    folded_target_mm : float or None
        The same for the folded form.
    thickness_mm : float
        The thickness of the material.
    seconds : float
        The time that it took.
    """

    corners: int
    measured: int
    worst_mm: float
    target_mm: float | None
    folded_target_mm: float | None
    thickness_mm: float
    seconds: float

    @property
    def valid(self) -> bool:
        """Whether no corner lies farther from its place than the material is thick."""
        return self.worst_mm <= self.thickness_mm

    def report(self) -> dict[str, Any]:
        """The part of the JSON answer of ``check`` about it."""
        return {"valid": self.valid, **self._facts()}

    def _summary(self) -> str:
        return f"{self.measured} of {self.corners} corners, within {self.worst_mm:.3g} mm"

    def _facts(self) -> Mapping[str, object]:
        return vars(self)


@verb
def rebuild(directory: AnyPath) -> Rebuilt:
    """Run a job in memory, and fold and glue what was burnt.

    Parameters
    ----------
    directory : str or os.PathLike
        The job directory, for a laser.

    Returns
    -------
    Rebuilt
        With ``worst_mm``, the largest distance from the folded form.

    Raises
    ------
    InputError
        For a directory without a job, and for a job of another tool.
    PatternError
        For a pattern without a folded form.

    Examples
    --------
    >>> import miurafab as mf
    >>> job = mf.sheets(mf.fit("hypar", facets=(4, 4), size=60)).write("jobs/again")
    >>> mf.rebuild("jobs/again").worst_mm < 0.05
    True
    """
    started = time.perf_counter()
    folder = as_path(directory, "The job directory")
    written, manifest = read_written(folder), read_manifest(folder)
    machine, layout = written.machine, written.layout
    if machine.tool.kind != "laser":
        raise InputError(f"{folder} is for a {machine.tool.kind}; only a laser's job is rebuilt.")
    pattern = read_fold(folder / pattern_name(folder, manifest))
    if pattern.folded_coords is None:
        raise PatternError(f"{folder}: the pattern has no folded form to compare with.")
    material = job_material(layout.material, folder)
    outlined, _, motion = patches_on_sheets(layout, pattern)
    names = (name for name, _ in written.passes)
    burnt = {name: _burnt(job, machine) for name, job in zip(names, written.jobs, strict=True)}
    sheets = []
    for sheet in layout.sheets:
        parts = [burnt[sheet.name]]
        if sheet.back is not None:  # it lies turned over about its vertical axis
            over = np.array([sheet.width_mm, 0.0, sheet.width_mm, 0.0])
            parts.append(over + burnt[sheet.back] * [-1, 1, -1, 1])
        sheets.append(np.concatenate(parts))
    corners = recovered_corners(pattern, outlined, motion, material.kerf_mm, sheets)
    shell = glued_shell(pattern, outlined.face_patch, corners)
    known = np.zeros(len(shell), dtype=bool)
    known[corners.vertex[corners.fixed]] = True
    known &= np.isfinite(shell).all(axis=1)
    if known.sum() < 3:
        raise InputError(f"{folder}: what was burnt does not fix the corners of the pattern.")
    turn, shift = laid_on(shell[known], pattern.folded_coords[known])
    shell = shell @ turn.T + shift
    away = np.linalg.norm(shell - pattern.folded_coords, axis=1)[known]
    made, meant = (_off_target(points, pattern) for points in (shell, pattern.folded_coords))
    used = np.unique(pattern.faces_vertices[pattern.faces_vertices >= 0])
    seconds = time.perf_counter() - started
    found, worst = int(known.sum()), float(away.max())
    return Rebuilt(len(used), found, worst, made, meant, material.thickness_mm, seconds)


def _off_target(points: Floats, pattern: CreasePattern) -> float | None:
    """The largest distance of the mean of a whole facet at ``points`` (V, 3) from the target, mm;
    where the border has cut one, its mean says nothing.
    """
    surface, _ = described_surface(pattern.target)
    if surface is None:
        return None
    means = facet_means(points / pattern.scale, pattern.faces_vertices[uncut(pattern)])
    means = means[np.isfinite(means).all(axis=1)]
    off = np.linalg.norm(surface.nearest(means) - means, axis=1)
    return pattern.scale * float(off.max())


def _burnt(job: Job, machine: MachineProfile) -> Floats:
    """(n, 4) the segments that the controller in memory burns for ``job``."""
    transport = VirtualTransport(virtual_machine(machine))
    with StopSignals() as signals:
        deliver(plan_job(job, machine), transport, signals)
    if signals.caught is not None:  # by nobody else, as the last word of the job was said
        raise JobStopped(f"{job.name} was stopped by {signals.reason}.")
    log = transport.device.beam_log
    return np.array([[s.x0, s.y0, s.x1, s.y1] for s in log if not s.standing]).reshape(-1, 4)
