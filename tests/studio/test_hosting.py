"""A studio for other computers: the password and its guessing, TLS, the attacks on it."""

import contextlib
import getpass
import hashlib
import http.client
import json
import os
import re
import socket
import ssl
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from axe import AXE, serious_faults
from browser import CHROMIUM, Browser
from hypothesis import given
from hypothesis import strategies as st

from miurafab.cli.ending import exit_code_of
from miurafab.cli.program import run as run_command
from miurafab.errors import InputError
from miurafab.studio import server as served
from miurafab.studio.certificate import fingerprint, tls_of
from miurafab.studio.connections import (
    HEAD_LIMIT,
    IDLE_S,
    MOST,
    MOST_OF_ONE,
    STRANGER_S,
    Connections,
)
from miurafab.studio.guard import Guard
from miurafab.studio.hosting import Hosting, place_of
from miurafab.studio.password import PasswordLock

PASSWORD = "correct horse"
TLS = Path(__file__).parents[1] / "data" / "tls"
FILES = {"certificate": TLS / "certificate.pem", "certificate_key": TLS / "key.pem"}
KNOWN = hashlib.sha256(ssl.PEM_cert_to_DER_cert(FILES["certificate"].read_text())).hexdigest()


class Clock:
    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


class Served:
    """``serve`` with a host, in a thread of this process."""

    def __init__(self, monkeypatch, **files):
        self.said = threading.Event()
        loop = served._Server.serve_forever

        def watched(server, poll_interval):
            self.server = server
            loop(server, 0.05)

        monkeypatch.setattr(served._Server, "serve_forever", watched)
        monkeypatch.setattr(served, "StopSignals", NoSignals)
        hosting = Hosting("127.0.0.1", PASSWORD, **files)
        self.thread = threading.Thread(
            target=served.serve, kwargs={"hosting": hosting, "announce": self.announce}
        )
        self.thread.start()
        assert self.said.wait(60)
        self.port = int(self.address.rstrip("/").rpartition(":")[2])

    def announce(self, address, known):
        self.address, self.known = address, known
        self.said.set()

    def end(self):
        self.server.shutdown()
        self.thread.join()

    def wire(self, **context):
        trusted = ssl.create_default_context(cafile=FILES["certificate"])
        for name, value in context.items():
            setattr(trusted, name, value)
        raw = socket.create_connection(("127.0.0.1", self.port), timeout=20)
        return trusted.wrap_socket(raw, server_hostname="127.0.0.1")

    def raw(self, *lines, body=b""):
        """The status line of the answer to these lines; empty for none."""
        with self.wire() as wire:
            wire.sendall("\r\n".join((*lines, "", "")).encode("latin-1") + body)
            answer = b""
            with contextlib.suppress(ConnectionError, ssl.SSLError):
                while b"\r\n\r\n" not in answer and (read := wire.recv(65536)):
                    answer += read
        return answer

    def ask(self, method, path, body=None, **headers):
        wire = http.client.HTTPSConnection(
            "127.0.0.1", self.port, timeout=60,
            context=ssl.create_default_context(cafile=FILES["certificate"]),
        )  # fmt: skip
        with contextlib.closing(wire):
            content = None if body is None else json.dumps(body).encode()
            own = {"Origin": f"https://127.0.0.1:{self.port}"} if method == "POST" else {}
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            wire.request(method, path, content, {**own, **named})
            answer = wire.getresponse()
            return answer.status, dict(answer.headers), answer.read()

    def enter(self, password, **headers):
        return self.ask("POST", "/enter", {"password": password}, **headers)


