"""Findings: what a person should know about a target, a sheet, a layout or a job.

Every room that judges answers with findings. A finding never changes the value that it is about: a
command shows it, the JSON answer holds it, and a refusal stops the work unless its code is forced.
:data:`RULES` lists every code once, with its severity, so that a judgement weighs the same wherever
it is made.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from miurafab.errors import spell_options

Severity = Literal["note", "warning", "refusal"]


@dataclass(frozen=True, slots=True)
class Rule:
    """What one code stands for.

    ``note``: for information. ``warning``: probably a mistake, but the work goes on. ``refusal``:
    the work stops, unless the code is ``forceable`` and the user forces it.
    """

    severity: Severity
    meaning: str
    forceable: bool = False


def _check(meaning: str) -> Rule:
    return Rule("refusal", meaning, forceable=True)


RULES = {
    # A target
    "mesh-unit": Rule("warning", "a mesh whose size suggests a unit that is not the millimetre"),
    "filled-holes": Rule("note", "holes of a mesh that were filled or kept"),
    "welded": Rule("note", "borders of a mesh that were joined over small gaps"),
    "pieces-left-out": Rule("warning", "separate pieces of a mesh that are left out"),
    "plate": Rule("note", "a thin plate whose skin or middle is the target"),
    "sampling": Rule("warning", "a function that turns faster than its samples show"),
    "smoothed": Rule("note", "a height map or a body that was smoothed"),
    "polar-holes": Rule("note", "holes that the sheet leaves at the poles of a closed body"),
    # A fit (miurafab.origami.fitting)
    "interrupted": Rule("refusal", "a fit that was interrupted; the sheet is the best so far"),
    "timeout": Rule("note", "the `timeout` ended the search with the best sheet up to then"),
    "no-sheet": Rule("refusal", "no exact sheet was found"),
    "no-sheet-in-limits": Rule("refusal", "no sheet meets all limits at any number of facets"),
    "residual": Rule("refusal", "facets that are not exactly planar, developable or isometric"),
    "min-edge": Rule("refusal", "an edge shorter than `min_edge`"),
    "max-deviation": Rule("refusal", "a sheet whose middle is farther away than `max_deviation`"),
    "max-distance": Rule("refusal", "sheet and target farther apart than `max_distance`"),
    "facet-shape": Rule("refusal", "facets that break a limit on angles or proportions"),
    "flat-foldable": Rule("refusal", "a sheet less flat-foldable than asked"),
    "barrier": Rule("refusal", "a sheet that cannot have the barrier asked for"),
    "smaller-part": Rule("warning", "a sheet on a smaller part of the mesh's rectangle"),
    "more-facets": Rule("note", "more facets than were asked for, since the pieces need them"),
    "whole-facets": Rule("note", "whole facets at the border, since a cut leaves short edges"),
    "far-from-target": Rule("warning", "a sheet that lies over 1 % of its size from the target"),
    # A pattern, read from a file (miurafab.origami.formats)
    "curved-lines": Rule("note", "curved lines of a drawing, which are straight lines here"),
    "joined-ends": Rule("note", "a drawing whose lines were joined over gaps"),
    "lost-lines": Rule("warning", "lines of a drawing that are not in the pattern"),
    "loose-parts": Rule("note", "parts of a drawing, or ends of cuts, in the middle of a facet"),
    "holes": Rule("note", "parts of a drawing without paper, bounded by borders alone"),
    "unfolded": Rule("note", "a flat pattern that is computed from the folded form of its file"),
    "rounded": Rule("note", "a file of few digits, whose two forms differ by their rounding"),
    "resized": Rule("note", "a folded form that is taken at the size of the flat pattern"),
    "folded-form": Rule("warning", "a folded form that is not of the flat pattern, left out"),
    "opened": Rule("note", "a sheet that is opened along cuts, or along seams where it closes"),
    # A pattern, checked (miurafab.origami.verify)
    "no-target": Rule("note", "distances left out, since the target is missing or has changed"),
    "degenerate-edge": Rule("refusal", "an edge too short to be creased or cut"),
    "overlap": Rule("refusal", "facets that overlap in the flat pattern"),
    "seam": Rule(
        "refusal",
        "a seam whose two edges differ in length or do not meet when folded, or that is not named",
    ),
    "planarity": Rule("refusal", "a facet that is not flat in the folded form"),
    "developability": Rule(
        "refusal", "an interior vertex whose angles do not add up to 360 degrees"
    ),
    "isometry": Rule("refusal", "a facet whose edges differ between flat and folded form"),
    "double-edge": Rule("refusal", "an edge that is there twice"),
    "assignment": Rule("refusal", "a letter that contradicts the facets or the fold of its edge"),
    "fold-angle": Rule("refusal", "a fold angle that is not that of the folded form"),
    "facets": Rule("refusal", "a facet that is missing, or is not in its place in the grid"),
    "turned-over": Rule("refusal", "a facet that lies turned over in the flat pattern"),
    "scale": Rule("refusal", "a target or its scale that is not that of the fit"),
    "closure": Rule("refusal", "a vertex that the given fold angles do not close"),
    "flat-folding": Rule(
        "refusal", "a vertex that cannot fold flat, where all folds are 180 degrees"
    ),
    "not-flat-foldable": Rule(
        "note", "a vertex that cannot fold flat, where nothing asks for that"
    ),
    "self-intersection": Rule("refusal", "facets that meet in the folded form"),
    "bow-tie": Rule("refusal", "a facet whose own sides cross"),
    "dented": Rule("warning", "a quad facet that is not convex"),
    "both-sides": Rule("warning", "a facet that lies on both sides of an edge, and is no polygon"),
    "touches-itself": Rule(
        "warning", "a facet whose border meets itself, or without area, which is no polygon"
    ),
    "steep-folds": Rule("warning", "creases that fold by more than 165 degrees"),
    "much-paper": Rule("warning", "a sheet of more than four times the area of the target"),
    "coverage": Rule("warning", "a sheet that covers less than 95 % of the target"),
    "overhang": Rule("note", "a sheet of which more than 1 % is beyond the target"),
    "frame": Rule(
        "refusal", "a further frame of a file that is no state of the sheet, or orders it wrongly"
    ),
    # A pattern, converted (miurafab.workflow.convert)
    "no-creases": Rule("note", "a format that holds a shape and no creases"),
    "no-folded-form": Rule("note", "a format that does not hold the folded form"),
    "no-fold-angles": Rule("note", "a format that tells mountains from valleys and no fold angles"),
    "free-creases": Rule("note", "a format that does not tell free creases from flat ones"),
    "no-seams": Rule("note", "a format that does not hold which edges meet along seams"),
    "assumed-folded-flat": Rule("note", "a file without fold angles, taken as folded flat"),
    # A pattern, folded (miurafab.origami.folding.judge_motion, miurafab.workflow.layers)
    "bent-facets": Rule("note", "a pattern that does not fold rigidly"),
    "contacts": Rule("warning", "facets that pass through each other on the way"),
    "crossing-layers": Rule(
        "warning", "facets that pass through each other as the sheet closes flat"
    ),
    "undecided-layers": Rule(
        "warning", "facets folded flat whose order the closed form leaves open"
    ),
    "no-layer-order": Rule(
        "note", "a sheet that does not reach the flat-folded end, so that it has no layer order"
    ),
    "cannot-fold-flat": Rule("refusal", "mountains and valleys that no order of layers satisfies"),
    "rough-layers": Rule("note", "layers of a drawing whose rounded facets miss each other"),
    "more-layer-orders": Rule("note", "a search that ended before all layer orders were found"),
    "followed-once": Rule("note", "a sheet too large for a second way where the first is poor"),
    "way-lost": Rule("warning", "a motion that ends before its creases are where they shall be"),
    "wrong-signs": Rule("warning", "creases that end on the other side than their letter tells"),
    "stretched": Rule("note", "a motion that paper can follow only by stretching"),
    "unstable": Rule("warning", "frames of a motion from which the sheet would snap away"),
    "held-back": Rule("note", "creases that stay far from the fold angles asked for"),
    # A layout (miurafab.fabrication.layout_findings)
    "weak-tabs": Rule("warning", "tabs with less glue than the material's `min_area`"),
    "fold-letters": Rule("note", "tabs without room for the letter of their fold"),
    "relief-holes": Rule("warning", "vertices whose creases are too short for a relief hole"),
    "ticks": Rule("note", "ends of folds without room for their ticks"),
    "bridges": Rule("warning", "outlines without room for all holding bridges"),
    "nesting-limit": Rule("note", "a nesting that ended before every order was tried"),
    "unassigned-creases": Rule("warning", "creases that are neither mountain nor valley"),
    "untabbed": Rule(
        "warning", "edges of seams, or of open borders with tabs, without room for one"
    ),
    "small-facets": Rule("warning", "facets too narrow for the thickness of the sheet, or to hold"),
    "sharp-corners": Rule("warning", "corners whose two rows of dashes run into each other"),
    "single-dash": Rule("warning", "creases of one dash alone, beside which they may fold"),
    "stiff-creases": Rule("warning", "creases of which less is burnt than half the usual share"),
    "thin-bridges": Rule("warning", "bridges narrower than the kerf or the thickness"),
    "scaled": Rule("warning", "settings of a material on a laser that they were not meant for"),
    "other-forces": Rule("warning", "forces of a material that were found on another machine"),
    "unlettered": Rule("warning", "names and labels without room on the sheets"),
    "rim-numbers": Rule("note", "numbers of rows without room on the waste"),
    # A job, judged without a machine (miurafab.machine.judge_job)
    "lines": Rule("refusal", "a line too long for the controller, or not printable ASCII"),
    "program": _check(
        "a line that the controller would answer with an error, or whose effect cannot be told"
    ),
    "m3": _check("`M3`, or `M4` without laser mode (Marlin: `I`): the beam stays on at rest"),
    "bounds": _check("a move off the bed"),
    "islands": _check("a stroke inside an outline that is cut through already"),
    "outlines": _check("an outline whose end misses its beginning by a little"),
    "dwell": _check("a dwell (`G4`), or without laser mode a pause (`M0`), with the beam on"),
    "power": _check("an S word above the machine's full power"),
    "material": _check("an S word above the `max_power` of the material"),
    "other-beam": _check("a job made for another kind of beam, or for another full power"),
    "laser-mode": _check("laser mode (`$32`; Marlin: `M4 I`) that does not suit the tool"),
    "rate": Rule("warning", "a feed above the machine's largest rate"),
    "loose": Rule("warning", "a stroke inside a closed stroke that may have cut its piece loose"),
    "armed": Rule("warning", "a job that ends with the laser armed"),
    "air": Rule("note", "a job that ends with the air on"),
    "characters": Rule("warning", "a character in a comment that other senders pass on"),
    "nothing-burnt": Rule("warning", "a job that burns nothing"),
    "outputs": Rule("warning", "an output that is switched (`M62` to `M65`)"),
    "pauses": Rule("note", "a program that waits for a person (`M0`)"),
    "relative": Rule("note", "relative moves (`G91`)"),
    # A job directory, checked (miurafab.workflow.check_job)
    "job-version": Rule("note", "a job that another version of miurafab made"),
    "layout": Rule("refusal", "a layout whose patches or tabs are not those of the pattern"),
    "stroke": Rule("refusal", "a stroke that is not of the pattern, missing, or made too often"),
    "not-proven": Rule("note", "what `check` could not prove"),
    # A job that is previewed (miurafab.workflow.preview)
    "assumed-machine": Rule("note", "no machine is named, so a common machine is assumed"),
    "edited": _check("a file of a job that was removed, added, or changed since"),
    "pattern-changed": Rule("warning", "the pattern of the job has changed since"),
    "pattern-missing": Rule("note", "the pattern of the job is not there"),
    # The controller, before a line of the job is sent (miurafab.machine.preflight)
    "idle": _check("a controller that is not idle"),
    "beam": _check("a beam that is on already"),
    "s-range": _check("an S range (`$30`, `$31`) that is not the profile's"),
    "settings": _check("another `$` setting that is not the profile's"),
    "position": _check("a controller that restarted by itself, so that its position may be lost"),
    "restarted": Rule("note", "a board that the opening of its port reset, and what that undid"),
    "modes": Rule(
        "warning", "modes or startup blocks of the controller that a job does not expect"
    ),
    "travel": _check("a move beyond the soft limits, from where the machine stands"),
    # A job that was sent (miurafab.machine.sender)
    "no-emergency-parser": Rule("warning", "a Marlin that obeys a stop only between two commands"),
    "overrides": Rule("note", "a feed, a rapid rate or a power that a key changed while a job ran"),
    "records": Rule("warning", "a journal or a transcript that could not be finished"),
    "no-answer": Rule("note", "a cutter that answers nothing"),
    "from-stroke": Rule("note", "a job that begins at a stroke of your choice"),
    "head": Rule("note", "where the head stands in the job, and how far it moves from there"),
    "aligned": Rule("note", "a job that was turned and shifted to where its sheet lies"),
    "resumed": Rule("note", "where an interrupted job goes on, and what may be burnt twice"),
}
"""Every code, in the order of the work."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One judgement.

    Parameters
    ----------
    code : str
        The name of the judgement, a key of :data:`RULES`. It stays the same from version to
        version; ``force`` takes it.
    sentence : str
        The whole judgement as one sentence, with the numbers and the way out. The names of options
        stand in backticks (:func:`miurafab.errors.spell_options`).
    where : str or tuple of int
        The place: a file and line (``edge.nc:5``), a sheet, or the indices of facets, vertices or
        edges. Empty where the sentence is about the whole.

    Examples
    --------
    >>> finding = Finding("bounds", "edge.nc, line 5 leaves the bed.", "edge.nc:5")
    >>> finding.severity
    'refusal'
    """

    code: str
    sentence: str
    where: str | tuple[int, ...] = ""

    @property
    def severity(self) -> Severity:
        """How much the judgement weighs: ``note``, ``warning`` or ``refusal``."""
        return RULES[self.code].severity

    def as_json(self) -> dict[str, Any]:
        """The fields in the order that reports print them."""
        return {
            "code": self.code,
            "severity": self.severity,
            "where": list(self.where) if isinstance(self.where, tuple) else self.where,
            "sentence": self.sentence,
        }

    def __str__(self) -> str:
        """The sentence, with the names of options in quotes."""
        return spell_options(self.sentence, lambda name: f"'{name}'")


def finding_from_json(values: Mapping[str, Any]) -> Finding:
    """The finding that :meth:`Finding.as_json` wrote; ``KeyError`` for an unknown code."""
    where = values["where"]
    place = tuple(int(index) for index in where) if isinstance(where, list) else str(where)
    found = Finding(str(values["code"]), str(values["sentence"]), place)
    RULES[found.code]  # an unknown code has no severity
    return found


def counted(count: int, one: str, several: str) -> str:
    """``count`` before the words for ``one`` thing or for ``several``."""
    return f"{count} {one if count == 1 else several}"


def refusals(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """The findings that stop the work."""
    return tuple(finding for finding in findings if finding.severity == "refusal")


def findings_json(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """``findings`` as every report holds them under ``findings``."""
    return [finding.as_json() for finding in findings]
