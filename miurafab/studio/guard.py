"""Which requests are let in, judged by the first line and the headers before a body is read.

The server listens on this computer only. Other pages in the browser and other people on the
computer can reach it, too. Against them:

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
"""The only address on which the server listens."""

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
    """Lets requests in to the server at ``port`` whose addresses begin with ``key``."""

    port: int
    key: str

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{ADDRESS}:{self.port}/{self.key}/"

    @property
    def _hosts(self) -> tuple[str, ...]:
        return tuple(f"{name}:{self.port}" for name in (ADDRESS, "localhost"))

    def is_named(self, headers: Mapping[str, str]) -> bool:
        """Whether the request is for this server by a name of its own."""
        return headers.get("host", "").lower() in self._hosts

    def _is_ours(self, origin: str) -> bool:
        return origin.lower() in {f"http://{host}" for host in self._hosts}

    def route(self, path: str) -> str | None:
        """The part of ``path`` after the key, without its query; None if the key is wrong."""
        first, slash, rest = path.partition("?")[0].removeprefix("/").partition("/")
        return rest if slash and same_key(first, self.key) else None

    def refuse(self, method: str, path: str, headers: Mapping[str, str]) -> Response | None:
        """The refusal of the request, or None to let it in. Names of ``headers`` are lower case."""
        if not self.is_named(headers):
            return refusal(421, f"This server answers to {self._hosts[0]} only.")
        if method not in ("GET", "HEAD", "POST"):
            return refusal(405, f"This server does not answer the method {method[:16]!r}.")
        origin = headers.get("origin")  # a browser names none where our page reads
        if origin is not None and not self._is_ours(origin):
            return refusal(403, "The request does not come from the studio's own page.")
        if "upgrade" in headers:
            return refusal(400, "This server speaks plain HTTP alone, and opens no WebSocket.")
        route = self.route(path)
        if route is None:
            return refusal(404, "Open the address that 'miurafab studio' printed, with its key.")
        return self._refuse_post(route, headers) if method == "POST" else None

    def _refuse_post(self, route: str, headers: Mapping[str, str]) -> Response | None:
        if not self._is_ours(headers.get("origin", "")):
            return refusal(403, "The request does not come from the studio's own page.")
        if not same_key(headers.get(TOKEN_HEADER, ""), self.key):
            return refusal(403, "The request does not carry the studio's key; reload the page.")
        length = headers.get("content-length", "")
        if "transfer-encoding" in headers or not (length.isascii() and length.isdigit()):
            return refusal(411, "The request does not state its length.")
        limit = FILE_LIMIT if route == UPLOAD else ORDER_LIMIT
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
