"""Waiting for a line is only another way to let time pass."""

from miurafab.simulate.grbl.controller import VirtualGrbl

SCRIPT = b"G91\nG1 X2 F500\nG1 Y1\n$G\nG0 X-2 Y-1\n?$$\n"


def test_line_by_line_says_what_one_long_wait_says():
    whole, stepped = (VirtualGrbl({32: 1}, baud=115_200) for _ in range(2))
    for device in (whole, stepped):
        device.receive(SCRIPT)
    whole.advance(5.0)
    lines = []
    while stepped.now < 5.0:
        stepped.advance_to_line(5.0 - stepped.now)
        lines.append(stepped.take_output())
    assert b"".join(lines) == whole.take_output()
    assert all(line.endswith(b"\n") and line.count(b"\n") == 1 for line in lines[:-1])
    assert stepped.position == whole.position
    assert stepped.now == whole.now == 5.0


def test_silence_waits_for_as_long_as_it_was_told():
    device = VirtualGrbl()
    device.advance(1.0)
    device.take_output()
    device.advance_to_line(0.25)
    assert device.now == 1.25
    assert device.take_output() == b""
