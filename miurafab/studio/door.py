"""The way in for the browser that the studio opens: the key stands on no command line.

Every user of a computer can read the command lines of all processes. The browser is therefore
started with the address of a file that only its owner can read (mode 0600, in a folder of mode
0700). The file sends the browser to an address with a code of 192 random bits, which the server
answers once: with the address that holds the key.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from pathlib import Path

from miurafab.studio.guard import ADDRESS, Guard, new_key, same_key
from miurafab.studio.messages import Response

_PAGE = """<!doctype html>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}">
<title>miurafab studio</title>
<p>If the studio does not open here, open the address that 'miurafab studio' printed.</p>
"""
_ONCE = "/once/"


class Door:
    """Lets one browser in to the studio behind ``guard``: the one that reads ``file``.

    The file is made in ``folder``, which must be its owner's alone. It is removed when its code
    has been used.
    """

    def __init__(self, guard: Guard, folder: Path) -> None:
        self.file = folder / "open.html"
        self._guard = guard
        self._code: str | None = new_key()
        self._lock = threading.Lock()
        address = f"http://{ADDRESS}:{guard.port}{_ONCE}{self._code}"
        opened = os.open(self.file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(opened, "w", encoding="utf-8", newline="\n") as file:
            file.write(_PAGE.format(address=address))

    def answer(self, method: str, path: str, headers: Mapping[str, str]) -> Response | None:
        """The way to the page, if ``path`` holds the code and nobody has used it; else None."""
        if method != "GET" or not path.startswith(_ONCE) or not self._guard.is_named(headers):
            return None
        with self._lock:
            if self._code is None or not same_key(path.removeprefix(_ONCE), self._code):
                return None
            self._code = None
            self.file.unlink(missing_ok=True)
        text = {"Location": self._guard.address}
        return Response(303, "text/plain; charset=utf-8", b"", text)
