"""The work, done by the verbs of the package: fit or open a pattern, fold it, lay it out.

Each order has its own folder. All its files are written there, with the names that the command
line gives them. Results are reported part by part, so that the page can show a pattern while its
folding is still being computed.
"""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import miurafab
from miurafab.errors import MiurafabError, PatternError
from miurafab.fabrication.mates import seam_tabs
from miurafab.files import write_text
from miurafab.findings import Finding, findings_json
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.fold import read_fold
from miurafab.origami.picture import flat_svg
from miurafab.origami.verify import Audit
from miurafab.studio.recipe import job_name
from miurafab.studio.target_view import compared, file_shown, placed
from miurafab.surfaces.description import described_surface, no_target
from miurafab.surfaces.surface import TargetSurface
from miurafab.workflow.drawings import GUIDE
from miurafab.workflow.json_text import json_text
from miurafab.workflow.page import write_page
from miurafab.workflow.picture import svg_text
from miurafab.workflow.preview import Preview

Tell = Callable[[dict[str, Any]], None]

PAGE, MOTION, PICTURE, TARGET = "still.html", "folding.html", "pattern.svg", "target.json"
_FLAT = 400.0
"""The width of the flat picture, about that on the page: its lines are made for it."""
_FITTING = 0.6
"""The share of the progress bar for the fit; the rest is for the folding."""


@dataclass(frozen=True)
class Order:
    """What to do (``fit``, ``open``, ``sheets`` or ``place``) in ``folder``, for the pattern
    ``name``.

    ``target`` is for a fit; ``file`` is the pattern to open or lay out. ``ours`` says that the
    command line named the file, and that the browser did not send it.
    """

    do: str
    folder: Path
    name: str
    target: str = ""
    file: Path = Path()
    ours: bool = False
    machine: str = ""
    material: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    formats: str = ""

    def as_dict(self) -> dict[str, Any]:
        """The order as JSON for another process."""
        return asdict(self) | {"folder": str(self.folder), "file": str(self.file)}


def order_from(values: Mapping[str, Any]) -> Order:
    """The order that :meth:`Order.as_dict` wrote."""
    return Order(**{**values, "folder": Path(values["folder"]), "file": Path(values["file"])})


def carry_out(order: Order, tell: Tell) -> None:
    """Carry out ``order``; ``tell`` gets progress and parts of the answer.

    Raises what the verbs raise: :class:`~miurafab.errors.MiurafabError` for wrong input.
    """
    {"fit": _fit, "open": _open, "sheets": _sheets, "place": _place}[order.do](order, tell)


def _place(order: Order, tell: Tell) -> None:
    """What a fit would make of a mesh, for the picture of the target; before that, the mesh of
    ``file`` as it is, if one is named.
    """
    if order.file.name:
        tell({"shown": file_shown(order.file)})
    tell({"placed": placed(order.target, order.options)})


def _fit(order: Order, tell: Tell) -> None:
    tell({"progress": 0.0, "note": "reading the target"})
    wanted = miurafab.design(order.target, **order.options)
    result = miurafab.fit(wanted, on_progress=_progress(tell, 0.0, _FITTING))
    part = {
        "part": "pattern",
        "report": result.report(),
        "findings": findings_json(wanted.findings),
    }
    if result.pattern is None:
        tell(part | {"files": {}})
        return
    pattern = _with_mesh_in(order.folder, result.pattern)
    file = order.folder / f"{order.name}.fold"
    pattern.save(file, title=wanted.title)
    _show(order, pattern, wanted.request.surface, part | {"files": {"fold": file.name}}, tell)


def _open(order: Order, tell: Tell) -> None:
    tell({"progress": 0.0, "note": "checking the pattern"})
    checked, missing, surface = _checked(order)
    copy = order.folder / f"{order.name}.fold"
    shutil.copyfile(order.file, copy)
    part = {"part": "pattern", "report": checked.report(), "findings": findings_json(missing)}
    _show(order, read_fold(order.file), surface, part | {"files": {"fold": copy.name}}, tell)