class NoSignals:
    """Signals come to the main thread alone, which this is not."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def check(self):
        pass

    def hold(self):
        pass


@pytest.fixture
def studio(monkeypatch):
    there = Served(monkeypatch, **FILES)
    yield there
    there.end()


def test_the_whole_way_in_and_what_is_kept_out(studio, capfd):
    """One studio, one after another: the way in, and each attack that the notes list."""
    assert studio.address == f"https://127.0.0.1:{studio.port}/"
    assert studio.known.replace(":", "").lower() == KNOWN
    host, origin = f"Host: 127.0.0.1:{studio.port}", f"Origin: https://127.0.0.1:{studio.port}"

    # Without the password: the page that asks, no key in it, and nothing behind it.
    for path in ("/", "/enter.js", "/studio.css", "/texts.js", "/icon.svg"):
        status, headers, content = studio.ask("GET", path)
        assert status == 200
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert (headers["Cache-Control"], headers["X-Content-Type-Options"]) == (
            "no-store",
            "nosniff",
        )
        assert studio.server.studio.guard.key.encode() not in content
    for path in ("/state", "/studio.html", "/machine", "/x/", "/../enter.html", "/enter.html"):
        assert studio.ask("GET", path)[0] == 404
    assert studio.ask("GET", "/enter")[0] == 405

    # The password lets in, by a key in the path: there is no cookie that another site could use.
    status, headers, content = studio.enter(PASSWORD)
    assert status == 200
    way = json.loads(content)["address"]
    assert re.fullmatch(r"/[\w-]{32}/", way)
    assert "Set-Cookie" not in headers
    key = way.strip("/")
    for path in (way, f"{way}state", f"{way}machine"):
        status, headers, _ = studio.ask("GET", path)
        assert (status, headers["Referrer-Policy"]) == (200, "no-referrer")
        assert "Set-Cookie" not in headers
    post = (f"POST {way}cancel HTTP/1.1", host, f"X-Studio-Key: {key}", "Content-Length: 2")
    assert b" 200 " in studio.raw(*post, origin, "Connection: close", body=b"{}")

    # Another host, another page, another protocol, with the key or without.
    at = f":{studio.port}"
    for wrong in ("evil.example", f"evil.example{at}", "127.0.0.1", f"localhost{at}"):
        for path in ("/", way):
            assert b" 421 " in studio.raw(f"GET {path} HTTP/1.1", f"Host: {wrong}")
    assert b" 421 " in studio.raw(f"GET {way} HTTP/1.1", host, "Host: evil.example")
    plain = f"Origin: http://127.0.0.1:{studio.port}"
    for foreign in ("Origin: https://evil.example", "Origin: null", plain):
        assert b" 403 " in studio.raw(*post, foreign, body=b"{}")
        enter = ("POST /enter HTTP/1.1", host, foreign, "Content-Length: 2")
        assert b" 403 " in studio.raw(*enter, body=b"{}")
    assert b" 403 " in studio.raw("POST /enter HTTP/1.1", host, "Content-Length: 2", body=b"{}")
    socket_ = ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13")
    cross = (*socket_, "Origin: https://evil.example")
    assert b" 403 " in studio.raw(f"GET {way}machine HTTP/1.1", host, *cross)
    for path in ("/", way, f"{way}machine"):
        assert b" 400 " in studio.raw(f"GET {path} HTTP/1.1", host, *socket_, origin)

    # Bodies and heads without end.
    enter = ("POST /enter HTTP/1.1", host, origin)
    assert b" 413 " in studio.raw(*enter, "Content-Length: 1025")
    assert b" 411 " in studio.raw(*enter, "Transfer-Encoding: chunked", body=b"2\r\n{}\r\n")
    long = "x" * (HEAD_LIMIT // 8)
    many = [f"X-{number}: {long}" for number in range(20)]
    answer = studio.raw("GET / HTTP/1.1", host, *many)
    assert answer == b"" or b" 431 " in answer.splitlines()[0]
    assert b" 431 " in studio.raw("GET / HTTP/1.1", host, *(f"X-{n}: y" for n in range(200)))
    assert b" 414 " in studio.raw(f"GET /{'x' * 70000} HTTP/1.1", host)
    broken = studio.raw("BREW / HTTP/1.1", host)
    assert b" 501 " in broken
    assert b"Content-Security-Policy" in broken

    # Plain HTTP to the port is no answer, nor a line in the terminal, and no old TLS is spoken.
    with socket.create_connection(("127.0.0.1", studio.port), timeout=20) as wire:
        wire.sendall(f"GET / HTTP/1.1\r\n{host}\r\n\r\n".encode())
        with contextlib.suppress(ConnectionError):
            assert b"HTTP" not in wire.recv(4096)
    assert studio.server.tls.minimum_version == ssl.TLSVersion.TLSv1_2

    # Guessing: told to the person at the studio, slowed, and without a way round by a header.
    said = [studio.enter(f"wrong guess {n}", X_Forwarded_For=f"10.0.0.{n}") for n in range(5)]
    assert [status for status, _, _ in said] == [403, 403, 403, 429, 429]
    assert said[-1][1]["Retry-After"] == "1"
    assert "try again in 1 s" in json.loads(said[-1][2])["error"]
    assert studio.enter(PASSWORD)[0] == 429  # not even the right one tells anything
    assert studio.ask("GET", f"{way}state")[0] == 200  # who is in does not wait
    errors = capfd.readouterr().err
    assert errors.count("a wrong password was given from 127.0.0.1") == 3
    assert "wrong guess" not in errors
    assert len(errors.splitlines()) == 3


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_a_browser_enters_by_the_password(studio, tmp_path):
    with Browser(tmp_path / "profile") as page:
        page.call("Security.setIgnoreCertificateErrors", ignore=True)
        page.open(studio.address)
        assert page.run("document.documentElement.dataset.ready") == "yes"
        wait_for(page, "document.activeElement.id === 'password'")
        for width in (1280, 390):
            page.call(
                "Emulation.setDeviceMetricsOverride",
                width=width, height=800, deviceScaleFactor=1, mobile=width < 600,
            )  # fmt: skip
            assert page.run("document.documentElement.scrollWidth") <= width
            if AXE.is_file():
                assert serious_faults(page) == []
        for word, there in (("no password", "'That is not the password.'"), (PASSWORD, None)):
            page.run("document.getElementById('password').select()")
            page.call("Input.insertText", text=word)
            page.run("document.getElementById('enter').click()")
            wanted = f"document.getElementById('fault').textContent === {there}"
            wait_for(page, wanted if there else "document.getElementById('shape') !== null")
        wait_for(page, "document.documentElement.dataset.ready === 'yes'")
        assert page.run("location.href").startswith(studio.address)
        assert page.run("document.cookie") == ""
        assert page.run("history.length") <= 2  # the entrance is not gone back to
        assert page.faults == []
        assert all(asked.startswith((studio.address, "data:", "blob:")) for asked in page.requests)


def wait_for(page, expression):
    end = time.monotonic() + 60
    while not page.run(expression):
        assert time.monotonic() < end, expression
        time.sleep(0.05)


def test_a_connection_that_dawdles_is_shut(monkeypatch):
    """Slow loris: in the handshake, and letter by letter in the head, for all its liveliness."""
    monkeypatch.setattr("miurafab.studio.connections.STRANGER_S", 0.5)
    studio = Served(monkeypatch, **FILES)
    try:
        with socket.create_connection(("127.0.0.1", studio.port), timeout=30) as silent:
            assert silent.recv(10) == b""
        with studio.wire() as wire:
            assert letter_by_letter(wire) < 100
        assert studio.ask("GET", "/")[0] == 200
    finally:
        studio.end()


def letter_by_letter(wire):
    """Send a head without end; how many letters were taken."""
    wire.settimeout(0.1)
    for sent in range(100):
        try:
            wire.sendall(b"X")
            if not wire.recv(10):
                return sent
        except TimeoutError:
            continue
        except OSError:
            return sent
    return 100


def test_connections_have_a_number_and_a_time():
    clock = Clock()
    book = Connections(bounded=True, clock=clock)
    pairs = [socket.socketpair() for _ in range(3)]
    for wire, _ in pairs:
        book.add(wire, "10.0.0.1")
    book.more_time(pairs[1][0], IDLE_S)
    book.remove(pairs[2][0])
    book.more_time(pairs[2][0], IDLE_S)  # its request was still being answered
    clock.now += STRANGER_S + 1
    book.shut_late()
    assert pairs[0][1].recv(1) == b""
    for _, far in pairs[1:]:
        far.setblocking(False)
        with pytest.raises(BlockingIOError):
            far.recv(1)
    for wire, far in pairs:
        wire.close()
        far.close()

    book = Connections(bounded=True, clock=clock)
    wires = [object() for _ in range(MOST + 1)]
    for number, wire in enumerate(wires[:MOST_OF_ONE]):
        assert book.has_room("10.0.0.1"), number
        book.add(wire, "10.0.0.1")
        book.more_time(wire, IDLE_S)
    assert not book.has_room("10.0.0.1")
    for number, wire in enumerate(wires[MOST_OF_ONE:MOST]):
        assert book.has_room(f"10.0.1.{number}")
        book.add(wire, f"10.0.1.{number}")
        book.more_time(wire, IDLE_S)
    assert not book.has_room("10.0.2.1")
    book.remove(wires[0])
    assert book.has_room("10.0.2.1")
    own = Connections(bounded=False)
    for wire in wires:
        own.add(wire, "127.0.0.1")
    assert own.has_room("127.0.0.1")


@pytest.mark.parametrize("spread", [False, True])
def test_silent_connections_keep_nobody_out(spread):
    """A further one, which may bring Abort, takes the place of the oldest that was not let in."""
    book = Connections(bounded=True, clock=Clock())
    pairs = [socket.socketpair() for _ in range(MOST if spread else MOST_OF_ONE)]
    for number, (wire, _) in enumerate(pairs):
        book.add(wire, f"10.0.0.{number}" if spread else "10.0.0.1")
    book.more_time(pairs[0][0], IDLE_S)
    assert book.has_room("10.0.0.1")
    assert pairs[1][1].recv(1) == b""
    for _, far in (pairs[0], pairs[2]):
        far.setblocking(False)
        with pytest.raises(BlockingIOError):
            far.recv(1)
    for pair in pairs:
        for end in pair:
            end.close()


class CheapLock(PasswordLock):
    """Without the cost of scrypt, which is not what is counted here."""

    def _hashed(self, password):
        return password.encode()


@pytest.mark.parametrize("addresses", [1, 2, 5000])
@pytest.mark.parametrize("network", ["10.{}.{}.1", "2001:db8:{:x}:{:x}::1"])
def test_four_hours_of_guessing_is_few_guesses(addresses, network):
    """Whoever asks as often as he likes, from however many addresses, is judged so many times."""
    clock = Clock()
    lock = CheapLock(PASSWORD, clock)
    names = [network.format(number // 200, number % 200) for number in range(addresses)]
    judged = 0
    for turn in range(14_400):
        clock.now += 1.0
        judged += lock.guess(names[turn % addresses], f"guess {turn}") is None
    assert judged <= {1: 250, 2: 500}.get(addresses, 1_460)
    assert judged > 200  # it is slowed, not locked: the right one has its turn
    clock.now += 60.0
    assert lock.guess("192.168.1.1", PASSWORD) == 0.0


@given(st.lists(st.tuples(st.floats(0.0, 400.0), st.sampled_from("abc")), max_size=60))
def test_no_guess_is_judged_before_the_time_that_was_told(tries):
    clock = Clock()
    lock = CheapLock(PASSWORD, clock)
    free_at = {}
    for pause, who in tries:
        clock.now += pause
        address = f"10.0.0.{ord(who)}"
        told = lock.guess(address, "wrong")
        if told is None:
            assert clock.now >= free_at.get(who, 0.0) - 1e-6
        else:
            assert 0.0 < told <= 60.0
            free_at[who] = max(free_at.get(who, 0.0), clock.now + told)


def test_a_whole_network_of_ipv6_is_one_address_and_a_right_password_clears_it():
    clock = Clock()
    lock = CheapLock(PASSWORD, clock)
    for number in range(3):
        assert lock.guess(f"2001:db8::{number:x}", "wrong") is None
    assert lock.guess("2001:db8::ffff", PASSWORD) > 0.0
    assert lock.guess("2001:db8:0:1::1", PASSWORD) == 0.0
    clock.now += 1.0
    assert lock.guess("2001:db8::1", PASSWORD) == 0.0
    assert [lock.guess("2001:db8::1", "wrong") for _ in range(3)] == [None] * 3
    assert lock.guess("::ffff:10.0.0.1", "wrong") is None
    assert [lock.guess("10.0.0.1", "wrong") for _ in range(2)] == [None] * 2
    assert lock.guess("10.0.0.1", "wrong") > 0.0


def test_no_number_of_addresses_takes_more_memory(monkeypatch):
    monkeypatch.setattr("miurafab.studio.password._MOST_ADDRESSES", 2)
    lock = CheapLock(PASSWORD, Clock())
    assert [lock.guess(f"10.0.{n}.1", "wrong") for n in range(4)] == [None] * 4
    assert sorted(lock._each) == ["10.0.2.1", "10.0.3.1"]


def test_a_password_is_one_in_each_spelling_of_unicode():
    lock = PasswordLock("Gruß aus Köln")
    assert lock.guess("10.0.0.1", "Gruß aus Köln") == 0.0
    assert lock.guess("10.0.0.1", "\ud800") is None
    assert PASSWORD not in repr(Hosting("127.0.0.1", PASSWORD))


@pytest.mark.parametrize(
    ("host", "said"),
    [("0.0.0.0", "every network"), ("::", "every network"), ("no.such.host.invalid", "no address"),
     ("256.1.1.1", "no address"), ("a" * 300, "no address"), ("a..b", "no address")],
)  # fmt: skip
def test_hosts_that_are_none(host, said):
    with pytest.raises(InputError, match=f"'host' is .*{said}"):
        place_of(host)


def test_an_address_of_another_computer_is_refused():
    with pytest.raises(InputError, match=r"192\.0\.2\.1, which is no address of this computer"):
        served._Server(0, lambda: None, place_of("192.0.2.1"))


def test_names_and_usual_ports():
    assert place_of("::1").names == ("[::1]",)
    assert place_of("LocalHost").names[0] == "localhost"
    guard = Guard(443, "k" * 32, ("[::1]",), "https")
    assert guard.address == f"https://[::1]/{'k' * 32}/"
    for host in ("[::1]", "[::1]:443"):
        headers = {"host": host, "origin": f"https://{host}"}
        assert guard.refuse("GET", f"/{'k' * 32}/", headers) is None
    assert guard.refuse("GET", f"/{'k' * 32}/", {"host": "[::1]:80"}).status == 421
    assert Guard(80, "k" * 32).address.startswith("http://127.0.0.1/")


@pytest.mark.parametrize(
    ("password", "files", "said"),
    [("short", {}, "has 5 letters"), ("a" * 9, {}, "has 9 letters"),
     ("two\nlines of it", {}, "one line"), (" with blanks ", {}, "one line"),
     (PASSWORD, {"certificate": TLS}, "both"),
     (PASSWORD, {"certificate_key": TLS}, "both")],
)  # fmt: skip
def test_hostings_that_are_none(password, files, said):
    with pytest.raises(InputError, match=said):
        Hosting("127.0.0.1", password, **files)


@pytest.mark.parametrize("swap", ["twice", "wrong", "none", "gone", "locked"])
def test_certificates_that_are_none(tmp_path, swap):
    other = tmp_path / "other.pem"
    wanted = dict(FILES)
    if swap == "twice":
        wanted["certificate_key"] = FILES["certificate"]
    elif swap == "wrong":
        wanted["certificate"] = FILES["certificate_key"]
    elif swap == "none":
        other.write_text("nothing")
        wanted["certificate"] = other
    elif swap == "gone":
        wanted["certificate"] = other
    else:  # OpenSSL would ask for its password in the terminal
        wanted["certificate_key"] = TLS / "locked.pem"
    with pytest.raises(InputError, match=r"\.pem .*\.$"):
        tls_of(Hosting("127.0.0.1", PASSWORD, **wanted))


def test_a_certificate_is_made_once_and_its_key_is_its_owners_alone(tmp_path, monkeypatch):
    x509 = pytest.importorskip("cryptography.x509")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    context, known = tls_of(Hosting("127.0.0.1", PASSWORD))
    (file,) = (tmp_path / "miurafab" / "certificates").iterdir()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    certificate = x509.load_pem_x509_certificate(file.read_bytes())
    text = file.read_text()
    body = ssl.PEM_cert_to_DER_cert(text[text.index(ssl.PEM_HEADER) :])
    assert fingerprint(body) == known
    assert (certificate.not_valid_after_utc - certificate.not_valid_before_utc).days == 366
    assert tls_of(Hosting("127.0.0.1", PASSWORD))[1] == known  # kept for the next start
    assert tls_of(Hosting("localhost", PASSWORD))[1] != known
    with monkeypatch.context() as soon:  # it ends within that time
        soon.setattr("miurafab.studio.certificate._RENEWED_DAYS", 367)
        renewed = tls_of(Hosting("localhost", PASSWORD))[1]
    assert tls_of(Hosting("localhost", PASSWORD))[1] == renewed
    here, there = socket.socketpair()
    trusted = ssl.create_default_context(cafile=file)
    ends = []
    answering = threading.Thread(
        target=lambda: ends.append(context.wrap_socket(there, server_side=True))
    )
    answering.start()
    wire = trusted.wrap_socket(here, server_hostname="127.0.0.1")
    answering.join()
    assert fingerprint(wire.getpeercert(True)) == known
    ends.append(wire)
    for end in ends:
        end.close()
    file.write_text("damaged")
    file.chmod(0o644)
    assert tls_of(Hosting("127.0.0.1", PASSWORD))[1] != known
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_without_the_library_a_sentence_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "cryptography.x509", None)
    with pytest.raises(InputError, match=r"miurafab\[host\].*'certificate'"):
        tls_of(Hosting("127.0.0.1", PASSWORD))


class Started:
    """What the command line hands to the studio."""

    def __call__(self, thing, **given):
        self.given = given


def test_the_password_stands_in_no_command_line(tmp_path, monkeypatch, capsys):
    started = Started()

    def run(*words):
        return exit_code_of(lambda: run_command(["studio", *words], serve_studio=started))

    file = tmp_path / "studio.password"
    file.write_text(f"{PASSWORD}\nnot this\n")
    file.chmod(0o600)
    assert run("--host", "10.0.0.5", "--password-file", str(file)) == 0
    assert (started.given["host"], started.given["password"]) == ("10.0.0.5", PASSWORD)
    if os.name == "posix":
        file.chmod(0o640)
        assert run("--host", "10.0.0.5", "--password-file", str(file)) == 2
        assert f"'chmod 600 {file}'" in capsys.readouterr().err
    assert run("--password-file", str(file)) == 2
    assert "give it, too" in capsys.readouterr().err
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        assert run("--host", "10.0.0.5") == 2
    assert "--password-file" in capsys.readouterr().err


def test_the_password_is_asked_for_twice(monkeypatch, capsys):
    started = Started()
    asked = iter([PASSWORD, PASSWORD, PASSWORD, "another"])
    monkeypatch.setattr(getpass, "getpass", lambda prompt: next(asked))

    class Terminal:
        def isatty(self):
            return True

    monkeypatch.setattr("sys.stdin", Terminal())
    for code in (0, 2):
        words = ["studio", "--host", "10.0.0.5"]
        assert exit_code_of(lambda: run_command(words, serve_studio=started)) == code  # noqa: B023
    assert started.given["password"] == PASSWORD
    assert "differ" in capsys.readouterr().err


def test_the_whole_program_over_tls(tmp_path):
    """Its first line, the fingerprint with it, the password in nobody's sight, and its end."""
    file = tmp_path / "password"
    file.write_text(PASSWORD)
    file.chmod(0o600)
    words = ["--host", "127.0.0.1", "--password-file", str(file), "--json"]
    for name, path in FILES.items():
        words += [f"--{name.replace('_', '-')}", str(path)]
    program = subprocess.Popen(
        [sys.executable, "-m", "miurafab", "studio", *words], stdout=subprocess.PIPE, text=True
    )
    try:
        said = ""
        while not said.rstrip().endswith("}"):
            said += program.stdout.readline()
        told = json.loads(said)
        assert told["fingerprint"].replace(":", "").lower() == KNOWN
        assert told["address"].startswith("https://127.0.0.1:")
        assert told["address"].count("/") == 3  # no key in it
        if Path("/proc/self/cmdline").exists():
            for what in ("cmdline", "environ"):
                assert PASSWORD.encode() not in Path(f"/proc/{program.pid}/{what}").read_bytes()
    finally:
        program.terminate()
        assert program.wait(30) == 0
        program.stdout.close()
