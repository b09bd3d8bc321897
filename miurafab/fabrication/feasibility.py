"""What can be folded and what holds: facets, creases and bridges against the sheet they are of.

A sheet folds along its creases only if these are weaker than the facets between them, and it holds
only if what is left whole between two cuts is more than a thread. Each limit below says where it is
from. A facet narrower than the sheet is thick is refused, for it is a rod; all else is a warning,
since a patient hand can do more than a rule knows.
"""

from __future__ import annotations

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.borders import is_loose
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.perforation import burnt_shares, perforate
from miurafab.fabrication.wording import count
from miurafab.findings import Finding
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import edge_lengths, filled, previous_corners
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

PLATE = 8.0
"""A plate is thin, and bends as a sheet does, from a width of 8 to 10 times its thickness on
(Ventsel and Krauthammer, Thin Plates and Shells, 2001, section 1.1); in a narrower facet the bends
of its creases, each about as long as the sheet is thick, leave little that is flat."""

HELD_MM = 4.0
"""A narrower facet cannot be held between two fingertips, or pressed down without its neighbours
(judged; the smallest facet of the shipped designs is 6.2 mm wide)."""

STIFF = 0.5
"""A crease of which less than this part of the usual share is burnt folds beside its dashes. The
stiffest dashes that a calibration sheet tries burn 0.65 to 0.75 of that share, and the shipped
designs no less than 0.73 at any crease."""

_KINDS = {"M": "mountain", "V": "valley"}


def require_foldable(pattern: CreasePattern, material: Material) -> None:
    """Raise ``LayoutError`` for a facet narrower than the sheet is thick."""
    widths = facet_widths(pattern.vertices_coords, pattern.faces_vertices)
    least = int(widths.argmin())
    if widths[least] < material.thickness_mm:
        raise LayoutError(
            f"Facet {least} is {widths[least]:.3g} mm wide, and {material.name} is "
            f"{material.thickness_mm:g} mm thick: that cannot be folded. Make the pattern larger, "
            "with fewer facets, or take a thinner material."
        )


def strength_findings(
    pattern: CreasePattern, material: Material, options: LayoutOptions
) -> list[Finding]:
    """What is too small to fold or too weak to hold; ``where`` is the facets or edges. Loose parts
    are not folded.
    """
    if is_loose(pattern):
        return []
    return [
        *_small_facets(pattern, material),
        *_corners(pattern, material),
        *_creases(pattern, material),
        *_bridges(material, options),
    ]


def facet_widths(points: Floats, faces: Ints) -> Floats:
    """(F,) the least width of each facet of ``faces`` (F, k) at ``points`` (V, 2), in mm: its
    extent across one of its sides. For a facet that is not convex it may be less.
    """
    corners = points[filled(faces)]
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    safe = np.where(lengths > 0.0, lengths, 1.0)
    normals = np.stack([-sides[..., 1], sides[..., 0]], axis=2) / safe[..., None]
    extents = np.ptp(np.einsum("fkc,fnc->fnk", corners, normals), axis=2)
    return np.asarray(np.where(lengths > 0.0, extents, np.inf).min(axis=1))


def _small_facets(pattern: CreasePattern, material: Material) -> list[Finding]:
    widths = facet_widths(pattern.vertices_coords, pattern.faces_vertices)
    plate = PLATE * material.thickness_mm
    limit = max(plate, HELD_MM)
    small = np.flatnonzero(widths < limit)
    if not len(small):
        return []
    why = (
        f"{PLATE:g} times the thickness of {material.name}, and as stiff as their creases"
        if plate > HELD_MM
        else "what fingers can hold"
    )
    sentence = (
        f"{count(len(small), 'facet is', 'facets are')} narrower than {limit:g} mm, {why}; the "
        f"narrowest has {widths[small].min():.2g} mm. Make the pattern larger, or its facets fewer."
    )
    return [Finding("small-facets", sentence, tuple(small.tolist()))]


