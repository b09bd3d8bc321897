"""miurafab: from a curved surface to a folded origami shell, cut on a real machine.

The verbs of the command line are functions here, over frozen dataclasses::

    import miurafab

    wanted = miurafab.design("hypar:height=0.5", facets="20x20", size="250mm")
    result = miurafab.fit(wanted.request)
    layout = miurafab.sheets(result.pattern, "grbl-laser-400", "card-250")
    miurafab.write_job(layout, "jobs/hypar")
    miurafab.cut("jobs/hypar", port="virtual")

Each name is imported when it is first used, so that ``import miurafab`` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from miurafab.origami.audit import audit as check
    from miurafab.origami.fit import fit
    from miurafab.posting import post
    from miurafab.profiles import load_machine, load_material
    from miurafab.workflow.design import design, load_pattern, save_pattern
    from miurafab.workflow.doctor import examine

__version__ = "0.1.0"

_HOMES = {
    "check": ("miurafab.origami.audit", "audit"),
    "design": ("miurafab.workflow.design", "design"),
    "examine": ("miurafab.workflow.doctor", "examine"),
    "fit": ("miurafab.origami.fit", "fit"),
    "load_machine": ("miurafab.profiles", "load_machine"),
    "load_material": ("miurafab.profiles", "load_material"),
    "load_pattern": ("miurafab.workflow.design", "load_pattern"),
    "post": ("miurafab.posting", "post"),
    "save_pattern": ("miurafab.workflow.design", "save_pattern"),
}

__all__ = [
    "__version__",
    "check",
    "design",
    "examine",
    "fit",
    "load_machine",
    "load_material",
    "load_pattern",
    "post",
    "save_pattern",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'miurafab' has no attribute '{name}'")
    module, attribute = _HOMES[name]
    return getattr(importlib.import_module(module), attribute)


def __dir__() -> list[str]:
    return sorted(__all__)
