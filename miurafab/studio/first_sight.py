"""What is seen of a target as soon as it is chosen, in two steps.

The first step is the answer itself: a surface as it is, a mesh as its file has it. What a fit would
make of a mesh takes longer and is computed by another process, as is the picture of a large file;
it is asked for by its number. Only the newest question has an answer.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import miurafab
from miurafab.errors import MiurafabError, TargetError
from miurafab.profiles import read_toml
from miurafab.studio.mends import mends
from miurafab.studio.orders import FitOrder
from miurafab.studio.source import Source
from miurafab.studio.target_view import SHAPING, file_shown, shown
from miurafab.studio.work import Order
from miurafab.studio.worker import Running
from miurafab.surfaces.height_field import pixels_in

AT_ONCE = 4 * 2**20
"""A mesh file of so many bytes is read while the page waits: 80,000 triangles, 0.15 s."""
PLAIN = (".stl", ".obj", ".ply", ".off", ".glb")
"""Mesh files that hold no more than their bytes: they are not packed, nor meshed when read."""
PIXELS = 1_000_000
"""A height map of so many pixels is read while the page waits: 0.3 s."""


class FirstSight:
    """The target that the page shows; ``start`` starts an order. Methods may be called in any
    thread.
    """

    def __init__(self, start: Callable[[Order], Running]) -> None:
        self._start = start
        self._lock = threading.Lock()
        self._number = 0
        self._running: Running | None = None
        self._said: dict[str, Any] | None = None

    def show(self, asked: FitOrder, target: str, source: Source | None) -> dict[str, Any]:
        """The first picture of ``target``, and as ``more`` the number of the second, if there is
        one. ``source`` is its file, if it has one. What is refused is told in the answer, with what
        mends it.
        """
        options = {name: value for name, value in asked.options.items() if name in SHAPING}
        with self._lock:
            self._end()
            self._number += 1
            mesh = None if source is None else _mesh_of(source)
            try:
                picture = _first(target, options, source, mesh)
            except MiurafabError as fault:
                return {"refused": fault.sentence, "mends": mends(fault.sentence)}
            if mesh is None and picture is not None:
                return {"picture": picture, "more": None}
            file = Path() if mesh is None or picture is not None else mesh
            order = Order("place", Path(), "", target=target, file=file, options=options)
            self._running = self._start(order)
            return {"picture": picture, "more": self._number}

    def more(self, number: int) -> dict[str, Any]:
        """The second picture; ``{"wait": true}`` while there is none, with the first as
        ``picture`` when a large file has been read; ``{"gone": true}`` where a newer target was
        chosen.
        """
        with self._lock:
            if number != self._number or (self._running is None and self._said is None):
                return {"gone": True}
            told: dict[str, Any] = {"wait": True}
            for news in [] if self._running is None else self._running.news():
                if "shown" in news:
                    told["picture"] = news["shown"]
                elif "placed" in news:
                    self._said = news["placed"]
                elif "error" in news:
                    self._said = {"refused": news["error"], "mends": []}
            if self._said is None:
                return told
            self._stop()
            return self._said

    def stop(self) -> None:
        """End the process, if there is one."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        self._stop()
        self._said = None

    def _stop(self) -> None:
        running, self._running = self._running, None
        if running is not None:
            running.stop()


def _first(
    target: str, options: Mapping[str, Any], source: Source | None, mesh: Path | None
) -> dict[str, Any] | None:
    """The first picture, None for a file that may take long or much memory: the process with a
    machine hangs on this one.
    """
    if mesh is not None:
        plain = mesh.suffix.lower() in PLAIN and mesh.is_file()
        return file_shown(mesh) if plain and mesh.stat().st_size <= AT_ONCE else None
    if source is not None and source.kind == "image" and pixels_in(source.path) > PIXELS:
        return None
    return shown(miurafab.design(target, **options))


def _mesh_of(source: Source) -> Path | None:
    """The mesh file of a target, if it has one."""
    if source.kind == "mesh":
        return source.path
    if source.kind == "design":
        target = read_toml(source.path, TargetError).get("target")
        mesh = target.get("mesh") if isinstance(target, dict) else None
        return source.path.parent / mesh if isinstance(mesh, str) else None
    return None
