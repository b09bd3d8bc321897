"""The studio without sockets: a request in, a response out.

=============== ====== ==========================================================================
address         method answers
=============== ====== ==========================================================================
(empty)         GET    the page; its styles and scripts by their names
catalogue       GET    surfaces, machines and materials to choose from, limits, defaults
state           GET    the pattern and the job on the bench, and the progress of the task
files/N/NAME    GET    a computed file; with ``?save`` to save it
design.toml     GET    the design file of the pattern
upload          POST   keeps a file (its name in ``X-File-Name``, percent-encoded)
fit, open       POST   starts to make or read a pattern
sheets          POST   starts to lay it out
live, live/plan POST   asks for a coarse fit, or for the sheets that the pattern on the bench needs
live/N          GET    the answer to the N-th of these
target          POST   the picture of a target, and the number of a second one
target/N        GET    the second picture, once it is there
cancel          POST   ends the task
machine         GET    the session with a machine, and what was said since ``?after=N``
machine/sheet/N GET    the strokes of sheet N of the job there
machine/...     POST   what a person does at it (:mod:`~miurafab.studio.machine_orders`)
=============== ====== ==========================================================================

All addresses lie behind the key (:mod:`~miurafab.studio.guard`). A refusal is a sentence:
``{"error": ...}``. One request at a time is answered from the bench; those of the machine wait for
no other.
"""

from __future__ import annotations

import threading
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import miurafab
from miurafab.errors import InputError, MiurafabError
from miurafab.origami.fitting.request import DEFAULT_FACETS, DEFAULT_SIZE_MM, FACETS
from miurafab.studio.desk import Desk
from miurafab.studio.first_sight import FirstSight
from miurafab.studio.form import by_label, filled
from miurafab.studio.guard import FILE_LIMIT, UPLOAD, Guard
from miurafab.studio.kept_jobs import keep_job
from miurafab.studio.live import Live
from miurafab.studio.machine_orders import ROUTES, carry_out
from miurafab.studio.machine_words import NO_JOB, plain
from miurafab.studio.mends import mends
from miurafab.studio.messages import HttpRequest, Response, answer, made_file, own_file, refusal
from miurafab.studio.orders import (
    LayoutOrder,
    read_fit,
    read_glance,
    read_layout,
    read_plan,
    read_source,
)
from miurafab.studio.own_things import own_things
from miurafab.studio.session import Bench
from miurafab.studio.source import DESIGN_SUFFIX, PATTERN_SUFFIX
from miurafab.studio.texts import with_texts
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution
from miurafab.surfaces.catalogue import CATALOGUE, NamedSurface, make_surface
from miurafab.surfaces.height_field import IMAGE_SUFFIXES
from miurafab.surfaces.mesh_files import MESH_SUFFIXES, PACKED
from miurafab.surfaces.surface import TargetSurface
from miurafab.workflow.at_machine import STEPS
from miurafab.workflow.design import can_close
from miurafab.workflow.drawings import FORMATS
from miurafab.workflow.image_targets import PARAMETERS as OF_IMAGE
from miurafab.workflow.page import SCENE

PAGE, MACHINE, LIVE, TARGET = "studio.html", "machine", "live", "target"
PARTS = (
    *("icon.svg", "studio.css", "machine.css", "tools.js", "choices.js", "results.js"),
    *("folding.js", "live.js", "machine.js", "sheet.js", "sketch.js", "sliders.js", "studio.js"),
    "texts.js",
    *("target.js", "target_scene.js", "layout_map.js", "profile.js", *SCENE),
)
"""The files of the page, beside the page itself."""
DRAWN_FROM = 5
"""Points with which the drawing of a profile begins."""


