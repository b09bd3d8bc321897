"""The server: sockets on one side, :class:`~miurafab.studio.core.Studio` on the other.

It listens on 127.0.0.1 only, or, where it is asked to, over TLS at one address that other computers
reach. The studio answers quickly; long work runs in another process, as does
the session with a machine, which ends dark before anything else when the server ends. Uploads and
results lie in a temporary folder, which is deleted when the server ends.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import socket
import ssl
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from miurafab.errors import InputError, PatternError, PortError, TargetError
from miurafab.machine.signals import StopSignals
from miurafab.profiles import find_file, read_toml
from miurafab.studio.certificate import tls_of
from miurafab.studio.connections import (
    ANSWER_S,
    IDLE_S,
    STRANGER_S,
    Connections,
    LimitedHead,
)
from miurafab.studio.core import Studio
from miurafab.studio.door import Door
from miurafab.studio.entrance import Entrance
from miurafab.studio.form import LAYOUT
from miurafab.studio.guard import ADDRESS, BodyRoom, Guard, new_key
from miurafab.studio.hosting import Hosting, ServingPlace, place_of
from miurafab.studio.messages import HttpRequest, Response, refusal
from miurafab.studio.password import PasswordLock
from miurafab.studio.session import Bench
from miurafab.studio.source import DESIGN_SUFFIX, PATTERN_SUFFIX
from miurafab.studio.worker import Process
from miurafab.surfaces.catalogue import make_surface, parse_target
from miurafab.surfaces.mesh_files import mesh_suffix
from miurafab.surfaces.profile_files import read_profile
from miurafab.workflow.cut import GCODE_SUFFIXES
from miurafab.workflow.design import design
from miurafab.workflow.image_targets import image_named


def serve(
    thing: str | None = None,
    *,
    port: int = 0,
    open_browser: bool = True,
    hosting: Hosting | None = None,
    announce: Callable[[str, str], None] = print,
) -> None:
    """Serve the page until Ctrl-C, SIGTERM or SIGHUP.

    The page starts with ``thing``: it opens a pattern (.fold), chooses a TARGET, and has a job
    (a job directory, a G-code file) for the machine. ``port`` 0 is
    any free port. With ``hosting`` other computers reach it, and no browser is opened here.
    ``announce`` is called once the page can be opened, with the address and the fingerprint of the
    certificate, which is empty without one. Raises
    :class:`~miurafab.errors.InputError` for a thing that cannot be read and a host that cannot be
    served, and :class:`~miurafab.errors.PortError` for a port that cannot be opened.
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
        place = None if hosting is None else place_of(hosting.host)
        server = _Server(port, signals.check, place)
        at_end.callback(server.server_close)
        guard, known = _watched(server, hosting, place)
        server.studio = Studio(bench, guard, first, own_job=own_job)
        at_end.callback(server.studio.live.stop)
        at_end.callback(server.studio.sight.stop)
        at_end.callback(server.studio.desk.leave)  # before anything else: the machine is dark
        at_end.callback(signals.hold)
        if thing is not None and first is not None and first.get("open"):
            bench.open(first["source"])
        announce(guard.address if hosting is None else guard.outside, known)
        if open_browser and hosting is None:
            server.door = Door(guard, folder)
            page = server.door.file.as_uri()
            threading.Thread(target=webbrowser.open, args=(page,), daemon=True).start()
        server.serve_forever(poll_interval=0.1)


def _watched(
    server: _Server, hosting: Hosting | None, place: ServingPlace | None
) -> tuple[Guard, str]:
    """The guard of ``server``, and the fingerprint of its certificate, if it has one."""
    if hosting is None or place is None:
        return Guard(server.server_port, new_key()), ""
    server.tls, known = tls_of(hosting)
    guard = Guard(server.server_port, new_key(), place.names, "https")
    server.entrance = Entrance(guard, PasswordLock(hosting.password))
    return guard, known


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
        laid = read_toml(found, TargetError).get("layout", {})
        given = {name: value for name, value in laid.items() if name in LAYOUT}
        on = {"machine": wanted.machine, "material": wanted.material, "layout": given}
        return {"source": source.id, **on}
    if suffix == PATTERN_SUFFIX or mesh_suffix(path):
        if not path.is_file():
            error = PatternError if suffix == PATTERN_SUFFIX else TargetError
            raise error(f"{path} does not exist.")
        kind = "pattern" if suffix == PATTERN_SUFFIX else "mesh"
        return {"source": bench.add_own(path, kind).id, "open": kind == "pattern"}
    image = image_named(thing)
    if image is not None:
        design(thing)
        return {"source": bench.add_own(image[0], "image").id, "parameters": image[1]}
    name, parameters = parse_target(thing)
    profile = parameters.pop("profile", None)
    drawn = {} if profile is None else {"profile": read_profile(Path(profile))}
    make_surface(name, parameters | drawn)
    return {"surface": name, "parameters": parameters, **drawn}