def _corners(pattern: CreasePattern, material: Material) -> list[Finding]:
    """Corners whose two rows of dashes run into each other: at the end of the bridges, a length b
    from the corner, they are 2 b sin(a / 2) apart, which must be more than the kerf.
    """
    bridge = material.perforation.bridge_mm
    if not bridge or not material.kerf_mm:
        return []
    faces = pattern.faces_vertices
    corners = pattern.vertices_coords[filled(faces)]
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    ahead = sides / np.where(lengths > 0.0, lengths, 1.0)[..., None]
    before = previous_corners(faces)
    back = -np.take_along_axis(ahead, before[..., None], axis=1)
    chord = np.linalg.norm(ahead - back, axis=2)  # 2 sin(a / 2)
    creased = _dashed(pattern, material)[pattern.faces_edges] & (faces >= 0)
    both = creased & np.take_along_axis(creased, before, axis=1)
    sharp = (bridge * chord < material.kerf_mm) & both
    if not sharp.any():
        return []
    least = np.degrees(2 * np.arcsin(np.minimum(material.kerf_mm / bridge, 2.0) / 2))
    sentence = (
        f"{count(int(sharp.sum()), 'corner is', 'corners are')} sharper than {least:.0f} degrees: "
        "the dashes of the two creases run into each other there, and the tip falls out. Make the "
        "end_bridge longer."
    )
    return [Finding("sharp-corners", sentence, tuple(np.flatnonzero(sharp.any(axis=1)).tolist()))]


def _dashed(pattern: CreasePattern, material: Material) -> Bools:
    """(E,) whether each edge is a crease that is perforated."""
    found = np.zeros(len(pattern.edges_vertices), dtype=bool)
    for letter, kind in _KINDS.items():
        if material.creases[kind].mode == "perforate":
            found |= pattern.edges_assignment == letter
    return found


def _creases(pattern: CreasePattern, material: Material) -> list[Finding]:
    single: list[int] = []
    stiff: list[int] = []
    lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    for letter, kind in _KINDS.items():
        if material.creases[kind].mode != "perforate":
            continue
        edges = np.flatnonzero(pattern.edges_assignment == letter)
        ends = pattern.vertices_coords[pattern.edges_vertices[edges]]
        made = perforate(ends[:, 0], ends[:, 1], material, kind)
        dashes = np.bincount(made.crease, minlength=len(edges))
        share = burnt_shares(made, lengths[edges], material.kerf_mm)
        rule = material.perforation_of(kind)
        usual = rule.cut_mm / (rule.cut_mm + rule.gap_mm)
        single += edges[dashes == 1].tolist()
        stiff += edges[(dashes > 1) & (share < STIFF * usual)].tolist()
    found = []
    if single:
        sentence = (
            f"{count(len(single), 'crease has', 'creases have')} one dash alone, the longest on "
            f"{lengths[single].max():.3g} mm, and may fold beside it. Make the pattern larger, or "
            "end_bridge and dashes shorter."
        )
        found.append(Finding("single-dash", sentence, tuple(sorted(single))))
    if stiff:
        sentence = (
            f"Less than {STIFF:.0%} of the usual share is burnt at "
            f"{count(len(stiff), 'crease', 'creases')}, which may fold beside the dashes. Make the "
            "end_bridge shorter."
        )
        found.append(Finding("stiff-creases", sentence, tuple(sorted(stiff))))
    return found


def _bridges(material: Material, options: LayoutOptions) -> list[Finding]:
    """Bridges narrower than the kerf, which a kerf of twice the stated one burns away, or than the
    sheet is thick, which are threads.
    """
    limit = max(material.kerf_mm, material.thickness_mm)
    widths: dict[str, float] = {}
    for kind, crease in material.creases.items():
        rule = material.perforation_of(kind)
        if crease.mode == "perforate":
            widths["gap"] = min(rule.gap_mm, widths.get("gap", rule.gap_mm))
        if crease.mode != "none" and rule.bridge_mm:
            widths["end_bridge"] = min(rule.bridge_mm, widths.get("end_bridge", rule.bridge_mm))
    if options.bridges:
        widths["`bridge`"] = options.bridge_mm
    thin = [f"{name} {width:g} mm" for name, width in widths.items() if width < limit]
    if not thin:
        return []
    sentence = (
        f"Bridges narrower than {limit:g} mm, the kerf or the thickness of {material.name}, burn "
        f"away or tear: {', '.join(thin)}."
    )
    return [Finding("thin-bridges", sentence)]
