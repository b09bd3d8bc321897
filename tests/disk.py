"""A disk that is full, or a process that is killed, at the k-th call of the operating system.

The writers of miurafab reach the disk by functions of ``os`` alone (``pathlib`` calls them, too).
"""

import contextlib
import errno
import os
import signal
import warnings
from unittest import mock

CALLS = ("open", "write", "fsync", "replace", "unlink", "mkdir", "rmdir", "close")
NEED_ROOM = ("write", "fsync", "mkdir")


@contextlib.contextmanager
def watched(act):
    """Before each of :data:`CALLS`, ``act`` gets its number, its name, itself and its arguments."""
    numbers = iter(range(1, 1 << 30))

    def watch(name, call):
        def instead(*arguments, **named):
            act(next(numbers), name, call, arguments)
            return call(*arguments, **named)

        return instead

    with mock.patch.multiple(os, **{name: watch(name, getattr(os, name)) for name in CALLS}):
        yield


def calls_of(work):
    """The number of calls that ``work`` makes."""
    seen = []
    with watched(lambda number, *_: seen.append(number)):
        work()
    return len(seen)


def full_from(first):
    """From call ``first`` on, what needs room on the disk fails; what frees it does not."""

    def act(number, name, call, arguments):
        makes = name == "open" and arguments[1] & os.O_CREAT
        if number >= first and (name in NEED_ROOM or makes):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return watched(act)


def killed_at(last, work):
    """Do ``work`` in a process that is killed at its call ``last``, a write in the middle of it.

    Returns whether it was killed.
    """

    def act(number, name, call, arguments):
        if number == last:
            if name == "write":
                call(arguments[0], arguments[1][: len(arguments[1]) // 2])
            os.kill(os.getpid(), signal.SIGKILL)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the threads of this process, which the other lacks
        child = os.fork()
    if child == 0:
        try:
            with watched(act):
                work()
        finally:
            os._exit(0)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])
