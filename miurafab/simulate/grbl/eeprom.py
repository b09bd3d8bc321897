"""The EEPROM of the simulated controller: 1 KB, with the settings stored in it.

The image matters because a write takes 3.4 ms for each changed byte, and the processor is deaf
meanwhile (``eeprom.c``). So settings, stored positions, startup lines and the build note have the
firmware's layout (``settings.h``) with 32-bit floats. A write returns the number of its waits:
before each byte that follows a changed byte.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence

from miurafab.gcode.numbers import single, whole_byte
from miurafab.grbl.codes import setting_codes
from miurafab.motion.parameters import MotionParameters

SIZE = 1024
_VERSION = 10
_SETTINGS_AT, _POSITIONS_AT, _STARTUP_AT, _BUILD_NOTE_AT = 1, 512, 768, 942
LINE_SIZE = 80
POSITIONS = 8
"""G54 to G59, G28, G30."""
STARTUP_LINES = 2

_LAYOUT = struct.Struct("<12f5B4f2B2fHf")
_BYTES = (0, 2, 3, 1, 10)
_FLOATS = (11, 12, 30, 31)
_FLAGS = {13: 0, 32: 1, 4: 2, 21: 3, 22: 4, 20: 5, 5: 6, 6: 7}
_AXIS_SETTINGS = tuple(100 + 10 * kind + axis for kind in range(4) for axis in range(3))
_PER_MINUTE_SQUARED = 3600.0

NEGATIVE, TOO_SHORT_PULSE, UNKNOWN, NEEDS_HOMING = 4, 6, 3, 10
"""``error:`` codes of a refused setting."""


class FirmwareSettings:
    """The ``$`` settings, and the other stored data.

    ``values`` holds each setting by number, as the firmware would print it. Each method that writes
    returns the number of waits for a byte to be programmed.
    """

    def __init__(self) -> None:
        self.memory = bytearray(b"\xff" * SIZE)
        self.values: dict[int, float] = {}
        self.wipe("*")
        for index in range(STARTUP_LINES):
            self.store_startup_line(index, bytes(LINE_SIZE))
        self.store_build_note(bytes(LINE_SIZE))

    def write(self, values: Mapping[int, float]) -> None:
        """Store ``values``, each rounded to the firmware's type for it."""
        for number, value in values.items():
            self.values[number] = self._fit(number, value)
        self._save()

    @property
    def laser(self) -> bool:
        """$32."""
        return bool(self.values[32])

    @property
    def arc_tolerance(self) -> float:
        """$12, mm."""
        return self.values[12]

    @property
    def mist(self) -> bool:
        """The stock firmware is compiled without M7."""
        return False

    @property
    def single_precision(self) -> bool:
        """The firmware's floats have 32 bits."""
        return True

    @property
    def steps_per_mm(self) -> tuple[float, float, float]:
        """$100 to $102."""
        return self.values[100], self.values[101], self.values[102]

    @property
    def idle_lock(self) -> float | None:
        """$1 in seconds; None holds the motors without waiting."""
        return None if self.values[1] == 255 else self.values[1] * 1e-3

    def motion(self) -> MotionParameters:
        """The settings that shape motion."""
        return MotionParameters.from_settings(self.values)

    def beyond_travel(self, position: Sequence[float]) -> bool:
        """Whether ``position`` (machine mm) is outside the travel, from -$130.. to 0."""
        return any(at > 0.0 or at < -self.values[130 + axis] for axis, at in enumerate(position))

    def store(self, number: int, value: float) -> tuple[int, int]:
        """``$number=value``: the ``error:`` code (0: stored) and the waits."""
        code = self._refusal(number, value)
        if code:
            return code, 0
        self.values[number] = self._fit(number, value)
        if number == 22 and not self.values[22]:
            self.values[20] = 0.0
        return 0, self._save()

    def _refusal(self, number: int, value: float) -> int:
        if value < 0.0:
            return NEGATIVE
        if number not in self.values:
            return UNKNOWN
        if number == 0 and whole_byte(value) < 3:
            return TOO_SHORT_PULSE
        if number == 20 and whole_byte(value) and not self.values[22]:
            return NEEDS_HOMING
        return 0

    @staticmethod
    def _fit(number: int, value: float) -> float:
        if number in _FLAGS:
            return float(bool(whole_byte(value)))
        if number in _BYTES or number in (23, 26):
            return float(whole_byte(value))
        if number // 10 == 12:
            return single(single(value * _PER_MINUTE_SQUARED) / _PER_MINUTE_SQUARED)
        return single(value)

    def wipe(self, what: str) -> int:
        """Restore ``$`` settings, ``#`` stored positions, or ``*`` everything to stock."""
        waits = 0
        if what in "$*":
            self.values = {
                code.number: self._fit(code.number, code.stock) for code in setting_codes().values()
            }
            waits += self._save()
        if what in "#*":
            for index in range(POSITIONS):
                waits += self.store_position(index, (0.0, 0.0, 0.0))
        if what == "*":
            # The firmware clears the second byte where it means the checksum.
            for address in (_STARTUP_AT, _STARTUP_AT + LINE_SIZE + 1, _BUILD_NOTE_AT):
                waits += self._put(address, b"\0\0")
        return waits

    def position(self, index: int) -> tuple[float, float, float]:
        """Stored position ``index``: 0 to 5 for G54 to G59, 6 for G28, 7 for G30."""
        x, y, z = struct.unpack_from("<3f", self.memory, _POSITIONS_AT + 13 * index)
        return x, y, z

    def store_position(self, index: int, values: Iterable[float]) -> int:
        """Write a stored position."""
        return self._put_checked(
            _POSITIONS_AT + 13 * index, struct.pack("<3f", *map(single, values))
        )

    def startup_line(self, index: int) -> bytes | None:
        """The 80 bytes of startup line 0 or 1; None if their checksum is wrong."""
        return self._text(_STARTUP_AT + (LINE_SIZE + 1) * index)

    def store_startup_line(self, index: int, buffer: bytes) -> int:
        """Write the 80 bytes of the line buffer as a startup line; the firmware checks no index."""
        return self._put_checked(_STARTUP_AT + (LINE_SIZE + 1) * index, buffer)

    def build_note(self) -> bytes | None:
        """The 80 bytes that ``$I=`` stored; None if their checksum is wrong."""
        return self._text(_BUILD_NOTE_AT)

    def store_build_note(self, buffer: bytes) -> int:
        """Write the 80 bytes of the line buffer as the build note."""
        return self._put_checked(_BUILD_NOTE_AT, buffer)

    def _save(self) -> int:
        values = self.values
        axes = [values[number] for number in _AXIS_SETTINGS]
        axes[6:9] = [single(value * _PER_MINUTE_SQUARED) for value in axes[6:9]]
        axes[9:12] = [-value for value in axes[9:12]]
        flags = sum(1 << bit for number, bit in _FLAGS.items() if values[number])
        record = _LAYOUT.pack(
            *axes,
            *(int(values[number]) for number in _BYTES),
            *(values[number] for number in _FLOATS),
            flags,
            int(values[23]),
            values[24],
            values[25],
            int(values[26]),
            values[27],
        )
        return self._put(0, bytes([_VERSION])) + self._put_checked(_SETTINGS_AT, record)

    def _put(self, address: int, data: bytes) -> int:
        waits, programming = 0, False
        for offset, byte in enumerate(data):
            place = (address + offset) % SIZE
            waits += programming
            programming = self.memory[place] != byte
            self.memory[place] = byte
        return waits

    def _put_checked(self, address: int, data: bytes) -> int:
        return self._put(address, data + bytes([_checksum(data)]))

    def _text(self, address: int) -> bytes | None:
        data = bytes(self.memory[(address + i) % SIZE] for i in range(LINE_SIZE))
        if _checksum(data) != self.memory[(address + LINE_SIZE) % SIZE]:
            return None
        return data


def _checksum(data: bytes) -> int:
    """The firmware's checksum, with its logical "or" in place of a rotation."""
    total = 0
    for byte in data:
        total = ((1 if total else 0) + byte) & 0xFF
    return total
