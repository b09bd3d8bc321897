"""The state of the studio: the files it was given, one task at a time, and the results.

Nothing else in the studio has state. It changes by orders of the page and by news of the task.
Results lie in one folder. They are found by the names recorded here, never by a path from the
browser.
"""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from miurafab.errors import InputError
from miurafab.files import write_bytes
from miurafab.origami.fitting.request import BED
from miurafab.studio import recipe
from miurafab.studio.form import LABELS, by_label
from miurafab.studio.names import safe_stem, suffix_of
from miurafab.studio.orders import FitOrder, LayoutOrder
from miurafab.studio.source import PATTERN_SUFFIX, Source, kind_of, require_stock
from miurafab.studio.work import Order
from miurafab.studio.worker import News, Running
from miurafab.surfaces.height_field import IMAGE_SUFFIXES
from miurafab.surfaces.mesh_files import MESH_SUFFIXES, PACKED
from miurafab.workflow.report_text import headline, layout_lines, pattern_lines

_IN_MM = {"min_edge", "max_deviation", "max_distance"}
"""Options that depend on the size of a sheet."""
_KEPT = 8
"""The number of uploads kept; a further one removes the oldest."""


@dataclass
class Task:
    """The running task, or the last one."""

    order: Order
    id: str
    running: Running | None
    fraction: float = 0.0
    note: str = ""
    error: str = ""
    cancelled: bool = False
    began: float = field(default_factory=time.monotonic)


@dataclass(frozen=True)
class Asked:
    """The order for the pattern on the bench. ``target`` is as in a design file, None where a
    design file cannot state it; ``file`` is the pattern's name in command lines. ``form`` is the
    order as the page sent it, ``subject`` the same in words.
    """

    command: str
    file: str
    form: Mapping[str, Any]
    subject: str
    target: Mapping[str, str] | None = None
    options: Mapping[str, recipe.Value] = field(default_factory=dict)
    layout: LayoutOrder | None = None


