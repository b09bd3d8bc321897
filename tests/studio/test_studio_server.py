"""The whole program over loopback: what it gives out, how it ends, and who cannot get in."""

import contextlib
import http.client
import io
import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from studios import saddle_obj

from miurafab.cli.program import run as run_command
from miurafab.errors import InputError, PatternError, PortError, TargetError
from miurafab.studio.server import serve

MINIATURE = {"surface": "hypar", "parameters": {"height": "0.4"}}


class Page:
    """What a browser does, with nothing in between: the key and the origin with every request."""

    def __init__(self, address):
        parts = urlsplit(address)
        self.port, self.path = parts.port, parts.path
        self.headers = {"Origin": f"http://127.0.0.1:{parts.port}"}
        self.headers["X-Studio-Key"] = parts.path.strip("/")

    def ask(self, method, route, body=None, **headers):
        content = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        wire = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        with contextlib.closing(wire):
            wire.request(method, self.path + route, content, {**self.headers, **named})
            answer = wire.getresponse()
            return answer.status, answer.read()

    def get(self, route):
        status, content = self.ask("GET", route)
        assert status == 200, content
        return content

    def post(self, route, body, **headers):
        status, content = self.ask("POST", route, body, **headers)
        assert status == 200, content
        return json.loads(content)

    def finished(self, seconds=120):
        """The state when nothing is being done any more."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            state = json.loads(self.get("state"))
            if not state["task"]["running"]:
                assert state["task"]["error"] == ""
                return state
            time.sleep(0.05)
        raise AssertionError("it never ended")


class Program:
    """``miurafab studio``, with its temporary files in a place that can be looked at."""

    def __init__(self, folder, *arguments):
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-m", "miurafab", "studio", "--no-browser", "--json", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder.parent,
            env={**os.environ, "TMPDIR": str(folder), "TEMP": str(folder)},
        )
        said = ""
        while not said.rstrip().endswith("}"):
            line = self.process.stdout.readline()
            assert line, self.process.stderr.read()
            said += line
        self.address = json.loads(said)["address"]

    def end(self, number=signal.SIGINT):
        self.process.send_signal(number)
        rest, errors = self.process.communicate(timeout=30)
        assert rest == ""  # with --json one object, nothing else
        return self.process.returncode, errors


@pytest.fixture
def start(tmp_path):
    folder = tmp_path / "temporary"
    folder.mkdir()
    with contextlib.ExitStack() as at_end:

        def begin(*arguments):
            program = Program(folder, *arguments)
            at_end.enter_context(program.process)
            at_end.callback(program.process.kill)
            return program

        yield begin


def run(folder, command):
    """A command line as the page shows it, in this process."""
    words = shlex.split(command)
    assert words[0] == "miurafab"
    with contextlib.chdir(folder):
        assert run_command([*words[1:], "--quiet"], serve_studio=serve) == 0


def test_the_page_writes_what_the_commands_that_it_shows_write(start, tmp_path):
    """Every file of the job, byte for byte; and Ctrl-C leaves nothing behind."""
    program = start()
    page = Page(program.address)
    assert b"<h1>miurafab" in page.get("")
    options = {"facets": "6x6", "size": "300mm", "min_edge": "4mm"}
    page.post("fit", {"target": MINIATURE, "options": options})
    pattern = page.finished()["pattern"]
    assert pattern["status"] == "converged"
    chosen = {"bridges": "2", "full_facet": True, "gap": "3mm", "max_patch": "380mmx300mm"}
    page.post("sheets", {"machine": "grbl-laser-400", "material": "paper-100", "options": chosen})
    job = page.finished()["job"]
    fold = page.get(pattern["files"]["fold"])
    with zipfile.ZipFile(io.BytesIO(page.get(job["files"]["zip"]))) as archive:
        packed = {name: archive.read(name) for name in archive.namelist()}

    for command in job["command"].split(" && "):
        run(tmp_path, command)
    made = {
        f"hypar-job/{path.name}": path.read_bytes() for path in (tmp_path / job["name"]).iterdir()
    }
    assert len(made) > 6
    assert any(name.endswith("sheet-02.nc") for name in made)
    assert packed == made
    assert (tmp_path / "hypar.fold").read_bytes() == fold

    design = tmp_path / "again.toml"
    design.write_bytes(page.get("design.toml"))
    run(tmp_path, "miurafab fit again.toml -o again.fold")
    again, first = (json.loads((tmp_path / f"{n}.fold").read_text()) for n in ("again", "hypar"))
    assert again["vertices_coords"] == first["vertices_coords"]

    assert program.end() == (0, "")
    assert list(program.folder.iterdir()) == []


def test_a_mesh_gives_the_same_pattern_as_the_command(start, tmp_path):
    program = start()
    page = Page(program.address)
    content = saddle_obj()
    source = page.post("upload", content, X_File_Name="saddle.obj")["source"]
    page.post("fit", {"target": {"source": source}, "options": {"facets": "6x6"}})
    pattern = page.finished()["pattern"]
    (tmp_path / "saddle.obj").write_bytes(content)
    run(tmp_path, pattern["command"])
    assert page.get(pattern["files"]["fold"]) == (tmp_path / "saddle.fold").read_bytes()
    assert program.end(signal.SIGTERM) == (0, "")


def test_a_pattern_named_on_the_command_line_is_opened(start, tmp_path):
    run(tmp_path, "miurafab fit plane --facets 4x4 -o 'my plane.fold'")
    page = Page(start("my plane.fold").address)
    assert json.loads(page.get("catalogue"))["first"]["open"]
    pattern = page.finished()["pattern"]
    assert pattern["headline"] == "This pattern is sound."
    assert pattern["command"] == "miurafab check 'my plane.fold'"
    assert page.get(pattern["files"]["fold"]) == (tmp_path / "my plane.fold").read_bytes()


def children(process):
    found = []
    for thread in Path(f"/proc/{process.pid}/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            found += (thread / "children").read_text().split()
    return [int(pid) for pid in found]


def gone(pid, seconds=20):
    end = time.monotonic() + seconds
    while Path(f"/proc/{pid}/cmdline").exists() and Path(f"/proc/{pid}/cmdline").read_bytes():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize("how", ["cancel", "ctrl-c", "killed"])
def test_a_long_fit_blocks_nothing_and_ends_with_the_studio(start, how):
    program = start()
    page = Page(program.address)
    page.post("fit", {"target": {"surface": "sphere"}, "options": {"facets": "300x300"}})
    started = time.monotonic()
    while not (workers := children(program.process)):
        assert time.monotonic() - started < 5
    (worker,) = workers
    assert json.loads(page.get("state"))["task"]["running"]
    assert page.ask("POST", "fit", {"target": {"surface": "plane"}})[0] == 400
    assert time.monotonic() - started < 5
    if how == "cancel":
        assert page.post("cancel", {})["task"]["cancelled"]
        assert gone(worker)
        page.post("fit", {"target": {"surface": "plane"}, "options": {"facets": "2x2"}})
        assert page.finished()["pattern"]["name"] == "plane"
    elif how == "ctrl-c":
        assert program.end() == (0, "")
        assert list(program.folder.iterdir()) == []
    else:
        program.process.kill()
        program.process.communicate()
    assert gone(worker)


def raw(port, *lines, body=b""):
    with socket.create_connection(("127.0.0.1", port), timeout=20) as wire:
        wire.sendall("\r\n".join((*lines, "", "")).encode() + body)
        wire.shutdown(socket.SHUT_WR)
        answer = b""
        while read := wire.recv(65536):
            answer += read
    return answer


def test_only_this_computer_and_only_with_the_key(start):
    program = start()
    page = Page(program.address)
    port, key = page.port, page.headers["X-Studio-Key"]
    assert len(key) >= 32
    if sys.platform == "linux":  # where every address of 127.0.0.0/8 is this computer's
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), timeout=20)
    host = f"Host: 127.0.0.1:{port}"
    assert b" 404 " in raw(port, "GET / HTTP/1.1", host).splitlines()[0]
    assert b" 421 " in raw(port, f"GET /{key}/ HTTP/1.1", "Host: evil.example").splitlines()[0]
    for twice in ((host, host), (host, "Host: evil.example"), ("Host:", host)):
        assert b" 421 " in raw(port, f"GET /{key}/ HTTP/1.1", *twice).splitlines()[0]
    post = (f"POST /{key}/cancel HTTP/1.1", host, f"X-Studio-Key: {key}")
    assert b" 403 " in raw(port, *post, "Origin: http://evil.example", "Content-Length: 2")
    own = f"Origin: http://127.0.0.1:{port}"
    assert b" 411 " in raw(port, *post, own, "Transfer-Encoding: chunked", body=b"2\r\n{}\r\n")
    assert b" 413 " in raw(port, *post, own, "Content-Length: 999999999999", body=b"{}")
    assert raw(port, *post, own, "Content-Length: 10", body=b"{}") == b""  # it never came whole
    assert b" 501 " in raw(port, f"BREW /{key}/ HTTP/1.1", host).splitlines()[0]
    head = raw(port, f"HEAD /{key}/ HTTP/1.1", host, "Connection: close")
    assert b" 200 " in head.splitlines()[0]
    assert head.endswith(b"\r\n\r\n")
    answers = []
    threads = [
        threading.Thread(target=lambda: answers.append(Page(program.address).get("state")))
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(answers)) == 1
    assert len(answers) == 8
    assert program.end(signal.SIGHUP) == (0, "")


@pytest.mark.parametrize(
    ("thing", "port", "error", "named"),
    [
        ("gone.fold", 0, PatternError, "gone.fold does not exist"),
        ("gone.stl", 0, TargetError, "gone.stl does not exist"),
        ("gone.toml", 0, TargetError, "gone"),
        ("hyppar", 0, TargetError, "did you mean 'hypar'"),
        ("hypar:height=tall", 0, TargetError, "not a number"),
        (None, 70000, InputError, "'port' is 70000"),
        (None, -1, InputError, "'port' is -1"),
    ],
)
def test_what_cannot_be_served_is_a_sentence(thing, port, error, named):
    with pytest.raises(error, match=named):
        serve(thing, port=port, open_browser=False, announce=pytest.fail)


def test_a_port_that_is_taken_is_a_sentence():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(PortError, match=f"Cannot listen on port {port}: .*'port'"):
            serve(port=port, open_browser=False, announce=pytest.fail)


def test_a_design_named_on_the_command_line_is_fitted(start, tmp_path):
    (tmp_path / "my.toml").write_text(
        'facets = "6x4"\nsize = "90mm"\n[target]\nsurface = "plane"\n'
        '[layout]\nmachine = "grbl-co2-k40"\nmaterial = "paper-100"\n'
        'gap = "4mm"\nfull_facet = true\n'
    )
    page = Page(start("my.toml").address)
    first = json.loads(page.get("catalogue"))["first"]
    assert (first["machine"], first["material"]) == ("grbl-co2-k40", "paper-100")
    assert first["layout"] == {"gap": "4mm", "full_facet": True}
    page.post("fit", {"target": {"source": first["source"]}, "options": {"size": "120mm"}})
    pattern = page.finished()["pattern"]
    assert pattern["command"] == "miurafab fit my.toml --size 120mm -o my.fold"
    run(tmp_path, pattern["command"])
    assert page.get(pattern["files"]["fold"]) == (tmp_path / "my.fold").read_bytes()
    assert page.ask("GET", "design.toml")[0] == 404  # there is one already
