"""The proof of a job: its files are those of the manifest, and each stroke is one of the pattern.

Three things are recomputed. The sums: each file of the manifest is there, unchanged, and no other
program is. The pattern: every invariant, as for a pattern file. The strokes: from the pattern, the
patches, tabs and places of ``layout.json`` and the rules of the material, each stroke follows
(:mod:`~miurafab.fabrication.retrace`). Each program is read as the machine reads it. Each burnt
segment must be a segment of such a stroke, made by the operation of its kind, within
:data:`NEAR_MM`, and each of these must be burnt exactly once in each pass, at the height of that
pass.

What is not proven is a finding of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy.spatial import KDTree

from miurafab.display import Shown
from miurafab.errors import InputError, LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.retrace import retraced
from miurafab.fabrication.route.order import HOLE, StrokeSet
from miurafab.fabrication.strokes import SLIT
from miurafab.files import AnyPath, as_path
from miurafab.findings import Finding, findings_json, refusals
from miurafab.gcode.program import Program
from miurafab.gcode.reading import read_program
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.machine.judge_job import judge_program
from miurafab.options import read_options
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.fold import read_fold
from miurafab.profiles import OPERATIONS, MachineProfile, Material
from miurafab.profiles.shipped import Kind, shipped_directory
from miurafab.workflow.job_directory import WrittenJob, read_written
from miurafab.workflow.job_files import LAYOUT, job_material, settle_job
from miurafab.workflow.manifest import MANIFEST, TOOL, Manifest, read_manifest, sha256
from miurafab.workflow.patterns import check

NEAR_MM = 0.002
"""G-code is rounded to 0.001 mm, and relative moves add up to as much again."""
HPGL_MM = 0.03
"""Plotters count in steps of 0.025 mm."""
SHORTEST_MM = 0.002
"""A shorter segment may vanish in the rounding of a program."""

_PROGRAMS = (".nc", ".plt", ".hpgl", ".gcode")
_KINDS = ("crease", "tab fold", "outline", "hole", "slit", "label")
_NAMED = 5
"""So many faults of one kind are named on a sheet; the others are counted."""


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
    if not refusals(findings) or all((folder / name).is_file() for name in manifest.files):
        job = read_written(folder)
        programs = [read_program(each, job.machine) for each in job.jobs]
        findings += job.layout.findings
        for each, program in zip(job.jobs, programs, strict=True):
            findings += judge_program(each, program, job.machine, most_power=job.most_power)
        findings += _traced(job, programs, manifest, traced)
    return JobCheck(folder, len(manifest.files), traced, tuple(findings))


def _sums(folder: Path, manifest: Manifest) -> Iterator[Finding]:
    """The files that are not those of the manifest."""
    for name, digest in manifest.files.items():
        file = folder / name
        if not file.is_file():
            yield Finding("job-file", f"{name} is missing.", name)
        elif sha256(file) != digest:
            yield Finding("job-file", f"{name} has changed since the job was made.", name)
    programs = {path.name for path in folder.iterdir() if path.suffix.lower() in _PROGRAMS}
    for name in sorted(programs - set(manifest.files)):
        yield Finding("job-file", f"{name} is a program that the job does not know.", name)
    for name, digest in manifest.profiles.items():
        kind, _, file_name = name.partition("/")
        own = folder / file_name
        # A shipped profile stays in the package.
        file = own if own.is_file() else shipped_directory(_kind(kind)) / file_name
        if sha256(file) != digest:
            yield Finding("job-file", f"{name} has changed since the job was made.", name)
    if manifest.tool != TOOL:
        sentence = f"The job was made by {manifest.tool} and is checked by {TOOL}."
        yield Finding("job-version", sentence, MANIFEST)


def _kind(text: str) -> Kind:
    kinds: tuple[Kind, ...] = get_args(Kind)
    for kind in kinds:
        if kind == text:
            return kind
    raise InputError(f"The manifest names profiles of the kind '{text}', which there is not.")


def _traced(
    job: WrittenJob, programs: list[Program], manifest: Manifest, traced: Counter[str]
) -> Iterator[Finding]:
    """What is wrong with the pattern and the strokes; ``traced`` counts those that are right."""
    folder, layout, machine = job.directory, job.layout, job.machine
    if not layout.patches:
        says = "The strokes of a calibration sheet are not traced: no pattern stands behind them."
        yield Finding("not-proven", says)
        return
    patterns = [name for name in manifest.files if name.endswith(".fold")]
    if len(patterns) != 1:
        raise InputError(f"{folder / MANIFEST} names {len(patterns)} patterns; a job has one.")
    pattern = read_fold(folder / patterns[0])
    yield from check(pattern).findings
    material = job_material(layout.material, folder)
    options = read_options(LayoutOptions, manifest.options, where=MANIFEST, folder=folder)
    try:
        passes, faults = retraced(layout, pattern, machine, material, options)
    except LayoutError as fault:
        yield Finding("layout", str(fault), LAYOUT)
        return
    for sentence in faults:
        yield Finding("layout", sentence, LAYOUT)
    if machine.tool.knife is not None:
        says = "The strokes of a drag knife are not traced: its holder leads the tip on other ways."
        yield Finding("not-proven", says)
        return
    tab_edges = np.array([t.edge for p in layout.patches for t in p.tabs], dtype=np.int64)
    for strokes, program in zip(passes, programs, strict=True):
        kinds = _kinds(strokes, pattern, tab_edges)
        yield from _compared(strokes, kinds, program, machine, material, traced)


@dataclass(frozen=True, eq=False)
class _Segments:
    """N segments: ``ends`` (N, 4) in mm, the ``operation`` (N,), -1 where it is not said, and the
    ``stroke`` (N,) or move that each is of. Those that are ``sure`` (N,) are not lost in rounding.
    """

    ends: Floats
    operation: Ints
    stroke: Ints

    @property
    def sure(self) -> Bools:
        lengths = np.linalg.norm(self.ends[:, 2:] - self.ends[:, :2], axis=1)
        return np.asarray(lengths > SHORTEST_MM)


def _compared(
    strokes: StrokeSet,
    kinds: Ints,
    program: Program,
    machine: MachineProfile,
    material: Material,
    traced: Counter[str],
) -> Iterator[Finding]:
    """The strokes of one program that are not those of the pattern."""
    path = strokes.toolpath
    wanted, burnt = _wanted(strokes), _burnt(program)
    near = HPGL_MM if machine.dialect == "hpgl" else NEAR_MM
    count = len(wanted.ends)
    # A segment may be burnt either way.
    both = np.concatenate([wanted.ends, wanted.ends[:, [2, 3, 0, 1]]])
    away, found = KDTree(both).query(burnt.ends)
    found = np.asarray(found) % count
    right = away <= near * 2
    right &= (burnt.operation < 0) | (burnt.operation == wanted.operation[found])
    heights, due = _heights(material)
    off = np.abs(heights[wanted.operation[found]] - program.end[burnt.stroke, 2][:, None])
    level = off.argmin(axis=1)
    right &= off.min(axis=1) <= near
    stray = ~right & burnt.sure
    for at in np.flatnonzero(stray)[:_NAMED].tolist():
        line = int(program.line[burnt.stroke[at]])
        x, y = burnt.ends[at, :2].tolist()
        yield Finding(
            "stroke",
            f"{path.sheet}: line {line} burns a stroke from X{x:.3f} Y{y:.3f} that is not of the "
            "pattern, or out of its place.",
            path.sheet,
        )
    if stray.sum() > _NAMED:
        yield Finding("stroke", f"{path.sheet}: so do {stray.sum() - _NAMED} more segments.")
    cells = found[right] * due.shape[1] + level[right]
    times = np.bincount(cells, minlength=count * due.shape[1]).reshape(count, -1)
    due = due[wanted.operation]
    less, more = (times < due).any(axis=1), (times > due).any(axis=1)
    for wrong, words in ((less, "is not burnt"), (more, "is burnt too often")):
        faulty = np.unique(wanted.stroke[wrong & wanted.sure])
        for stroke in faulty[:_NAMED].tolist():
            x, y = path.starts[stroke].tolist()
            edge = f" on edge {path.edge[stroke]}" if path.edge[stroke] >= 0 else ""
            yield Finding(
                "stroke",
                f"{path.sheet}: the {_KINDS[kinds[stroke]]}{edge} from X{x:.3f} Y{y:.3f} {words}.",
                path.sheet,
            )
        if len(faulty) > _NAMED:
            yield Finding("stroke", f"{path.sheet}: so of {len(faulty) - _NAMED} more strokes.")
    good = np.ones(len(path), dtype=bool)
    good[wanted.stroke[(less | more) & wanted.sure]] = False
    traced.update(_KINDS[kind] for kind in kinds[good].tolist())


def _heights(material: Material) -> tuple[Floats, Ints]:
    """(operations, h) the heights of the head in each operation, filled up with infinity, and how
    often each stroke is due at each.
    """
    found = [
        np.unique(material.operations[name].heights_mm, return_counts=True) for name in OPERATIONS
    ]
    most = max(len(heights) for heights, _ in found)
    heights, due = np.full((len(found), most), np.inf), np.zeros((len(found), most), np.int64)
    for row, (levels, counts) in enumerate(found):
        heights[row, : len(levels)], due[row, : len(levels)] = levels, counts
    return heights, due


def _wanted(strokes: StrokeSet) -> _Segments:
    path = strokes.toolpath
    stroke = np.repeat(np.arange(len(path)), np.diff(path.offsets))
    inner = stroke[1:] == stroke[:-1]
    ends = np.concatenate([path.points[:-1], path.points[1:]], axis=1)[inner]
    stroke = stroke[1:][inner]
    return _Segments(ends, path.operation[stroke], stroke)


def _burnt(program: Program) -> _Segments:
    burns = np.flatnonzero(program.beam_on)
    ends = np.concatenate([program.start[burns, :2], program.end[burns, :2]], axis=1)
    of_context = np.array(
        [
            OPERATIONS.index(c.operation) if c.operation in OPERATIONS else -1
            for c in program.contexts
        ]
    )
    return _Segments(ends, of_context[program.context[burns]], burns)


def _kinds(strokes: StrokeSet, pattern: CreasePattern, tab_edges: Ints) -> Ints:
    """(S,) the kind of each stroke, an index of :data:`_KINDS`."""
    path = strokes.toolpath
    cut = path.operation == OPERATIONS.index("cut")
    crease, tab_fold, outline, hole, slit, label = range(len(_KINDS))
    return np.select(
        [
            path.operation == OPERATIONS.index("engrave"),
            cut & (strokes.rank == HOLE),
            path.edge < 0,
            np.isin(path.edge, tab_edges),
            np.isin(pattern.edges_assignment[path.edge], SLIT),
        ],
        [label, hole, outline, tab_fold, slit],
        crease,
    )
