"""A log file to append to without waiting for the disk.

A slow disk (an SD card may take a second for one ``fsync``) must hold up neither the streaming
nor a Ctrl-C. So :meth:`DurableFile.append` only leaves the bytes for a thread, which writes and
fsyncs them; a fault on the way is kept and raised where it can be answered, by :meth:`check`.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from pathlib import Path

from miurafab.errors import InputError, MachineError
from miurafab.files import write_bytes

_PERIOD = 0.25  # s between two fsyncs


class DurableFile:
    """``path``, open for appending; ``noun`` is how messages call it ("journal").

    The opening writes ``header`` and waits until it is on the disk, so that a directory that
    cannot be written and a disk that is full show before anything moves. A new file comes into
    being with its whole header. Raises :class:`~miurafab.errors.InputError`, also for a link
    or a pipe: a job of a stranger must not name what is written.
    """

    def __init__(self, path: Path, noun: str, header: bytes, *, append: bool) -> None:
        self._path = path
        self._noun = noun
        self._left: deque[bytes] = deque()
        self._fault: OSError | None = None
        self._wake = threading.Event()
        self._closing = False
        if path.is_symlink():
            raise InputError(f"The {noun} {path} is a link; remove it.")
        if path.is_fifo():  # whose opening would wait for ever
            raise InputError(f"The {noun} {path} is a pipe; remove it.")
        for above in path.parents:
            if above.exists() and not above.is_dir():
                raise InputError(f"The {noun} {path} cannot be written: {above} is not a folder.")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            new = not append or not path.exists()
            if new:
                write_bytes(path, header)
            self._file = path.open("ab", buffering=0)
            try:
                self._put(b"" if new else header)
            except OSError:
                self._file.close()
                raise
        except InputError as fault:
            raise InputError(f"The {noun} {fault.sentence}") from None
        except OSError as fault:
            raise InputError(f"The {noun} {path} cannot be written: {fault.strerror}.") from None
        self._thread = threading.Thread(target=self._work, name=f"miurafab {noun}", daemon=True)
        self._thread.start()

    def append(self, data: bytes) -> None:
        """Queue ``data`` for writing; returns at once."""
        self._left.append(data)

    def check(self) -> None:
        """Raise :class:`~miurafab.errors.MachineError` if something could not be written."""
        if self._fault is not None:
            raise MachineError(
                f"The {self._noun} {self._path} can no longer be written: {self._fault.strerror}."
            )

    def close(self) -> None:
        """Write the queued data, wait until it is on the disk, and close the file."""
        self._closing = True
        self._wake.set()
        self._thread.join()
        self._file.close()

    def _work(self) -> None:
        while not self._closing and self._fault is None:
            self._wake.wait(_PERIOD)
            self._flush()
        self._flush()

    def _flush(self) -> None:
        # Taken item by item: the other thread may append meanwhile.
        data = b"".join([self._left.popleft() for _ in range(len(self._left))])
        if data and self._fault is None:
            try:
                self._put(data)
            except OSError as fault:
                self._fault = fault

    def _put(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]
        os.fsync(self._file.fileno())