def _checked(order: Order) -> tuple[Audit, tuple[Finding, ...], TargetSurface | None]:
    """The audit, findings on the target, and the target. A file from the browser must not name a
    mesh by its path.
    """
    pattern = read_fold(order.file)
    if "mesh" in pattern.target and not order.ours:
        missing = no_target("its target is a mesh, which is not in the file")
        return miurafab.check(replace(pattern, target={})), missing, None
    checked = miurafab.check(pattern)
    missing = tuple(each for each in checked.findings if each.code == "no-target")
    return checked, missing, described_surface(pattern.target)[0]


def _with_mesh_in(folder: Path, pattern: CreasePattern) -> CreasePattern:
    """``pattern`` with a copy of its target's mesh beside it, named without a path."""
    if "mesh" not in pattern.target:
        return pattern
    mesh = Path(pattern.target["mesh"])
    copy = folder / mesh.name
    shutil.copyfile(mesh, copy)
    return replace(pattern, target={**pattern.target, "mesh": str(copy.resolve())})


def _show(
    order: Order,
    pattern: CreasePattern,
    surface: TargetSurface | None,
    part: dict[str, Any],
    tell: Tell,
) -> None:
    """Report the pattern as a drawing and in space, first still, then folding; and its target."""
    folder = order.folder
    write_text(folder / PICTURE, flat_svg(pattern, _FLAT))
    write_page(folder / PAGE, title=order.name, pattern=pattern)
    files = {**part["files"], "picture": PICTURE, "page": PAGE}
    if surface is not None and pattern.folded_coords is not None:
        write_text(folder / TARGET, json_text(compared(pattern, surface), one_line=True))
        files["target"] = TARGET
    tell(part | {"files": files})
    tell({"progress": _FITTING, "note": "folding"})
    try:
        folding = miurafab.fold(pattern, on_progress=_progress(tell, _FITTING, 1.0))
    except PatternError as fault:
        tell({"part": "motion", "missing": str(fault)})
        return
    folding.save(folder / MOTION, title=order.name)
    tell({"part": "motion", "files": {"page": MOTION}, "findings": findings_json(folding.findings)})


def _sheets(order: Order, tell: Tell) -> None:
    directory = order.folder / job_name(order.name)
    progress = _progress(tell, 0.0, 0.6)
    made = miurafab.sheets(
        order.file, order.machine, order.material, on_progress=progress, **order.options
    )
    formats = order.formats or ()
    job = made.write(directory, formats=formats, on_progress=_progress(tell, 0.6, 0.9))
    tell({"progress": 0.9, "note": "drawing the sheets"})
    tabs = tuple(seam_tabs(made.layout, made.pattern))
    shown = Preview(order.name, job.machine, job.dry_runs, None, (), tabs)
    page = f"{order.name}-preview.html"
    write_page(order.folder / page, title=order.name, preview=shown)
    pictures = []
    for sheet in job.dry_runs:
        pictures.append(f"{sheet.name}-picture.svg")
        write_text(order.folder / pictures[-1], svg_text(sheet, job.machine))
    packed = f"{directory.name}.zip"
    _pack(directory, order.folder / packed)
    shutil.copyfile(directory / GUIDE, order.folder / GUIDE)
    tell(
        {
            "part": "job",
            "totals": asdict(job.layout.totals),
            "findings": findings_json(job.findings),
            "files": {"zip": packed, "guide": GUIDE, "page": page},
            "pictures": pictures,
            "every": [f"{directory.name}/{path.name}" for path in sorted(directory.iterdir())],
        }
    )


def _pack(directory: Path, archive: Path) -> None:
    """``directory`` as a ZIP archive; the same files give the same bytes."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(directory.iterdir()):
            entry = zipfile.ZipInfo(f"{directory.name}/{path.name}")
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            packed.writestr(entry, path.read_bytes())


def _progress(tell: Tell, low: float, high: float) -> Callable[[float, str], None]:
    """Progress of a step as a part of the whole."""
    return lambda fraction, note: tell(
        {"progress": low + (high - low) * min(max(fraction, 0.0), 1.0), "note": note}
    )


def failure(fault: MiurafabError | OSError | MemoryError) -> str:
    """One sentence about ``fault``."""
    if isinstance(fault, MemoryError):
        return "This computer has not enough memory for that; ask for fewer `facets`."
    if isinstance(fault, OSError):
        return f"A file could not be read or written: {fault.strerror or fault}."
    return fault.sentence
