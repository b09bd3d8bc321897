"""The program: the command line, and the local web page that one of its commands starts.

The rooms ``cli`` and ``studio`` do not know each other; here, above both, they meet. Also what
``python -m miurafab`` runs (``python -P -m miurafab`` where the working directory is not trusted).

OpenBLAS works in one thread here. The dense matrices of this package are small, and more threads
cost more than they bring: on two busy cores a layout took twice and a folding motion three times as
long with two threads as with one (measured). OpenBLAS reads the variable when numpy is imported.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from miurafab import cli


def main() -> NoReturn:
    """Run the command line on ``sys.argv`` and exit."""
    cli.main(_serve_studio)


def _serve_studio(
    thing: str | None,
    *,
    port: int,
    open_browser: bool,
    host: str | None,
    password: str,
    certificate: Path | None,
    certificate_key: Path | None,
    announce: Callable[[str, str], None],
) -> None:
    from miurafab.studio.hosting import Hosting  # only now: no other command waits for them
    from miurafab.studio.server import serve

    hosting = None if host is None else Hosting(host, password, certificate, certificate_key)
    serve(thing, port=port, open_browser=open_browser, hosting=hosting, announce=announce)


if __name__ == "__main__":
    main()
