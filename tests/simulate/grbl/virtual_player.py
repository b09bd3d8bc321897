"""Plays scripts to a simulated controller: lines, raw bytes, waits and outside events."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from miurafab.simulate.grbl.controller import VirtualGrbl

BANNER = "\r\nGrbl 1.1h ['$' for help]\r\n"
LASER = {32: 1, 110: 6000, 111: 6000, 120: 500, 121: 500}
RECORDED = {
    **dict.fromkeys((100, 101, 102), 80),
    **dict.fromkeys((110, 111, 112), 12000),
    **dict.fromkeys((120, 121, 122), 1000),
    10: 3,
    30: 1000,
    31: 0,
    32: 1,
}
Step = str | bytes | float | Callable[[VirtualGrbl], object]


def ready(settings: dict[int, float] | None = None, **options: object) -> VirtualGrbl:
    """A controller after its banner."""
    device = VirtualGrbl(settings, baud=115_200, **options)
    device.advance(0.1)
    assert device.take_output().decode().startswith(BANNER)
    return device


def ask(device: VirtualGrbl, line: str, within: float = 5.0) -> str:
    """The answer to a line, up to its ok or error."""
    device.receive(line.encode("latin-1") + b"\n")
    return until_answer(device, within)


def until_answer(device: VirtualGrbl, within: float = 5.0) -> str:
    output = ""
    end = device.now + within
    while device.now < end:
        device.advance(0.001)
        output += device.take_output().decode("latin-1")
        if output.endswith("ok\r\n") or (output.endswith("\r\n") and "error:" in output):
            break
    return output


def play(device: VirtualGrbl, *steps: Step) -> str:
    """All that the controller says to the steps: a line (20 ms), bytes, a wait, or an act."""
    output = b""
    for step in steps:
        if isinstance(step, str):
            device.receive(step.encode("latin-1") + b"\n")
            device.advance(0.02)
        elif isinstance(step, bytes):
            device.receive(step)
            device.advance(0.02)
        elif isinstance(step, float):
            device.advance(step)
        else:
            step(device)
        output += device.take_output()
    return output.decode("latin-1")


def stream(device: VirtualGrbl, lines: Sequence[bytes], latency: float = 0.001) -> float:
    """Send ``lines`` by character counting; the seconds from first to last step."""
    waiting, answered = deque[int](), deque[float]()
    room, sent, done, buffer = 128, 0, 0, b""
    began = ended = None
    at = device.position
    while done < len(lines) or device.state != "Idle":
        while sent < len(lines) and len(lines[sent]) < room:
            device.receive(lines[sent] + b"\n")
            waiting.append(len(lines[sent]) + 1)
            room -= waiting[-1]
            sent += 1
        pause = device.next_event_in() or 1e-3
        if answered:
            pause = min(pause, max(answered[0] - device.now, 0.0))
        device.advance(max(pause, 1e-6))
        buffer += device.take_output()
        while b"\n" in buffer:
            line, _, buffer = buffer.partition(b"\n")
            assert line == b"ok\r"
            answered.append(device.now + latency)
        while answered and answered[0] <= device.now:
            answered.popleft()
            room += waiting.popleft()
            done += 1
        if device.position != at:
            began = device.now if began is None else began
            at, ended = device.position, device.now
    assert began is not None
    assert ended is not None
    return ended - began