class _Server(ThreadingHTTPServer):
    """Listens at one place only, and looks no name up."""

    daemon_threads = True
    allow_reuse_address = os.name == "posix"  # elsewhere other servers could share the port
    studio: Studio
    door: Door | None = None
    entrance: Entrance | None = None
    tls: ssl.SSLContext | None = None
    room: BodyRoom

    def __init__(
        self, port: int, check: Callable[[], None], place: ServingPlace | None = None
    ) -> None:
        self.room = BodyRoom()
        self.connections = Connections(bounded=place is not None)
        self._check = check
        self.address_family = socket.AF_INET if place is None else place.family
        address = ADDRESS if place is None else place.address
        try:
            super().__init__((address, port), _Handler)
        except OSError as fault:
            reason = fault.strerror or fault
            if place is not None and fault.errno == errno.EADDRNOTAVAIL:
                raise InputError(
                    f"`host` is {place.names[0]}, which is no address of this computer."
                ) from None
            raise PortError(
                f"Cannot listen on port {port}: {reason}; choose another `port`, or leave it out."
            ) from None

    def server_bind(self) -> None:
        # HTTPServer would look up the name of this computer, which can take seconds
        socket.socket.bind(self.socket, self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = str(self.server_address[0]), self.server_address[1]

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Shut at once what is beyond the bound."""
        return self.connections.has_room(client_address[0])

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Serve one connection to its end, in its own thread; the handshake is a part of it."""
        wire = request
        if self.tls is not None:
            request.settimeout(STRANGER_S)
            wire = self.tls.wrap_socket(request, server_side=True, do_handshake_on_connect=False)
        self.connections.add(wire, client_address[0])
        try:
            if isinstance(wire, ssl.SSLSocket):
                wire.do_handshake()
            super().finish_request(wire, client_address)
        finally:
            self.connections.remove(wire)
            if wire is not request:
                self.shutdown_request(wire)

    def shutdown_request(self, request: Any) -> None:
        """As the base; the plain end also for TLS, which would wait for the peer's."""
        with contextlib.suppress(OSError):
            socket.socket.shutdown(request, socket.SHUT_WR)
        self.close_request(request)

    def service_actions(self) -> None:
        """Several times a second: raise again a signal whose exception was lost, and shut the
        connections that are late.
        """
        self._check()
        self.connections.shut_late()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print other faults than that the browser closed the connection, or would not have its
        certificate, each in one line.
        """
        fault = sys.exc_info()[1]
        if not isinstance(fault, ConnectionError | TimeoutError | ssl.SSLError):
            sys.stderr.write(f"miurafab: a request failed ({type(fault).__name__}: {fault}).\n")


class _Handler(BaseHTTPRequestHandler):
    """Reads requests one after another, has the studio answer them, and writes the answers."""

    protocol_version = "HTTP/1.1"
    timeout = IDLE_S
    server: _Server

    def setup(self) -> None:
        super().setup()
        self._head = LimitedHead(self.rfile)
        self.rfile = self._head

    def handle_one_request(self) -> None:
        self._head.begin()
        super().handle_one_request()

    def do_GET(self) -> None:
        self._answer()

    do_HEAD = do_POST = do_PUT = do_DELETE = do_OPTIONS = do_PATCH = do_GET

    def version_string(self) -> str:
        return "miurafab-studio"

    def log_message(self, format: str, *args: Any) -> None:
        """Log no request."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse what is no request that can be read, as everything else is refused."""
        self.close_connection = True
        self._send(refusal(code, f"The request cannot be read: {HTTPStatus(code).phrase.lower()}."))

    def _answer(self) -> None:
        headers: dict[str, str] = {}
        for name, value in self.headers.items():  # one that comes twice is no name, key or length
            key = name.lower()
            headers[key] = f"{headers[key]}, {value}" if key in headers else value
        studio, door, entrance = self.server.studio, self.server.door, self.server.entrance
        if entrance is not None and entrance.takes(self.path):
            self._with_body(
                entrance.refuse(self.command, self.path, headers),
                headers,
                lambda body: entrance.answer(self.path, body, self.client_address[0]),
            )
            return
        opened = None if door is None else door.answer(self.command, self.path, headers)
        if opened is not None:
            self._send(opened)
            return
        refused = studio.guard.refuse(self.command, self.path, headers)
        if refused is None:
            self._has_time(ANSWER_S)
        self._with_body(
            refused,
            headers,
            lambda body: studio.handle(HttpRequest(self.command, self.path, headers, body)),
        )
        if refused is None:
            self._has_time(IDLE_S)

    def _has_time(self, seconds: float) -> None:
        self.server.connections.more_time(self.connection, seconds)

    def _with_body(
        self,
        refused: Response | None,
        headers: Mapping[str, str],
        answered: Callable[[bytes], Response],
    ) -> None:
        """Send the refusal of a request; or read its body, and send the answer."""
        if refused is not None:
            self.close_connection = True  # its body, if any, is not read
            self._send(refused)
            return
        if self.command != "POST":
            self._send(answered(b""))
            return
        wanted = int(headers["content-length"])
        with self.server.room.kept(wanted) as there:
            body = self.rfile.read(wanted) if there else b""
            if len(body) == wanted:
                self._send(answered(body))
                return
        self.close_connection = True
        if not there:
            self._send(refusal(503, "Too much is being sent at once; try again in a moment."))

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
