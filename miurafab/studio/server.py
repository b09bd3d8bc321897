"""The server: sockets on one side, :class:`~miurafab.studio.core.Studio` on the other.

It listens on 127.0.0.1 only. The studio answers quickly; long work runs in another process, as does
the session with a machine, which ends dark before anything else when the server ends. Uploads and
results lie in a temporary folder, which is deleted when the server ends.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from miurafab.errors import InputError, PatternError, PortError, TargetError
from miurafab.machine.signals import StopSignals
from miurafab.profiles import find_file
from miurafab.studio.core import Studio
from miurafab.studio.door import Door
from miurafab.studio.guard import ADDRESS, BodyRoom, Guard, new_key
from miurafab.studio.messages import HttpRequest, Response, refusal
from miurafab.studio.session import DESIGN_SUFFIX, PATTERN_SUFFIX, Bench
from miurafab.studio.worker import Process
from miurafab.surfaces.catalogue import make_surface, parse_target
from miurafab.surfaces.mesh_files import mesh_suffix
from miurafab.workflow.cut import GCODE_SUFFIXES
from miurafab.workflow.design import design

_IDLE_S = 60.0
"""An idle connection is closed after this time."""


def serve(
    thing: str | None = None,
    *,
    port: int = 0,
    open_browser: bool = True,
    announce: Callable[[str], None] = print,
) -> None:
    """Serve the page until Ctrl-C, SIGTERM or SIGHUP.

    The page starts with ``thing``: it opens a pattern (.fold), chooses a TARGET, and has a job
    (a job directory, a G-code file) for the machine. ``port`` 0 is
    any free port. ``announce`` is called with the address once the page can be opened. Raises
    :class:`~miurafab.errors.InputError` for a thing that cannot be read, and
    :class:`~miurafab.errors.PortError` for a port that cannot be opened.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"`port` is {port}; it must lie between 0 (any free port) and 65535.")
    with contextlib.ExitStack() as at_end:
        signals = at_end.enter_context(StopSignals())
        at_end.enter_context(contextlib.suppress(KeyboardInterrupt))
        folder = Path(tempfile.mkdtemp(prefix="miurafab-studio-")).resolve()
        at_end.callback(shutil.rmtree, folder, ignore_errors=True)
        bench = Bench(folder, Process)
        own_job = None if thing is None else _own_job(thing)
        first = None if thing is None or own_job is not None else _put_on(bench, thing)
        at_end.callback(bench.cancel)
        at_end.callback(signals.hold)
        server = _Server(port, signals.check)
        at_end.callback(server.server_close)
        guard = Guard(server.server_port, new_key())
        server.studio = Studio(bench, guard, first, own_job=own_job)
        at_end.callback(server.studio.live.stop)
        at_end.callback(server.studio.desk.leave)  # before anything else: the machine is dark
        at_end.callback(signals.hold)
        if thing is not None and first is not None and first.get("open"):
            bench.open(first["source"])
        announce(guard.address)
        if open_browser:
            server.door = Door(guard, folder)
            page = server.door.file.as_uri()
            threading.Thread(target=webbrowser.open, args=(page,), daemon=True).start()
        server.serve_forever(poll_interval=0.1)


def _own_job(thing: str) -> Path | None:
    """The job directory or the G-code file that the command line names, if it names one."""
    path = Path(thing)
    is_job = path.is_dir() or (path.suffix.lower() in GCODE_SUFFIXES and path.is_file())
    return path.resolve() if is_job else None


def _put_on(bench: Bench, thing: str) -> dict[str, Any]:
    """Add what the command line names to the bench. Returns how the page starts."""
    path = Path(thing)
    suffix = path.suffix.lower()
    if suffix == DESIGN_SUFFIX:
        wanted = design(thing)
        found = find_file("patterns", thing, error=TargetError)
        source = bench.add_own(found, "design")
        return {"source": source.id, "machine": wanted.machine, "material": wanted.material}
    if suffix == PATTERN_SUFFIX or mesh_suffix(path):
        if not path.is_file():
            error = PatternError if suffix == PATTERN_SUFFIX else TargetError
            raise error(f"{path} does not exist.")
        kind = "pattern" if suffix == PATTERN_SUFFIX else "mesh"
        return {"source": bench.add_own(path, kind).id, "open": kind == "pattern"}
    name, parameters = parse_target(thing)
    make_surface(name, parameters)
    return {"surface": name, "parameters": parameters}


class _Server(ThreadingHTTPServer):
    """Listens on this computer only, and looks no name up."""

    daemon_threads = True
    allow_reuse_address = os.name == "posix"  # elsewhere other servers could share the port
    studio: Studio
    door: Door | None = None
    room: BodyRoom

    def __init__(self, port: int, check: Callable[[], None]) -> None:
        self.room = BodyRoom()
        self._check = check
        try:
            super().__init__((ADDRESS, port), _Handler)
        except OSError as fault:
            raise PortError(
                f"Cannot listen on port {port}: {fault.strerror or fault}; choose another "
                "`port`, or leave it out."
            ) from None

    def server_bind(self) -> None:
        # HTTPServer would look up the name of this computer, which can take seconds
        socket.socket.bind(self.socket, self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = ADDRESS, self.server_address[1]

    def service_actions(self) -> None:
        """Several times a second: raise again a signal whose exception was lost."""
        self._check()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print other faults than that the browser closed the connection, each in one line."""
        fault = sys.exc_info()[1]
        if not isinstance(fault, ConnectionError | TimeoutError):
            sys.stderr.write(f"miurafab: a request failed ({type(fault).__name__}: {fault}).\n")


class _Handler(BaseHTTPRequestHandler):
    """Reads requests one after another, has the studio answer them, and writes the answers."""

    protocol_version = "HTTP/1.1"
    timeout = _IDLE_S
    server: _Server

    def do_GET(self) -> None:
        self._answer()

    do_HEAD = do_POST = do_PUT = do_DELETE = do_OPTIONS = do_PATCH = do_GET

    def version_string(self) -> str:
        return "miurafab-studio"

    def log_message(self, format: str, *args: Any) -> None:
        """Log no request."""

    def _answer(self) -> None:
        headers: dict[str, str] = {}
        for name, value in self.headers.items():  # one that comes twice is no name, key or length
            key = name.lower()
            headers[key] = f"{headers[key]}, {value}" if key in headers else value
        studio, door = self.server.studio, self.server.door
        opened = None if door is None else door.answer(self.command, self.path, headers)
        if opened is not None:
            self._send(opened)
            return
        refused = studio.guard.refuse(self.command, self.path, headers)
        if refused is not None:
            self.close_connection = True  # its body, if any, is not read
            self._send(refused)
            return
        if self.command == "POST":
            wanted = int(headers["content-length"])
            with self.server.room.kept(wanted) as there:
                body = self.rfile.read(wanted) if there else b""
                if len(body) == wanted:
                    self._handle(headers, body)
                    return
            self.close_connection = True
            if not there:
                self._send(refusal(503, "Too much is being sent at once; try again in a moment."))
            return
        self._handle(headers, b"")

    def _handle(self, headers: dict[str, str], body: bytes) -> None:
        studio = self.server.studio
        self._send(studio.handle(HttpRequest(self.command, self.path, headers, body)))

    def _send(self, response: Response) -> None:
        body = response.body
        if isinstance(body, Path):
            try:
                body = body.read_bytes()
            except OSError:  # a newer result has just replaced it
                response = refusal(404, "There is nothing at this address any more.")
                body = response.body
        assert isinstance(body, bytes)
        self.send_response(response.status)
        for name, value in response.all_headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)
