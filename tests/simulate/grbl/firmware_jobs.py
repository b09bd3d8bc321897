"""Jobs that were timed on the firmware's own binary, beyond the recorded ones.

GRBL 1.1h, built as its Makefile says, ran in an instruction-level simulator of its processor, fed
at 115200 baud by character counting with 1 ms of latency: the seconds from the first step to the
last, and with the beam on. ``FAST`` are the settings of the recordings, ``GENTLE`` slower ones.
"""

from __future__ import annotations

import math

FAST: dict[int, float] = {
    **dict.fromkeys((100, 101, 102), 80),
    **dict.fromkeys((110, 111, 112), 12000),
    **dict.fromkeys((120, 121, 122), 1000),
    30: 1000,
    31: 0,
    32: 1,
}
GENTLE = {**FAST, 110: 5000, 111: 5000, 120: 300, 121: 300, 11: 0.02}
STOCK: dict[int, float] = {30: 1000, 32: 1}


def dashes(count: int, dash: float, gap: float, feed: int) -> str:
    """Along X, the gaps as rapid moves."""
    lines = ["G21", "G90", "G0 X0 Y0", f"M4 S300 F{feed}"]
    x = 0.0
    for i in range(count):
        lines.append(f"G0 X{x + gap:.3f}")
        x += gap + dash
        lines.append(f"G1 X{x:.3f}" + (f" F{feed}" if i == 0 else ""))
    return "\n".join([*lines, "M5", ""])


def slanted(count: int, dash: float, gap: float, feed: int) -> str:
    """Across the grid, the words trimmed."""
    lines = ["G21G90", "M4S300"]
    along = 0.0
    for i in range(count):
        lines.append(f"G0X{0.8 * (along + gap):.3f}Y{0.6 * (along + gap):.3f}")
        along += gap + dash
        lines.append(f"G1X{0.8 * along:.3f}Y{0.6 * along:.3f}" + (f"F{feed}" if i == 0 else ""))
    return "\n".join([*lines, "M5", ""])


def circle(chords: int, turns: int, radius: float, feed: int) -> str:
    """Round and round in chords."""
    angles = (2 * math.pi * i / chords for i in range(1, turns * chords))
    points = (f"G1X{radius * (math.cos(a) - 1):.3f}Y{radius * math.sin(a):.3f}" for a in angles)
    return "\n".join([f"M4S300F{feed}", *points, "M5", ""])


GREY = "\n".join(
    ["M4F6000", *(f"G1X{0.1 * i:.1f}S{37 * i % 1000}" for i in range(1, 800)), "M5", ""]
)
PIERCED = "\n".join(
    ["G90", *(f"G0X{2.5 * i:.2f}\nM3S300\nG1X{2.5 * i + 1.5:.2f}F2000\nM5" for i in range(60)), ""]
)

TIMED: dict[str, tuple[str, dict[int, float], float, float]] = {
    "dashes of 0.2 mm": (dashes(700, 0.2, 0.2, 6000), FAST, 4.1301, 2.0568),
    "dashes of 0.3 mm": (dashes(600, 0.3, 0.2, 6000), FAST, 3.8127, 2.2783),
    "dashes of 0.5 mm": (dashes(400, 0.5, 0.5, 4000), FAST, 6.0262, 3.0521),
    "dashes of 5 mm": (dashes(100, 5, 2, 8000), FAST, 5.3540, 3.8268),
    "slow dashes": (dashes(150, 1, 1, 500), FAST, 25.3305, 18.0054),
    "slanted dashes": (slanted(600, 0.3, 0.2, 6000), FAST, 4.1774, 2.4544),
    "slanted dashes of 0.25 mm": (slanted(600, 0.25, 0.15, 3000), FAST, 4.8370, 3.0323),
    "a fine circle": (circle(300, 4, 10, 6000), FAST, 4.3143, 4.3044),
    "grey scale": (GREY, FAST, 2.2020, 2.2007),
    "pierced by M3 and M5": (PIERCED, FAST, 11.7166, 6.2033),
    "dashes of 0.2 mm, gently": (dashes(700, 0.2, 0.2, 6000), GENTLE, 6.9550, 3.4759),
    "slanted dashes, gently": (slanted(600, 0.3, 0.2, 6000), GENTLE, 5.9808, 3.5125),
    "a fine circle, gently": (circle(300, 4, 10, 6000), GENTLE, 5.8112, 5.8015),
    "grey scale, gently": (GREY, GENTLE, 2.8261, 2.8238),
    "pierced by M3 and M5, gently": (PIERCED, GENTLE, 18.6236, 9.9895),
    "dashes of 0.2 mm as delivered": (dashes(700, 0.2, 0.2, 6000), STOCK, 37.8655, 18.8931),
    "slanted dashes as delivered": (slanted(600, 0.3, 0.2, 6000), STOCK, 32.5370, 19.4521),
}
"""By name: the job, the settings over the stock ones, the seconds in all and with the beam on."""
