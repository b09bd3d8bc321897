"""What a person should know about a target, a sheet, a layout or a job: one judgement, one value.

Every room that judges answers with findings. A finding never changes what it is about: a command
shows it, ``--json`` prints it, and a refusal stops the work unless it is overridden by its code.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["note", "warning", "refusal"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One judgement.

    Parameters
    ----------
    code : str
        The name of the judgement, such as ``bounds``. It stays the same from version to version;
        ``--force CODE`` takes it.
    severity : {"note", "warning", "refusal"}
        ``note``: for information. ``warning``: probably not wanted. ``refusal``: the work stops.
    sentence : str
        The whole judgement as one sentence, with the numbers and the way out. The names of options
        stand in backticks (:func:`miurafab.errors.spell_options`).
    where : str
        The place: a file and line, a sheet, a facet. Empty where the sentence is about the whole.

    Examples
    --------
    >>> Finding("bounds", "refusal", "Line 5 leaves the bed.", "edge.nc:5").as_json()["code"]
    'bounds'
    """

    code: str
    severity: Severity
    sentence: str
    where: str = ""

    def as_json(self) -> dict[str, str]:
        """The four fields as text, in the order that reports print them."""
        return {
            "code": self.code,
            "severity": self.severity,
            "where": self.where,
            "sentence": self.sentence,
        }

    def __str__(self) -> str:
        return self.sentence


def refusals(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """The findings that stop the work."""
    return tuple(finding for finding in findings if finding.severity == "refusal")
