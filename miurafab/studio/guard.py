"""Which requests are let in, judged by the first line and the headers before a body is read.

The server listens on this computer only, or at one address of it for other computers
(:mod:`~miurafab.studio.hosting`). Other pages in the browser and other people can reach it, too.
Against them:

- the ``Host`` must be this server's; otherwise another site has pointed its own name here (DNS
  rebinding);
- every address begins with a key of 192 random bits, which only the printed address contains. The
  browser gets it without a command line (:mod:`~miurafab.studio.door`);
- a request that changes anything (POST) must have this page's ``Origin``, and repeat the key in a
  header, which neither a form nor another site can send;
- no request may have another page's ``Origin``, and none may ask for a WebSocket: there are none;
- a body must state its length, and the length has a limit, as has what is being sent at one time.
"""

from __future__ import annotations

import hmac
import secrets
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from miurafab.studio.messages import Response, refusal

ADDRESS = "127.0.0.1"
"""The only address on which the server listens, unless it is told another."""

_USUAL_PORTS = {"http": 80, "https": 443}
"""Browsers leave these out of ``Host`` and ``Origin`` (RFC 9110, sections 4.2.1 and 4.2.2)."""

TOKEN_HEADER = "x-studio-key"
FILE_LIMIT = 64 * 2**20
"""The most bytes of an uploaded file: a scan of a million triangles."""

ORDER_LIMIT = 2**16
"""The most bytes of any other body."""

UPLOAD = "upload"
BODIES, BODY_BYTES = 8, 2 * FILE_LIMIT
"""The most bodies, and the most bytes of them, that are held in memory at one time."""
SHORT_BODY = 256
"""Bodies of so many bytes are always taken: no upload may keep Abort out."""


def new_key() -> str:
    """A key of 192 random bits, in letters that an address may hold."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Guard:
    """Lets requests in to the server at ``port`` whose addresses begin with ``key``.

    ``names`` are those of the server, the one to show first; ``scheme`` is ``http`` or ``https``.
    """

    port: int
    key: str
    names: tuple[str, ...] = (ADDRESS, "localhost")
    scheme: str = "http"

    @property
    def outside(self) -> str:
        """The address of the server without the key."""
        return f"{self.scheme}://{self._hosts[0]}/"

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"{self.outside}{self.key}/"

    @property
    def _hosts(self) -> tuple[str, ...]:
        usual = self.port == _USUAL_PORTS[self.scheme]
        with_port = tuple(f"{name}:{self.port}" for name in self.names)
        return (*self.names, *with_port) if usual else with_port

    def is_named(self, headers: Mapping[str, str]) -> bool:
        """Whether the request is for this server by a name of its own."""
        return headers.get("host", "").lower() in self._hosts

    def _is_ours(self, origin: str) -> bool:
        return origin.lower() in {f"{self.scheme}://{host}" for host in self._hosts}

    def route(self, path: str) -> str | None:
        """The part of ``path`` after the key, without its query; None if the key is wrong."""
        first, slash, rest = path.partition("?")[0].removeprefix("/").partition("/")
        return rest if slash and same_key(first, self.key) else None

    def refuse(self, method: str, path: str, headers: Mapping[str, str]) -> Response | None:
        """The refusal of the request, or None to let it in. Names of ``headers`` are lower case."""
        refused = self.refuse_sender(method, headers)
        if refused is not None:
            return refused
        route = self.route(path)
        if route is None:
            return refusal(404, "Open the address that 'miurafab studio' printed, with its key.")
        if method != "POST":
            return None
        if not same_key(headers.get(TOKEN_HEADER, ""), self.key):
            return refusal(403, "The request does not carry the studio's key; reload the page.")
        return self.refuse_body(headers, FILE_LIMIT if route == UPLOAD else ORDER_LIMIT)

    def refuse_sender(self, method: str, headers: Mapping[str, str]) -> Response | None:
        """The refusal of a request for another server, of another page, or of another protocol."""
        if not self.is_named(headers):
            return refusal(421, f"This server answers to {self._hosts[0]} only.")
        if method not in ("GET", "HEAD", "POST"):
            return refusal(405, f"This server does not answer the method {method[:16]!r}.")
        origin = headers.get("origin")  # a browser names none where our page reads
        if origin is not None and not self._is_ours(origin):
            return refusal(403, "The request does not come from the studio's own page.")
        if "upgrade" in headers:
            return refusal(400, "This server speaks plain HTTP alone, and opens no WebSocket.")
        if method == "POST" and origin is None:
            return refusal(403, "The request does not come from the studio's own page.")
        return None

    @staticmethod
    def refuse_body(headers: Mapping[str, str], limit: int) -> Response | None:
        """The refusal of a body that states no length, or one beyond ``limit`` bytes."""
        length = headers.get("content-length", "")
        if "transfer-encoding" in headers or not (length.isascii() and length.isdigit()):
            return refusal(411, "The request does not state its length.")
        if len(length) > 18 or int(length) > limit:
            return refusal(413, f"The request is larger than the limit of {limit // 2**10:,} KiB.")
        return None


class BodyRoom:
    """The memory for the bodies of requests that are under way, of all threads; mutable."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._held: list[int] = []

    @contextmanager
    def kept(self, size: int) -> Iterator[bool]:
        """Room for ``size`` bytes until the end of the block, or False where there is none now."""
        with self._lock:
            there = len(self._held) < BODIES and sum(self._held) + size <= BODY_BYTES
            there = there or size <= SHORT_BODY
            if there:
                self._held.append(size)
        try:
            yield there
        finally:
            with self._lock:
                if there:
                    self._held.remove(size)


def same_key(given: str, wanted: str) -> bool:
    """Compare in a time that does not depend on where the texts differ."""
    return hmac.compare_digest(given.encode("utf-8", "surrogateescape"), wanted.encode("ascii"))