class Studio:
    """Answers requests, in any thread. ``first`` is the target with which the page starts, if any;
    ``own_job`` a job directory or a G-code file that the command line named.
    """

    def __init__(
        self,
        bench: Bench,
        guard: Guard,
        first: dict[str, Any] | None = None,
        *,
        desk: Desk | None = None,
        live: Live | None = None,
        own_job: Path | None = None,
    ) -> None:
        self.bench = bench
        self.guard = guard
        self.desk = Desk() if desk is None else desk
        self.live = Live() if live is None else live
        self.sight = FirstSight(bench.start)
        self._own_job = own_job
        self._lock = threading.Lock()
        self._first = first
        self._page = resources.files(__package__).joinpath("page")
        self._scene = resources.files("miurafab.workflow.page")
        self._catalogue = _catalogue()

    def handle(self, request: HttpRequest) -> Response:
        """The answer to ``request``, or its refusal in a sentence."""
        refused = self.guard.refuse(request.method, request.path, request.headers)
        if refused is not None:
            return refused
        route = self.guard.route(request.path)
        assert route is not None
        if route == LIVE or route.startswith(f"{LIVE}/"):
            return self._live(route.removeprefix(LIVE).removeprefix("/"), request)
        if route == MACHINE or route.startswith(f"{MACHINE}/"):
            return self._machine(route.removeprefix(MACHINE).removeprefix("/"), request)
        if route == TARGET or route.startswith(f"{TARGET}/"):
            return self._target(route.removeprefix(TARGET).removeprefix("/"), request)
        with self._lock:
            self.bench.take_in()
            try:
                if request.method == "POST":
                    return self._post(route, request)
                return self._get(route, request.path.partition("?")[2])
            except MiurafabError as fault:
                return refusal(400, by_label(fault.sentence))

    def _live(self, route: str, request: HttpRequest) -> Response:
        """What is answered while a hand drags; it waits a moment, and nothing waits for it."""
        bench = self.bench
        try:
            if request.method == "POST":
                with self._lock:
                    bench.take_in()
                    number = self.live.ask(self._question(route, request.body))
            elif route.isascii() and route.isdigit():
                number = int(route[:9])
            else:
                return refusal(404, "Nothing is at this address.")
        except MiurafabError as fault:  # half a word is no fault of the page: it is no refusal
            return answer({"number": 0, "said": {"error": by_label(fault.sentence)}})
        said = dict(self.live.answer(number))
        if "error" in said:
            said["error"] = bench.plain(said["error"])
        told = said.get("answer", {})
        if "advice" in told:
            findings = bench.plain_findings(told["findings"])
            said["answer"] = told | {"advice": bench.plain(told["advice"]), "findings": findings}
        return answer({"number": number, "said": said})

    def _question(self, route: str, body: bytes) -> dict[str, Any]:
        if route == "plan":
            layout = read_plan(body)
            file = str(self.bench.pattern_file())
            return {"do": "plan", "file": file, "layout": self._beside(layout)}
        asked, layout = read_glance(body)
        target = self.bench.target_of(asked)
        options = dict(asked.options)
        beside = self._beside(layout)
        whole = self.bench.scaled_from(asked)
        if whole is not None:
            of = {"file": str(whole[0]), "report": whole[1], "size": options["size"]}
            return {"do": "scale", "layout": beside, **of}
        return {"do": "coarse", "target": target, "options": options, "layout": beside}

    def _beside(self, layout: LayoutOrder | None) -> dict[str, Any] | None:
        """A layout for the process beside it."""
        if layout is None:
            return None
        return {**asdict(layout), "options": self.bench.laid_by(layout)}

    def _target(self, route: str, request: HttpRequest) -> Response:
        """What is seen of a target; it waits for the list of files alone."""
        if request.method != "POST":
            number = int(route[:9]) if route.isascii() and route.isdigit() else -1
            return self._told(self.sight.more(number))
        try:
            asked = read_fit(request.body)
            with self._lock:
                target, source = self.bench.target_of(asked), self.bench.source_of(asked)
            return self._told(self.sight.show(asked, target, source))
        except MiurafabError as fault:
            return self._told({"refused": fault.sentence, "mends": mends(fault.sentence)})

    def _told(self, said: dict[str, Any]) -> Response:
        """An answer about a target with its sentences in the words of the page."""
        if "refused" in said:
            said = said | {"refused": self.bench.plain(said["refused"])}
        if "findings" in said:
            said = said | {"findings": self.bench.plain_findings(said["findings"])}
        return answer(said)

    def _machine(self, route: str, request: HttpRequest) -> Response:
        """What belongs to the session with a machine; nothing here waits for the bench, but the
        job that is taken from it.
        """
        desk = self.desk
        try:
            if request.method == "POST":
                if route not in ROUTES:
                    return refusal(404, "The machine takes no such request.")
                told = carry_out(desk, route, request.body, self._put_on)
                return answer({**told, **desk.state()})
            kind, _, number = route.partition("/")
            if kind == "sheet" and number.isascii() and number.isdigit():
                return answer(desk.drawing(int(number[:9])))
            if route:
                return refusal(404, "Nothing is at this address.")
            after = request.path.partition("?after=")[2]
            return answer(desk.state(int(after[:9]) if after.isascii() and after.isdigit() else 0))
        except MiurafabError as fault:
            return refusal(400, plain(fault.sentence))

    def _put_on(self) -> None:
        """Put the job of the last layout on the desk, or the one that the command line named."""
        with self._lock:
            laid_out = self.bench.job_folder()
            job = self._own_job if laid_out is None else keep_job(laid_out)
        if job is None:
            raise InputError(NO_JOB)
        self.desk.put_on(job, job.name if laid_out is None else laid_out.name)

    def _get(self, route: str, query: str) -> Response:
        if route in ("", *PARTS):
            name = route or PAGE
            folder = self._scene if name in SCENE else self._page
            content = folder.joinpath(name).read_bytes()
            if name == PAGE:
                content = filled(with_texts(content.decode())).encode()
            return own_file(name, content)
        if route == "catalogue":
            own = None if self._own_job is None else self._own_job.name
            known = {**self._catalogue, **own_things()}
            return answer({**known, "first": self._first, "own_job": own})
        if route == "state":
            return answer(self.bench.state())
        if route == "design.toml":
            text = self.bench.design_text()
            if text is not None and self.bench.pattern is not None:
                name = f"{self.bench.pattern['name']}{DESIGN_SUFFIX}"
                saved = {"Content-Disposition": f'attachment; filename="{name}"'}
                return Response(200, "text/plain; charset=utf-8", text.encode("utf-8"), saved)
        kind, _, rest = route.partition("/")
        number, _, name = rest.partition("/")
        path = self.bench.files.get((number, unquote(name))) if kind == "files" else None
        if path is None:
            return refusal(404, "Nothing is at this address, or no longer.")
        return made_file(path, download=query == "save")

    def _post(self, route: str, request: HttpRequest) -> Response:
        bench = self.bench
        if route == UPLOAD:
            name = unquote(request.headers.get("x-file-name", ""))
            source = bench.add_upload(name, request.body)
            return answer({"source": source.id, "kind": source.kind, **bench.state()})
        if route == "fit":
            bench.fit(read_fit(request.body))
        elif route == "open":
            bench.open(read_source(request.body))
        elif route == "sheets":
            bench.lay_out(read_layout(request.body))
        elif route == "cancel":
            bench.cancel()
        else:
            return refusal(404, "No task starts at this address.")
        return answer(bench.state())


