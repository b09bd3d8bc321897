"""``miurafab surfaces``: the built-in targets, their parameters and defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from miurafab.cli.console import Console
from miurafab.errors import DONE

if TYPE_CHECKING:
    from miurafab.surfaces.catalogue import SurfaceParameter


EXAMPLES = ("miurafab surfaces", "miurafab surfaces --json")


def surfaces(*, console: Console = Console()) -> int:
    """List the built-in targets with their parameters and defaults."""
    from miurafab.surfaces.catalogue import CATALOGUE

    answer = {
        "surfaces": [
            {
                "name": entry.name,
                "summary": entry.summary,
                "profile": entry.profile_axes,
                "formulas": dict(entry.formulas),
                "parameters": {
                    key: {
                        "default": parameter.default,
                        "low": parameter.kind.low,
                        "high": parameter.kind.high,
                        "unit": parameter.kind.unit.strip(),
                        "meaning": parameter.meaning,
                    }
                    for key, parameter in entry.parameters.items()
                },
            }
            for entry in CATALOGUE.values()
        ]
    }

    def show() -> None:
        rows = [
            (entry.name, entry.summary, _defaults(entry.parameters)) for entry in CATALOGUE.values()
        ]
        console.rows(("name", "what it is", "parameters and defaults"), rows)
        console.line("Give parameters after a colon: miurafab fit hypar:height=0.5 -o hypar.fold")

    console.answer(answer, show)
    return DONE


def _defaults(parameters: Mapping[str, SurfaceParameter]) -> str:
    return ", ".join(f"{key}={each.default_text}" for key, each in parameters.items())
