"""The command line: one module a command. A command parses, calls one library function, prints.

:mod:`miurafab.cli.program` lists the commands, and :mod:`miurafab.cli.ending` turns every end of a
command, a defect and Ctrl-C included, into one sentence and an exit code. Both are imported inside
:func:`main`, so that Ctrl-C while Python loads them is an end as any other.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from miurafab.cli.studio import ServeStudio


def main(serve_studio: ServeStudio) -> NoReturn:
    """Run the command line on ``sys.argv`` and exit; ``serve_studio`` serves the web page."""
    try:
        from miurafab.cli.ending import exit_code_of

        code = exit_code_of(lambda: _run(serve_studio))
    except KeyboardInterrupt:  # while loading, or a second Ctrl-C while the first is reported
        sys.stderr.write("miurafab: Interrupted.\n")
        code = 130
    exec("")  # CPython keeps in mind a KeyboardInterrupt in code that was executed, to die of it
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:  # the reader went away; the interpreter must not try to flush again
        os._exit(code)
    sys.exit(code)


def _run(serve_studio: ServeStudio) -> int:
    from miurafab.cli.program import run

    return run(sys.argv[1:], serve_studio)