class Bench:
    """The state of one studio in its own ``folder``; ``start`` starts an order."""

    def __init__(self, folder: Path, start: Callable[[Order], Running]) -> None:
        self.sources: dict[str, Source] = {}
        self.files: dict[tuple[str, str], Path] = {}
        self.task: Task | None = None
        self.pattern: dict[str, Any] | None = None
        self.job: dict[str, Any] | None = None
        self._folder = folder
        self._own = re.compile(re.escape(str(folder)) + r"[/\\][0-9]+[/\\]")
        self.start = start
        self._numbers = 0
        self._asked: Asked | None = None
        self._coming: Asked | None = None
        self._report: Mapping[str, Any] = {}

    def add_upload(self, name: str, content: bytes) -> Source:
        """Keep an uploaded file. Raises :class:`~miurafab.errors.InputError`."""
        suffix = suffix_of(name)
        kind = kind_of(Path(f"file{suffix}"))
        kind = "stock" if kind == "design" else kind  # the browser sends no designs
        if kind is None:
            known = ", ".join((*MESH_SUFFIXES, PACKED, *IMAGE_SUFFIXES, PATTERN_SUFFIX))
            raise InputError(f"'{name[-60:]}' cannot be opened here; known files are {known}.")
        if not content:
            raise InputError(f"'{name[-60:]}' is empty.")
        held = [source for source in self.sources.values() if not source.ours]
        for old in held[: max(0, len(held) - _KEPT + 1)]:
            del self.sources[old.id]
            shutil.rmtree(old.path.parent)
        number = self._number()
        file = f"{safe_stem(name)}{suffix}"
        path = self._new_folder(number) / file
        write_bytes(path, content)
        if kind == "stock":
            require_stock(path)
        return self._keep(Source(number, kind, path, file))

    def add_own(self, path: Path, kind: str) -> Source:
        """Keep a file that the command line names."""
        return self._keep(Source(self._number(), kind, path, str(path), ours=True))

    def fit(self, asked: FitOrder) -> None:
        """Start a fit. Raises :class:`~miurafab.errors.InputError` while another task runs, but
        for the one that it replaces: that is ended.
        """
        target = self.target_of(asked)  # refused before anything is ended
        if self.task is not None and self.task.id == asked.replaces:
            self.cancel()
        self._check_idle()
        source = self.source_of(asked)
        if source is None:
            assert asked.surface is not None
            shown, name = asked.target, asked.surface
            described: Mapping[str, str] | None = {"surface": name, **asked.parameters}
            words = name
        else:
            shown, name = asked.on(source.shown), source.name
            of_file = {source.kind: source.shown, **asked.parameters}
            described = None if source.kind == "design" else of_file
            words = source.path.name
        self._coming = Asked(
            recipe.fit_command(shown, asked.options, name),
            f"{name}.fold",
            asked.as_dict(),
            recipe.subject(words, asked.parameters, asked.options, LABELS),
            described,
            asked.options,
        )
        self._begin("fit", name, target=target, options=asked.options)

    def source_of(self, asked: FitOrder) -> Source | None:
        """The file of a fit, None where it has none. Raises as :meth:`target_of`."""
        if asked.source is None:
            return None
        source = self._source(asked.source, ("mesh", "image", "design"))
        if asked.parameters and source.kind != "image":
            raise InputError("Only an image of heights has parameters.")
        return source

    def target_of(self, asked: FitOrder) -> str:
        """The target of a fit as the verbs take it. Raises ``InputError`` for a file that is gone
        or cannot be fitted.
        """
        source = self.source_of(asked)
        return asked.target if source is None else asked.on(str(source.path))

    def scaled_from(self, asked: FitOrder) -> tuple[Path, Mapping[str, Any]] | None:
        """The file and the report of the pattern on the bench, if ``asked`` asks for the same at
        another size in mm, on which nothing else depends; else None.
        """
        form = asked.as_dict()
        before = {} if self._asked is None else self._asked.form
        if self.pattern is None or form["target"] != before.get("target"):
            return None
        now, then = ({**each["options"]} for each in (form, before))
        sizes = now.pop("size", BED), then.pop("size", BED)
        linear = BED not in sizes and not set(now) & _IN_MM and now == then
        good = self.pattern["status"] == "converged" and "fold" in self.pattern["files"]
        return (self.pattern_file(), self._report) if linear and good else None

    def pattern_file(self) -> Path:
        """The file of the pattern on the bench. Raises ``InputError`` if there is none."""
        if self.pattern is None or "fold" not in self.pattern["files"]:
            raise InputError("There is no pattern to lay out yet; fit or open one first.")
        return self.files[self.pattern["id"], f"{self.pattern['name']}.fold"]

    def open(self, source_id: str) -> None:
        """Start to open a pattern. Raises as :meth:`fit`."""
        self._check_idle()
        source = self._source(source_id, ("pattern",))
        form = {"source": source_id}
        self._coming = Asked(
            recipe.check_command(source.shown), source.shown, form, source.path.name
        )
        self._begin("open", source.name, file=source.path, ours=source.ours)

    def lay_out(self, asked: LayoutOrder) -> None:
        """Start to lay out the pattern on the bench. Raises as :meth:`fit`."""
        self._check_idle()
        file = self.pattern_file()
        assert self.pattern is not None
        assert self._asked is not None
        self._coming = replace(self._asked, layout=asked)
        self._begin(
            "sheets",
            self.pattern["name"],
            file=file,
            machine=asked.machine,
            material=asked.material,
            options=self.laid_by(asked),
            formats=asked.formats,
        )

    def laid_by(self, asked: LayoutOrder, *, shown: bool = False) -> dict[str, recipe.Value]:
        """The options of a layout with the file of its stock, or its name as it is ``shown``."""
        if not asked.stock:
            return {**asked.options}
        stock = self._source(asked.stock, ("stock",))
        return {**asked.options, "stock": stock.shown if shown else str(stock.path)}

    def cancel(self) -> None:
        """End the task; earlier results and finished parts stay."""
        if self.task is not None and self.task.running is not None:
            self.task.running.stop()
            self.take_in()
            self.task.running, self.task.cancelled, self.task.error = None, True, ""
            self._settle()

    def take_in(self) -> None:
        """Take in the news of the task."""
        task = self.task
        if task is None or task.running is None:
            return
        for said in task.running.news():
            if "progress" in said:
                task.fraction = max(task.fraction, said["progress"])
                task.note = said["note"]
            elif "part" in said:
                self._take_part(task, said)
            else:
                task.error = self.plain(said.get("error", ""))
                task.running.stop()
                task.running = None
                self._settle()
                return

    def job_folder(self) -> Path | None:
        """The job directory of the last layout, if there is one."""
        if self.job is None:
            return None
        return self._folder / str(self.job["id"]) / str(self.job["name"])

    def design_text(self) -> str | None:
        """The design file of the pattern on the bench, None if it can have none."""
        asked = self._asked
        if self.pattern is None or asked is None or asked.target is None:
            return None
        layout: dict[str, Any] = {}
        if asked.layout is not None:
            layout = {"machine": asked.layout.machine, "material": asked.layout.material}
            layout |= self.laid_by(asked.layout, shown=True)
        return recipe.design_text(self.pattern["name"], asked.target, asked.options, layout)

    def state(self) -> dict[str, Any]:
        """All that the page shows."""
        task = self.task
        return {
            "sources": [
                {"id": s.id, "kind": s.kind, "name": s.path.name} for s in self.sources.values()
            ],
            "task": task
            and {
                "id": task.id,
                "kind": task.order.do,
                "running": task.running is not None,
                "fraction": task.fraction,
                "note": task.note,
                "seconds": round(time.monotonic() - task.began, 1),
                "error": task.error,
                "cancelled": task.cancelled,
                "form": self._coming and self._coming.form,
            },
            "pattern": self.pattern,
            "job": self.job,
        }

    def _take_part(self, task: Task, part: News) -> None:
        if part["part"] == "pattern":
            self._new_pattern(task, part)
        elif part["part"] == "motion":
            assert self.pattern is not None
            self.pattern["files"] |= self._put_down(task.id, part.get("files", {}))
            self.pattern["findings"] += self.plain_findings(part.get("findings", []))
            self.pattern |= {"folding": False, "still": part.get("missing", "")}
        else:
            self._new_job(task, part)

    def _new_pattern(self, task: Task, part: News) -> None:
        self._forget(self.job)
        self._forget(self.pattern)
        self.job, self._asked = None, self._coming
        assert self._asked is not None
        report = self._report = part["report"]
        opened = task.order.do == "open"
        self.pattern = {
            "id": task.id,
            "name": task.order.name,
            "status": report["status"],
            "headline": headline(report["status"], opened=opened),
            "advice": self.plain(report["advice"]),
            "seams": bool(report.get("seam_mm")),
            "lines": pattern_lines(report),
            "findings": self.plain_findings(part.get("findings", [])),
            "files": self._put_down(task.id, part["files"]),
            "folding": bool(part["files"]),
            "still": "",
            "has_design": self._asked.target is not None,
            "command": self._asked.command,
            "form": self._asked.form,
            "subject": self._asked.subject,
        }

    def _new_job(self, task: Task, part: News) -> None:
        self._forget(self.job)
        self._asked = self._coming
        assert self._asked is not None
        assert self._asked.layout is not None
        layout, name = self._asked.layout, task.order.name
        sheets = recipe.sheets_command(
            self._asked.file, name, layout, self.laid_by(layout, shown=True)
        )
        pictures = {str(n): file for n, file in enumerate(part["pictures"])}
        self.job = {
            "id": task.id,
            "name": recipe.job_name(name),
            "lines": layout_lines(part["totals"]),
            "doubts": self._doubts(),
            "findings": self.plain_findings(part.get("findings", [])),
            "files": self._put_down(task.id, part["files"]),
            "every": self._put_down(task.id, {file: file for file in part["every"]}),
            "pictures": list(self._put_down(task.id, pictures).values()),
            "command": recipe.both(self._asked.command, sheets, sound=not self._doubts()),
            "cut": recipe.cut_command(name),
        }

    def _doubts(self) -> list[str]:
        """What was wrong with the pattern before it was laid out."""
        if self.pattern is None or self.pattern["status"] == "converged":
            return []
        return [f"{self.pattern['headline']} {self.pattern['advice']}".strip()]

    def plain_findings(self, findings: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """``findings`` in the words of :meth:`plain`."""
        return [{**each, "sentence": self.plain(each["sentence"])} for each in findings]

    def plain(self, sentence: str) -> str:
        """``sentence`` with files of the studio's folder named without a path, and options named
        by the labels of their fields.
        """
        return by_label(self._own.sub("", sentence))

    def _begin(self, do: str, name: str, **what: Any) -> None:
        number = self._number()
        order = Order(do, self._new_folder(number), name, **what)
        self.task = Task(order, number, self.start(order))

    def _settle(self) -> None:
        """Stop waiting for a folding that will not come, and delete a folder without results."""
        assert self.task is not None
        if self.pattern is not None and self.pattern["folding"]:
            self.pattern |= {"folding": False, "still": "The folding was not computed."}
        shown = [each["id"] for each in (self.pattern, self.job) if each is not None]
        if self.task.id not in shown:
            shutil.rmtree(self.task.order.folder, ignore_errors=True)

    def _check_idle(self) -> None:
        self.take_in()
        if self.task is not None and self.task.running is not None:
            raise InputError("A task is running already; wait for it or cancel it.")

    def _source(self, source_id: str, kinds: tuple[str, ...]) -> Source:
        source = self.sources.get(source_id)
        if source is None or source.kind not in kinds:
            raise InputError("That file is gone; choose it again.")
        return source

    def _put_down(self, number: str, files: Mapping[str, str]) -> dict[str, str]:
        """Record where computed ``files`` are. Returns their addresses."""
        folder = self._folder / number
        self.files |= {(number, name): folder / name for name in files.values()}
        return {what: f"files/{number}/{name}" for what, name in files.items()}

    def _forget(self, shown: Mapping[str, Any] | None) -> None:
        if shown is not None:
            self.files = {key: path for key, path in self.files.items() if key[0] != shown["id"]}
            shutil.rmtree(self._folder / shown["id"], ignore_errors=True)

    def _keep(self, source: Source) -> Source:
        self.sources[source.id] = source
        return source

    def _number(self) -> str:
        self._numbers += 1
        return str(self._numbers)

    def _new_folder(self, number: str) -> Path:
        folder = self._folder / number
        folder.mkdir()
        return folder
