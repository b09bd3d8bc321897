"""How much of each crease is left when its dashes are burnt."""

from __future__ import annotations

import numpy as np

from miurafab.fabrication.perforation import burnt_shares, perforate, unbroken
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

_KINDS = {"M": "mountain", "V": "valley"}


def uncut_shares(pattern: CreasePattern, material: Material) -> Floats:
    """(E,) the part of each edge that is left whole when ``material`` makes it a crease.

    The dashes are those that are burnt, with their kerf. A score leaves all of the crease: by how
    much it weakens the sheet is not known. Edges that are no creases are whole.
    """
    shares = np.ones(len(pattern.edges_vertices))
    lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    for letter, kind in _KINDS.items():
        mode = material.creases[kind].mode
        if mode not in ("perforate", "cut"):
            continue
        edges = np.flatnonzero(pattern.edges_assignment == letter)
        ends = pattern.vertices_coords[pattern.edges_vertices[edges]]
        make = perforate if mode == "perforate" else unbroken
        dashes = make(ends[:, 0], ends[:, 1], material, kind)
        burnt = burnt_shares(dashes, lengths[edges], material.kerf_mm)
        shares[edges] = np.clip(1 - burnt, 0.0, 1.0)
    return shares
