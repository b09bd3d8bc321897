"""Several settings in one file: strokes posted section by section, each with its own material.

Each section is a job that starts and ends dark and states its S and F before its first stroke, so
the sections of one sheet are joined by leaving out what stands around the strokes of each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.job import Job
from miurafab.posting.dialects import words_of
from miurafab.posting.make_job import post
from miurafab.profiles import MachineProfile, Material

_NAMES = 3
"""Comments that a job begins with: sheet, machine, material."""


def post_sections(
    sections: Sequence[tuple[Toolpath, Material]],
    machine: MachineProfile,
    *,
    patch_labels: Mapping[int, str] | None = None,
) -> Job:
    """One file that makes ``sections`` in turn, each with the powers or forces, the feeds and the
    passes of its own material. The job is called as the first of them. A knife is aligned before
    each.

    Raises what :func:`~miurafab.posting.make_job.post` raises.
    """
    head: list[str] = []
    body: list[str] = []
    foot: list[str] = []
    for toolpath, material in sections:
        job = post(toolpath, machine, material, patch_labels=patch_labels)
        lines = job.text.splitlines(keepends=True)
        first, last = 1, len(lines) - 1
        air: tuple[str, ...] = ()
        if machine.dialect != "hpgl":
            words = words_of(machine, material)
            left_out = sum(line.startswith("(left out ") for line in lines)
            first, last = _NAMES + left_out + len(words.begin), len(lines) - len(words.end)
            air = words.air
        head = head or lines[:first]
        body += _with_air(body, lines[first:last], air)
        foot = lines[last:]
    return Job(sections[0][0].sheet, "".join([*head, *body, *foot]))


def _with_air(before: Sequence[str], lines: list[str], air: Sequence[str]) -> list[str]:
    """``lines``, which were written for the air shut, after those ``before``."""
    if not air:
        return lines
    opens, shuts = (f"{word}\n" for word in air)
    if next((line for line in reversed(before) if line in (opens, shuts)), shuts) == shuts:
        return lines
    return lines[1:] if lines[:1] == [opens] else [shuts, *lines]
