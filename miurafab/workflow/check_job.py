"""The proof of a job: its files are those of the manifest, and each stroke is one of the pattern.

Three things are recomputed. The sums: each file of the manifest is there, unchanged, and no other
program is. The pattern: every invariant, as for a pattern file. The strokes: from the pattern, the
patches, tabs and places of ``layout.json`` and the rules of the material, each stroke follows
(:mod:`~miurafab.fabrication.retrace`). Each program is read as the machine reads it and
compared with them (:mod:`~miurafab.workflow.trace`).

What is not proven is a finding of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.display import Shown
from miurafab.errors import InputError, LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.retrace import retraced
from miurafab.files import AnyPath, Reading, as_path
from miurafab.findings import Finding, findings_json, refusals
from miurafab.gcode.program import Program
from miurafab.gcode.reading import read_program
from miurafab.machine.judge_job import judge_program
from miurafab.options import read_options
from miurafab.options.verbs import verb
from miurafab.origami.formats.fold import read_fold
from miurafab.workflow.job_directory import WrittenJob, read_written
from miurafab.workflow.job_files import job_material, settle_job
from miurafab.workflow.manifest import (
    LAYOUT,
    MANIFEST,
    TOOL,
    Manifest,
    all_edits,
    pattern_name,
    read_manifest,
)
from miurafab.workflow.patterns import check
from miurafab.workflow.trace import traced_strokes

_PROGRAMS = (".nc", ".plt", ".hpgl", ".gcode")


@dataclass(frozen=True, repr=False)
class JobCheck(Shown):
    """What a check of a job directory found.

    Attributes
    ----------
    path : Path
        The job directory.
    files : int
        The files of the manifest.
    traced : mapping
        How many strokes of each kind were traced back to the pattern, over all sheets.
    findings : tuple of Finding
        What is wrong, and what is not proven.
    """

    path: Path
    files: int
    traced: Mapping[str, int]
    findings: tuple[Finding, ...]

    @property
    def valid(self) -> bool:
        """Whether nothing is wrong."""
        return not refusals(self.findings)

    def report(self) -> dict[str, Any]:
        """The JSON answer of ``check``."""
        return {
            "status": "valid" if self.valid else "invalid",
            "job": str(self.path),
            "files": self.files,
            "traced": dict(self.traced),
            "findings": findings_json(self.findings),
        }

    def _summary(self) -> str:
        strokes = sum(self.traced.values())
        verdict = "valid" if self.valid else "invalid"
        return f"{verdict}: {self.files} files, {strokes:,} strokes traced"


@verb
def check_job(directory: AnyPath) -> JobCheck:
    """Check a job directory: its files against its manifest, its strokes against its pattern.

    Parameters
    ----------
    directory : str or os.PathLike
        The job directory.

    Returns
    -------
    JobCheck
        ``valid``, the strokes ``traced`` by kind, and ``findings``.

    Raises
    ------
    InputError
        For a directory without a job, and for a job without a manifest.

    Examples
    --------
    >>> import miurafab as mf
    >>> job = mf.sheets(mf.fit("hypar", facets=(4, 4), size=60)).write("jobs/checked")
    >>> mf.check_job("jobs/checked").valid
    True
    """
    folder = as_path(directory, "The job directory")
    settle_job(folder)
    if not (folder / LAYOUT).is_file():
        raise InputError(
            f"{folder} holds no whole job ({LAYOUT} is missing); make it with 'miurafab sheets'."
        )
    manifest = read_manifest(folder)
    findings = [*_sums(folder, manifest)]
    traced: Counter[str] = Counter()
    if all((folder / name).is_file() for name in manifest.files):
        job = read_written(folder)
        programs = [read_program(each, job.machine) for each in job.jobs]
        findings += job.layout.findings
        for each, program in zip(job.jobs, programs, strict=True):
            findings += judge_program(each, program, job.machine, most_power=job.most_power)
        with Reading(folder / LAYOUT, "a layout of this pattern", LayoutError):
            findings += _traced(job, programs, manifest, traced)
    return JobCheck(folder, len(manifest.files), traced, tuple(findings))


def _sums(folder: Path, manifest: Manifest) -> Iterator[Finding]:
    """The files that are not those of the manifest."""
    programs = (path.name for path in folder.iterdir() if path.suffix.lower() in _PROGRAMS)
    yield from all_edits(folder, manifest, programs)
    if manifest.tool != TOOL:
        sentence = f"The job was made by {manifest.tool} and is checked by {TOOL}."
        yield Finding("job-version", sentence, MANIFEST)


def _traced(
    job: WrittenJob, programs: list[Program], manifest: Manifest, traced: Counter[str]
) -> Iterator[Finding]:
    """What is wrong with the pattern and the strokes; ``traced`` counts those that are right."""
    folder, layout, machine = job.directory, job.layout, job.machine
    if not layout.patches:
        says = "The strokes of a calibration sheet are not traced: no pattern stands behind them."
        yield Finding("not-proven", says)
        return
    pattern = read_fold(folder / pattern_name(folder, manifest))
    yield from check(pattern).findings
    material = job_material(layout.material, folder)
    options = read_options(LayoutOptions, manifest.options, where=MANIFEST)
    try:
        passes, faults = retraced(layout, pattern, machine, material, options)
    except LayoutError as fault:
        yield Finding("layout", str(fault), LAYOUT)
        return
    for sentence in faults:
        yield Finding("layout", sentence, LAYOUT)
    tab_edges = np.array([tab.edge for patch in layout.patches for tab in patch.tabs])
    for strokes, program in zip(passes, programs, strict=True):
        yield from traced_strokes(strokes, pattern, tab_edges, program, machine, material, traced)