def _catalogue() -> dict[str, Any]:
    """What the page offers."""
    return {
        "version": miurafab.__version__,
        "surfaces": [_surface(entry) for entry in CATALOGUE.values()],
        "steps": STEPS,
        "formats": FORMATS,
        "file_suffixes": (*MESH_SUFFIXES, PACKED, *IMAGE_SUFFIXES, PATTERN_SUFFIX),
        "of_image": OF_IMAGE,
        "file_limit": FILE_LIMIT,
        "defaults": {
            "facets": FACETS.show(DEFAULT_FACETS),
            "size": f"{DEFAULT_SIZE_MM:g}mm",
        },
    }


def _profile(axes: str, surface: TargetSurface) -> dict[str, Any]:
    """Where the drawing of a profile begins: a few points of the surface's own."""
    assert isinstance(surface, Revolution | GeneralizedCylinder)
    return {"axes": axes, "points": surface.profile.evenly(DRAWN_FROM).round(3).tolist()}


def _surface(entry: NamedSurface) -> dict[str, Any]:
    surface, values = make_surface(entry.name, {})
    return {
        "name": entry.name,
        "summary": entry.summary,
        "formulas": [
            {"key": key, "meaning": meaning, "default": values.get(key, "")}
            for key, meaning in entry.formulas.items()
        ],
        "profile": entry.profile_axes and _profile(entry.profile_axes, surface),
        "parameters": [
            {
                "key": key,
                "meaning": parameter.meaning,
                "unit": parameter.kind.unit.strip(),
                "default": f"{parameter.default:g}",
                "low": parameter.kind.low,
                "high": parameter.kind.high,
            }
            for key, parameter in entry.parameters.items()
        ],
        "turned": can_close(surface, values),
    }
