"""Requests and responses as values, so that tests need no socket.

The headers of every response forbid browsers to cache it, to guess its type and to frame it in
other pages, and let the page load from this server only. Results (drawings, the pages of
:mod:`miurafab.workflow.page`) are shown as documents without rights: they have no origin, and so
can request nothing from this server.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from miurafab.workflow.json_text import json_text

_ALWAYS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
OWN_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""For the studio's own page, its script and its style."""

MADE_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'; sandbox allow-scripts"
)
"""For computed files. A page of :mod:`miurafab.workflow.page` narrows it to its own hashes."""

TYPES = {
    ".css": "text/css; charset=utf-8",
    ".fold": "application/json; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".json": "application/json; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".pdf": "application/pdf",
    ".svg": "image/svg+xml; charset=utf-8",
    ".toml": "text/plain; charset=utf-8",
    ".zip": "application/zip",
}


@dataclass(frozen=True)
class HttpRequest:
    """A request: ``path`` as sent, with its query; names of ``headers`` are lower case."""

    method: str
    path: str
    headers: Mapping[str, str] = field(default_factory=dict)
    body: bytes = b""


@dataclass(frozen=True)
class Response:
    """A response; a ``body`` that is a path is sent from that file."""

    status: int
    content_type: str
    body: bytes | Path
    headers: Mapping[str, str] = field(default_factory=dict)

    @property
    def all_headers(self) -> dict[str, str]:
        """The headers of every response, and its own."""
        policy = {"Content-Security-Policy": OWN_POLICY}
        return {"Content-Type": self.content_type, **_ALWAYS, **policy, **self.headers}

    def json(self) -> Any:
        """The body of an answer in JSON."""
        assert isinstance(self.body, bytes)
        return json.loads(self.body)


def answer(value: Any, status: int = 200) -> Response:
    """``value`` as JSON."""
    text = json_text(value, one_line=True)
    return Response(status, "application/json; charset=utf-8", text.encode("ascii"))


def refusal(status: int, sentence: str) -> Response:
    """A refusal in one sentence."""
    return answer({"error": sentence}, status)


def own_file(name: str, content: bytes) -> Response:
    """A part of the studio's own page."""
    return Response(200, TYPES[Path(name).suffix], content)


def made_file(path: Path, *, download: bool) -> Response:
    """A computed file, to show or, with ``download``, to save."""
    headers = {"Content-Security-Policy": MADE_POLICY}
    if download:
        headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{quote(path.name)}"
    kind = TYPES.get(path.suffix, "application/octet-stream")  # a browser guesses none (nosniff)
    return Response(200, kind, path, headers)
