"""What is done on Windows and macOS, with the platform layer replaced: untried there.

The lines of a port are in test_opening, keys in test_keys, process groups in test_job_process.
"""

from __future__ import annotations

import os
import signal
import time

import pytest
import serial

from miurafab.errors import InputError, PortError
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import SerialTransport
from miurafab.machine.virtual_server import PtyWire
from miurafab.machine.watchdog import ParentWatch, framed


class ComPort:
    """pyserial's port on Windows: a write waits until its bytes are out, or for its timeout."""

    def __init__(self, room: int) -> None:
        self.room = room
        self.written = b""
        self.dtr = self.rts = True

    def open(self) -> None:
        pass

    def write(self, data: bytes) -> int:
        if len(data) > self.room:
            raise serial.SerialTimeoutException("Write timeout")
        self.room -= len(data)
        self.written += data
        return len(data)


def com(monkeypatch: pytest.MonkeyPatch, port: object) -> SerialTransport:
    monkeypatch.setattr(serial, "serial_for_url", lambda *line, **options: port)
    return SerialTransport("COM3", 9600, "xon-xoff")


@pytest.mark.parametrize(("room", "taken"), [(100, 6), (4, 4), (0, 0)])
def test_a_cutter_that_holds_its_sender_up_is_not_gone(
    room: int, taken: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bytes that the driver took are counted, and the rest is offered again."""
    port = ComPort(room)
    assert com(monkeypatch, port).offer(b"PU1,1;") == taken
    assert port.written == b"PU1,1;"[:taken]


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        (
            "could not open port 'COM3': FileNotFoundError(2, 'The system cannot find the file "
            "specified.', None, 2)",
            "The port COM3 does not exist; ",
        ),
        (
            "could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)",
            "The port COM3 may not be opened by this user, or another program has it",
        ),
        (
            "could not open port 'COM3': OSError(22, 'The semaphore timeout period has expired.', "
            "None, 121)",
            "The port COM3 cannot be opened: could not open port 'COM3': OSError",
        ),
    ],
)
def test_the_faults_of_windows_are_told(
    fault: str, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Refusing(ComPort):
        def open(self) -> None:
            raise serial.SerialException(fault)

    with pytest.raises(PortError) as caught:
        com(monkeypatch, Refusing(0))
    assert str(caught.value).startswith(sentence)


def test_a_reset_makes_what_was_ordered_before_it_void() -> None:
    read, write = os.pipe()
    with ParentWatch(read, StopSignals(), silence=60.0) as parent:
        os.write(write, framed(b"before") + b"\x18" + framed(b"after"))
        orders = [parent.next_order(20.0) for _ in range(2)]
        assert orders == [(b"before", 0), (b"after", 1)]
        assert parent.resets == 1
        assert parent.pressed() == "\x18"
    os.close(write)


def test_where_no_thread_can_be_signalled_the_process_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows has no ``pthread_kill``; the handler of the process notes the signal."""
    raised: list[int] = []
    monkeypatch.delattr(signal, "pthread_kill", raising=False)
    monkeypatch.setattr(signal, "raise_signal", raised.append)
    read, write = os.pipe()
    signals = StopSignals()
    with ParentWatch(read, signals, silence=60.0):
        os.write(write, b"\4")  # SIGBREAK, which only Windows has
        os.close(write)
        end = time.monotonic() + 20.0
        while len(raised) < 2 and time.monotonic() < end:
            time.sleep(0.001)
    os.close(read)
    number = getattr(signal, "SIGBREAK", signal.SIGTERM)
    assert raised == [number, signal.SIGTERM]
    assert signals.cause == "the end of the program that started it"


def test_a_system_without_pseudo_terminals_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "name", "nt")
    try:
        with pytest.raises(InputError, match=r"no pseudo-terminals; .*socket://localhost:PORT"):
            PtyWire()
    finally:
        monkeypatch.undo()
