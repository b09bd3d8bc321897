"""From one program's pattern file to another's, and what is lost on the way.

The formats are those of :mod:`miurafab.origami.formats.files`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.display import Shown
from miurafab.files import AnyPath, as_path, new_file
from miurafab.findings import Finding, findings_json
from miurafab.options import declared, read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import ASSIGNMENTS, CreasePattern
from miurafab.origami.formats.files import (
    SOLIDS,
    WITHOUT_ANGLES,
    WRITTEN,
    ReadingOptions,
    load,
    write_pattern,
)
from miurafab.workflow.patterns import require_consistent, wishes_of
from miurafab.workflow.scaling import ScaleOptions, scaled


@dataclass(frozen=True, eq=False, repr=False)
class Conversion(Shown):
    """A pattern that was read from one file and written to another.

    Attributes
    ----------
    source, target : pathlib.Path
        The file that was read and the file that was written.
    pattern : CreasePattern
        The pattern.
    findings : tuple of Finding
        What was changed or left out in reading, and what the format could not hold.
    """

    source: Path
    target: Path
    pattern: CreasePattern
    findings: tuple[Finding, ...]

    def _summary(self) -> str:
        return f"{self.source} to {self.target}: {len(self.pattern.faces_vertices)} facets"

    def report(self) -> dict[str, Any]:
        """The JSON answer of ``convert``."""
        letters = self.pattern.edges_assignment
        return {
            "file": str(self.target),
            "facets": len(self.pattern.faces_vertices),
            "pieces": self.pattern.pieces_count,
            "vertices": len(self.pattern.vertices_coords),
            "edges": {
                letter: int((letters == letter).sum())
                for letter in ASSIGNMENTS
                if (letters == letter).any()
            },
            "folded_form": self.pattern.folded_coords is not None,
            "findings": findings_json(self.findings),
        }


@verb
def convert(
    source: AnyPath,
    target: AnyPath,
    *,
    folded: AnyPath | None = None,
    form: str | None = None,
    **options: Any,
) -> Conversion:
    """Read the pattern in ``source`` and write it to ``target``, in the formats of their endings.

    Parameters
    ----------
    source : str or os.PathLike
        What :func:`load` reads.
    target : str or os.PathLike
        A ``.fold``, ``.svg``, ``.dxf``, ``.cp``, ``.opx``, ``.obj``, ``.stl`` or ``.glb`` file.
    folded : str or os.PathLike, optional
        The OBJ file with the folded form of an OBJ ``source``.
    form : {"folded", "flat"}, optional
        The form to write to an ``.obj``, ``.stl`` or ``.glb``. The default is folded where the
        pattern has a folded form.
    {options}

    Returns
    -------
    Conversion
        With ``findings`` on what was changed or left out in reading, and what the format could not
        hold.

    Raises
    ------
    InputError
        For endings and options that do not go together.
    PatternError
        For a file that cannot be read.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.fit("plane", facets=(4, 4)).pattern.save("plane.fold")
    >>> mf.convert("plane.fold", "plane.dxf")
    <Conversion plane.fold to plane.dxf: 16 facets>
    """
    source = as_path(source, "The pattern file")
    target = new_file(target, "The file to write", WRITTEN)
    reading = {name: options.pop(name) for name in declared(ReadingOptions) if name in options}
    sizes = read_options(ScaleOptions, options)
    pattern = load(source, folded=folded, **reading)
    require_consistent(pattern, str(source), wishes_of(pattern))
    pattern = scaled(pattern, sizes)
    findings = list(pattern.told)
    findings += [] if source.suffix.lower() == ".fold" else _assumed(source, pattern)
    write_pattern(pattern, target, title=source.stem, form=form)
    ending = target.suffix.lower()
    if ending in SOLIDS:
        findings.append(_loss("no-creases", target, "holds a shape and no creases"))
    elif ending != ".fold":
        if pattern.folded_coords is not None:
            findings.append(_loss("no-folded-form", target, "does not hold the folded form"))
        if pattern.seams is not None:
            says = "does not hold which edges meet along seams"
            findings.append(_loss("no-seams", target, says))
        if ending in WITHOUT_ANGLES:
            says = "tells mountains from valleys and no fold angles"
            findings.append(_loss("no-fold-angles", target, says))
            free = int(np.isin(pattern.edges_assignment, ("U", "J")).sum())
            if free:
                says = f"does not tell free creases (U, J) from flat ones (F): {free} become F"
                findings.append(_loss("free-creases", target, says))
    return Conversion(source, target, pattern, tuple(findings))


described(convert, ScaleOptions, ReadingOptions)


def _loss(code: str, target: Path, says: str) -> Finding:
    return Finding(code, f"{target.name} {says}.", target.name)


def _assumed(source: Path, pattern: CreasePattern) -> list[Finding]:
    """Assumptions for data that the format of ``source`` lacks."""
    if source.suffix.lower() in WITHOUT_ANGLES and (np.abs(pattern.edges_fold_angle) > 0).any():
        sentence = f"{source.name} tells no fold angles: its creases are taken as folded flat."
        return [Finding("assumed-folded-flat", sentence, source.name)]
    return []
