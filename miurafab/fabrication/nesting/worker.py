"""The process in which an outside engine works, so that it can be ended at any time.

It reads one problem as JSON from its standard input and writes a line of JSON for whatever
happens: ``begun`` with the version of the engine, ``slots`` for each better layout, and ``ended``
or ``refused`` at last. It ends at once when its standard input is closed, as it is when the
process that started it is gone.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import threading
from dataclasses import astuple
from importlib.metadata import version
from typing import Any, TextIO

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.problem import Engine, Problem, SheetKind, Slot, Stock


def written(engine: str, problem: Problem) -> str:
    """A line that asks for ``problem`` to be solved."""
    stock = problem.stock
    return json.dumps(
        {
            "engine": engine,
            "outlines": [outline.tolist() for outline in problem.outlines],
            "names": problem.names,
            "kinds": [astuple(kind) for kind in stock.kinds],
            "gap": stock.gap,
            "seconds": problem.seconds,
            "seed": problem.seed,
        }
    )


def read(line: str) -> tuple[str, Problem]:
    """The engine and the problem that ``line`` asks for."""
    asked = json.loads(line)
    kinds = tuple(
        SheetKind(
            width,
            height,
            tuple(rotations),
            quantity,
            tuple(tuple((x, y) for x, y in ring) for ring in defects),
        )
        for width, height, rotations, quantity, defects in asked["kinds"]
    )
    problem = Problem(
        tuple(np.array(outline, dtype=np.float64) for outline in asked["outlines"]),
        tuple(asked["names"]),
        Stock(kinds, asked["gap"]),
        asked["seconds"],
        asked["seed"],
    )
    return asked["engine"], problem


def main() -> None:
    """Solve the problem that is asked for."""
    # What engines print themselves must not get among the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)
    name, problem = read(sys.stdin.readline())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    module = importlib.import_module(f"{__package__}.with_{name}")
    engine: Engine = getattr(module, f"{name}_engine")
    _tell(answers, begun=version(name))
    try:
        finished = engine(problem, lambda slots: _tell(answers, slots=[astuple(s) for s in slots]))
    except LayoutError as fault:
        _tell(answers, refused=str(fault))
    else:
        _tell(answers, ended=finished)
    answers.flush()
    os._exit(0)  # threads of the engine may still run


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


def _tell(answers: TextIO, **what: Any) -> None:
    answers.write(json.dumps(what) + "\n")
    answers.flush()


def layout(line: list[list[Any]]) -> list[Slot]:
    """The layout of a ``slots`` line."""
    return [
        Slot(int(sheet), int(kind), float(x), float(y), int(rotation))
        for sheet, kind, x, y, rotation in line
    ]
