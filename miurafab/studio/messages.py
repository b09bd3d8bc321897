"""Requests and responses as values, so that everything between them can be tried without a socket.

Every response says that nothing may be kept, guessed or framed by others, and from where the page
may load what: from this server alone. What is computed (drawings, the pages of
:mod:`miurafab.workflow.page`) is shown as a document without rights: it has no origin, and so
cannot ask this server for anything.
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
"""For what was computed. A page of :mod:`miurafab.workflow.page` narrows it to its own hashes."""

TYPES = {
    ".css": "text/css; charset=utf-8",
    ".fold": "application/json; charset=utf-8",
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".pdf": "application/pdf",
    ".svg": "image/svg+xml; charset=utf-8",
    ".toml": "text/plain; charset=utf-8",
    ".zip": "application/zip",
}


@dataclass(frozen=True)
class HttpRequest:
    """What was asked: ``path`` as it was sent, with its query; names of ``headers`` are small."""

    method: str
    path: str
    headers: Mapping[str, str] = field(default_factory=dict)
    body: bytes = b""


@dataclass(frozen=True)
class Response:
    """What is answered; a ``body`` that is a path is sent from that file."""

    status: int
    content_type: str
    body: bytes | Path
    headers: Mapping[str, str] = field(default_factory=dict)

    @property
    def all_headers(self) -> dict[str, str]:
        """Those that every response has, and its own."""
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
    """An answer that says in one sentence why it is none."""
    return answer({"error": sentence}, status)


def own_file(name: str, content: bytes) -> Response:
    """A part of the studio's own page."""
    return Response(200, TYPES[Path(name).suffix], content)


def made_file(path: Path, *, download: bool) -> Response:
    """Something that was computed, to be shown or, with ``download``, to be saved."""
    headers = {"Content-Security-Policy": MADE_POLICY}
    if download:
        headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{quote(path.name)}"
    return Response(200, TYPES[path.suffix], path, headers)
