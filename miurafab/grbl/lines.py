"""What a line makes the controller do, read as GRBL reads it: in capitals, without the ``/`` of
block delete, which it drops wherever it stands (``protocol.c``), so that ``/$32=0`` is a setting.

A line is what goes down the wire, without blanks and comments. GrblHAL hands a line that begins
with ``/`` to its reader of G-code, and stores nothing; what is taken for a setting there costs a
question more.
"""

from __future__ import annotations

import re

from miurafab.units import DECIMAL

_SYSTEM = re.compile(rb"\$(?!J)", re.IGNORECASE)
_SETTING = re.compile(rb"\$(?:N?[-+.\d]+|RST|I)=", re.IGNORECASE)
_PLACE = re.compile(rb"G\+?0*(?:10(?:\.0*)?(?![\d.])|(?:28|30)\.10*(?!\d))", re.IGNORECASE)
_DWELL = re.compile(rb"G\+?0*4(?:\.0*)?(?![\d.])", re.IGNORECASE)
_DWELL_SECONDS = re.compile(rf"P\+?({DECIMAL})".encode(), re.IGNORECASE)


def is_system(data: bytes) -> bool:
    """Whether a line is a ``$`` command and no jog, which moves."""
    return _SYSTEM.match(_as_read(data)) is not None


def writes_setting(data: bytes) -> bool:
    """Whether a line stores a setting, a startup block or a note: ``$N=``, ``$Nn=``, ``$RST=``,
    ``$I=``.
    """
    return _SETTING.match(_as_read(data)) is not None


def writes_eeprom(data: bytes) -> bool:
    """Whether a line makes the controller write its EEPROM: one that stores a setting, or has G10,
    G28.1 or G30.1 anywhere.
    """
    return writes_setting(data) or _PLACE.search(_as_read(data)) is not None


def dwell_seconds(data: bytes) -> float:
    """The seconds that a line makes the controller wait: the P of a G4, or 0."""
    data = _as_read(data)
    if _DWELL.search(data) is None:
        return 0.0
    match = _DWELL_SECONDS.search(data)
    return float(match[1]) if match is not None else 0.0


def _as_read(data: bytes) -> bytes:
    return data.replace(b"/", b"")
