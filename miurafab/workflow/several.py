"""Several machines share the sheets of one job: each takes the next sheet when it has none.

Every sheet is cut by a process of its own (``miurafab cut --watched``), so that nothing that
happens at one machine can disturb another. A machine that fails is given no more sheets; the sheet
it was at is left as it is, to be looked at and resumed there, and the others cut what is left.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from miurafab.errors import InputError, JobStopped
from miurafab.machine.watchdog import BEAT_S
from miurafab.workflow.cut import Prepared
from miurafab.workflow.cut_sheets import CutOptions


@dataclass(frozen=True)
class Shared:
    """What became of ``sheet``: the ``port`` it went to (empty: none was left), and why not."""

    sheet: str
    port: str
    done: bool
    why: str


def share_sheets(
    prepared: Prepared,
    ports: Sequence[str],
    sheets: Sequence[int] | None,
    options: CutOptions,
    *,
    on_progress: Callable[[float, str], None],
) -> tuple[Shared, ...]:
    """Cut the sheets of a job directory on the machines at ``ports``; in order of the sheets.

    ``on_progress`` is called with the fraction done and a note when a sheet is done or failed. A
    machine that fails is part of the answer. Raises :class:`~miurafab.errors.InputError` for what
    cannot be shared, :class:`~miurafab.errors.JobStopped` after Ctrl-C, with every machine reset.
    """
    if prepared.directory is None:
        raise InputError(
            f"{prepared.name} is no job directory, so machines cannot share it; make one with "
            "'miurafab sheets'."
        )
    if options.resume or options.frame:
        raise InputError("Resume and frame on one machine at a time: give one --port.")
    twice = {port for port in ports if ports.count(port) > 1 and port != "virtual"}
    if twice:
        raise InputError(f"The port {min(twice)} is named twice.")
    chosen = list(sheets) if sheets else list(range(1, len(prepared.jobs) + 1))
    for number in chosen:
        if not 1 <= number <= len(prepared.jobs):
            raise InputError(f"{prepared.name} has no sheet {number}; it has {len(prepared.jobs)}.")
    work = _Work(prepared, options, chosen, on_progress)
    threads = [threading.Thread(target=work.at_machine, args=(port,)) for port in ports]
    for thread in threads:
        thread.start()
    try:
        for thread in threads:
            while thread.is_alive():
                thread.join(BEAT_S / 10)
    except KeyboardInterrupt:
        work.stop.set()
        for thread in threads:
            thread.join()
        raise JobStopped(f"{prepared.name} was stopped by Ctrl-C on every machine.") from None
    names = {number: prepared.dry_runs[number - 1].name for number in chosen}
    return tuple(
        work.outcome.get(number)
        or Shared(names[number], "", False, "no machine was left to cut it")
        for number in chosen
    )


class _Work:
    def __init__(
        self,
        prepared: Prepared,
        options: CutOptions,
        chosen: list[int],
        on_progress: Callable[[float, str], None],
    ) -> None:
        self.stop = threading.Event()
        self.outcome: dict[int, Shared] = {}
        self._prepared = prepared
        self._options = options
        self._left = deque(chosen)
        self._count = len(chosen)
        self._on_progress = on_progress

    def at_machine(self, port: str) -> None:
        """Cut sheets at ``port`` until none is left, or the machine has failed."""
        at = self._options.at
        while not self.stop.is_set():
            try:
                number = self._left.popleft()
            except IndexError:
                return
            sheet = self._prepared.dry_runs[number - 1]
            why = self._cut(port, number, at)
            self.outcome[number] = Shared(sheet.name, port, not why, why)
            note = f"{sheet.name} at {port} {'failed' if why else 'is done'}"
            self._on_progress(len(self.outcome) / self._count, note)
            if why:
                return
            if at is not None and len(sheet.program):
                at = (float(sheet.program.end[-1, 0]), float(sheet.program.end[-1, 1]))

    def _cut(self, port: str, number: int, at: tuple[float, float] | None) -> str:
        """Cut one sheet in a process of its own; why that failed, or nothing."""
        process = subprocess.Popen(
            self._command(port, number, at),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert process.stdin is not None
        assert process.stdout is not None
        while True:
            try:
                process.wait(BEAT_S / 4)
                break
            except subprocess.TimeoutExpired:
                with contextlib.suppress(OSError, ValueError):
                    if self.stop.is_set():
                        process.stdin.close()
                    else:
                        process.stdin.write(b".")
                        process.stdin.flush()
        said = process.stdout.read()
        process.stdout.close()
        with contextlib.suppress(OSError):
            process.stdin.close()
        if process.returncode == 0:
            return ""
        try:
            return str(json.loads(said)["error"])
        except (ValueError, KeyError, TypeError):
            return f"its process ended with code {process.returncode}"

    def _command(self, port: str, number: int, at: tuple[float, float] | None) -> list[str]:
        options = self._options
        assert self._prepared.directory is not None
        command = [sys.executable, "-m", "miurafab", "cut", str(self._prepared.directory.path)]
        command += ["--port", port, "--sheet", str(number), "--watched", "--json", "--no-pause"]
        command += ["--machine", self._machine()]
        for name in sorted(options.force):
            command += ["--force", name]
        if at is not None:
            command += ["--at", f"{at[0]}mm,{at[1]}mm"]
        flags = {
            "--allow-m3": options.allow_m3,
            "--check-mode": options.check_mode,
            "--home": options.home,
        }
        return command + [flag for flag, wanted in flags.items() if wanted]

    def _machine(self) -> str:
        """The profile by its name, or by its file in the job directory."""
        assert self._prepared.directory is not None
        own = self._prepared.directory.path / f"{self._prepared.machine.name}.toml"
        return str(own) if own.is_file() else self._prepared.machine.name
