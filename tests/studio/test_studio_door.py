"""The key of the studio stands where only its owner can read it, and the way in works once."""

import contextlib
import re
import stat
import threading
import webbrowser

from studios import GUARD, PORT

from miurafab.studio.door import Door
from miurafab.studio.server import serve

NAMED = {"host": f"127.0.0.1:{PORT}"}


def code_of(door):
    (address,) = re.findall(r'url=(http[^"]+)"', door.file.read_text())
    start = f"http://127.0.0.1:{PORT}"
    assert address.startswith(start)
    return address.removeprefix(start)


def test_the_file_is_its_owners_alone_and_holds_no_key(tmp_path):
    door = Door(GUARD, tmp_path)
    assert stat.S_IMODE(door.file.stat().st_mode) == 0o600
    assert GUARD.key not in door.file.read_text()


def test_the_code_works_once_and_its_file_goes(tmp_path):
    door = Door(GUARD, tmp_path)
    path = code_of(door)
    assert len(path) > 32
    assert door.answer("GET", path + "x", NAMED) is None
    assert door.answer("GET", "/once/", NAMED) is None
    assert door.answer("POST", path, NAMED) is None
    assert door.answer("GET", path, {"host": "evil.example"}) is None
    assert door.file.exists()
    opened = door.answer("GET", path, NAMED)
    assert (opened.status, opened.headers["Location"]) == (303, GUARD.address)
    assert door.answer("GET", path, NAMED) is None
    assert not door.file.exists()


def test_the_browser_is_started_without_the_key(monkeypatch):
    """What it is started with, every user of the computer can read."""
    told, opened, came = [], [], threading.Event()

    def start(address):
        opened.append(address)
        came.set()

    def announce(address, fingerprint):
        assert fingerprint == ""
        told.append(address)

    class Enough(Exception):
        pass

    def loop(server, poll_interval):
        assert came.wait(60)
        assert stat.S_IMODE(server.door.file.parent.stat().st_mode) == 0o700
        raise Enough

    monkeypatch.setattr(webbrowser, "open", start)
    monkeypatch.setattr("miurafab.studio.server._Server.serve_forever", loop)
    with contextlib.suppress(Enough):
        serve(announce=announce)
    (key,) = re.findall(r"http://127\.0\.0\.1:\d+/(.+)/", told[0])
    assert opened[0].startswith("file://")
    assert key not in opened[0]
