"""Findings on a layout: options that could not be honoured, and everything that has no room."""

from __future__ import annotations

import numpy as np

from miurafab.fabrication.borders import chosen_edges
from miurafab.fabrication.kit.rim_texts import RimTexts
from miurafab.fabrication.labels import Lettering
from miurafab.fabrication.nesting import Nesting
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import FramedPatches
from miurafab.fabrication.strokes import Drawn
from miurafab.fabrication.tabs import MIN_BASE_MM
from miurafab.fabrication.wording import count, in_order
from miurafab.findings import Finding
from miurafab.geometry.arrays import Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

_NAMED = 8
"""So many weak tabs are listed by number; the others are counted."""


def layout_findings(
    pattern: CreasePattern,
    framed: FramedPatches,
    nesting: Nesting,
    lettering: Lettering,
    rim: RimTexts,
    drawn: Drawn,
    material: Material,
    options: LayoutOptions,
) -> tuple[Finding, ...]:
    """The findings on one layout; ``where`` of ``untabbed`` is the edges of the pattern."""
    tabs, labels = framed.outlined.tabs, framed.labels
    findings = []
    weak = in_order(labels[k] for k in np.flatnonzero(tabs.areas < material.tabs.min_area_mm2))
    if weak:
        named = ", ".join(weak[:_NAMED])
        more = f" and {len(weak) - _NAMED} more" if len(weak) > _NAMED else ""
        sentence = (
            f"{len(weak)} of {count(len(labels), 'tab has', 'tabs have')} less than "
            f"{material.tabs.min_area_mm2:g} mm2 of glue: {named}{more}."
        )
        findings.append(Finding("weak-tabs", sentence))
    if lettering.unmarked:
        texts = count(lettering.unmarked, "tab has", "tabs have")
        its = "its" if lettering.unmarked == 1 else "their"
        findings.append(Finding("fold-letters", f"{texts} no room for the letter of {its} fold."))
    if drawn.unrelieved:
        places = count(drawn.unrelieved, "vertex", "vertices")
        sentence = f"At {places} a crease is too short for a relief hole."
        findings.append(Finding("relief-holes", sentence))
    if drawn.unbridged:
        sentence = (
            f"{count(drawn.unbridged, 'outline has', 'outlines have')} no room for "
            f"{options.bridges} holding bridges of {options.bridge_mm:g} mm: a side that bears one "
            "must be over three times as long."
        )
        findings.append(Finding("bridges", sentence))
    if drawn.unticked:
        ends = count(drawn.unticked, "end of a fold has", "ends of folds have")
        findings.append(Finding("ticks", f"{ends} no room for a tick."))
    if not nesting.finished:
        sentence = (
            "The nesting reached its limit of work before it had tried every order of the patches; "
            "fewer sheets may be possible. Lay out fewer copies at a time with `quantity`."
        )
        findings.append(Finding("nesting-limit", sentence))
    unassigned = int((pattern.edges_assignment == "U").sum())
    if unassigned:
        creases = count(unassigned, "crease is", "creases are")
        sentence = f"{creases} neither mountain nor valley in the pattern."
        findings.append(Finding("unassigned-creases", sentence))
    findings += _untabbed(pattern, framed.outlined.untabbed, options)
    if lettering.left_out:
        names = count(lettering.left_out, "name or label", "names and labels")
        sentence = f"{names} found no room on the sheets: the guide shows them at the sheets."
        findings.append(Finding("unlettered", sentence))
    if rim.left_out:
        names = count(rim.left_out, "rim number", "rim numbers")
        sentence = f"{names} found no room on the waste: the guide shows them."
        findings.append(Finding("rim-numbers", sentence))
    return tuple(findings)


def _untabbed(pattern: CreasePattern, edges: Ints, options: LayoutOptions) -> list[Finding]:
    """The edges without the tab that is wanted, those of seams before those of open borders."""
    rim = np.isin(edges, chosen_edges(pattern, options.border_tabs))
    found = []
    for own, (one, many), remedy in (
        (edges[~rim], ("seam edge bears", "seam edges bear"), "use tape there"),
        (edges[rim], ("edge of an open border bears", "edges of open borders bear"), "glue beside"),
    ):
        if not len(own):
            continue
        ends = pattern.edges_vertices[own]
        short = int((edge_lengths(pattern.vertices_coords, ends) < MIN_BASE_MM).sum())
        which = f", {short} of them shorter than {MIN_BASE_MM:g} mm" if short else ""
        run, at = longest_run(pattern, own)
        sentence = (
            f"{count(len(own), one, many)} no tab{which}, since there is no room: {remedy}. The "
            f"longest bare run is {run:.1f} mm, at edge {at} of the pattern."
        )
        found.append(Finding("untabbed", sentence, tuple(own.tolist())))
    return found


def longest_run(pattern: CreasePattern, edges: Ints) -> tuple[float, int]:
    """The length in mm of the longest chain of joined ``edges`` (n,), and its first edge."""
    ends = pattern.edges_vertices[edges]
    _, which = np.unique(ends, return_inverse=True)
    pairs = which.reshape(ends.shape)
    chain = components(int(pairs.max()) + 1, *pairs.T)[pairs[:, 0]]
    lengths = np.bincount(chain, edge_lengths(pattern.vertices_coords, ends))
    longest = int(lengths.argmax())
    return float(lengths[longest]), int(edges[chain == longest].min())
