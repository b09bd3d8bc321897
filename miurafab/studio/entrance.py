"""The way in from other computers: a page that asks for the password, and answers with the key.

=========== ====== ================================================================
address     method answers
=========== ====== ================================================================
(empty)     GET    the page; its style and scripts by their names. They are no secret
enter       POST   the address with the key, for ``{"password": ...}``
=========== ====== ================================================================

These addresses need no key; all others do.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from importlib import resources

from miurafab.errors import InputError
from miurafab.studio.guard import Guard
from miurafab.studio.messages import Response, answer, own_file, refusal
from miurafab.studio.orders import read_order, text_of
from miurafab.studio.password import PasswordLock
from miurafab.studio.texts import texts, with_texts

PAGE, ENTER = "enter.html", "enter"
_PARTS = ("enter.js", "icon.svg", "studio.css", "texts.js")
_LONGEST_BODY = 1024


class Entrance:
    """Lets in to the studio behind ``guard`` who knows the password of ``lock``."""

    def __init__(self, guard: Guard, lock: PasswordLock) -> None:
        self._guard, self._lock = guard, lock
        self._page = resources.files(__package__).joinpath("page")

    def takes(self, path: str) -> bool:
        """Whether ``path`` is one of the addresses without a key."""
        return _name(path) in ("", ENTER, *_PARTS)

    def refuse(self, method: str, path: str, headers: Mapping[str, str]) -> Response | None:
        """The refusal of a request to one of them, or None to take it."""
        refused = self._guard.refuse_sender(method, headers)
        if refused is not None:
            return refused
        if (method == "POST") != (_name(path) == ENTER):
            return refusal(405, texts()["enter"]["not_here"])
        return None if method != "POST" else self._guard.refuse_body(headers, _LONGEST_BODY)

    def answer(self, path: str, body: bytes, address: str) -> Response:
        """The answer to a request from the network ``address``."""
        name = _name(path)
        if name != ENTER:
            content = self._page.joinpath(name or PAGE).read_bytes()
            if not name:
                content = with_texts(content.decode()).encode()
            return own_file(name or PAGE, content)
        try:
            password = text_of("password", read_order(body, ("password",)).get("password"))
        except InputError as fault:
            return refusal(400, fault.sentence)
        wait = self._lock.guess(address, password)
        if wait is None:
            sys.stderr.write(f"miurafab: a wrong password was given from {address}.\n")
            return refusal(403, texts()["enter"]["wrong"])
        if wait > 0.0:
            seconds = math.ceil(wait)
            told = refusal(429, texts()["enter"]["wait"].format(seconds=seconds))
            return Response(
                told.status, told.content_type, told.body, {"Retry-After": str(seconds)}
            )
        return answer({"address": f"/{self._guard.key}/"})


def _name(path: str) -> str:
    return path.partition("?")[0].removeprefix("/")
