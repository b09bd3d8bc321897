"""How the studio is reached from other computers: at one address, over TLS, with a password.

Without this it listens on 127.0.0.1 alone (:mod:`~miurafab.studio.guard`).
"""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import dataclass, field
from pathlib import Path

from miurafab.errors import InputError

SHORTEST_PASSWORD = 10
"""The fewest letters of a password. With the guesses that are taken
(:mod:`~miurafab.studio.password`: one in 10 s), ten random letters and digits take 10^11 years.
"""


@dataclass(frozen=True)
class Hosting:
    """The studio at ``host``, an address or a name of this computer, for who knows ``password``.

    ``certificate`` and ``certificate_key`` are PEM files; without them a certificate is made.
    Raises :class:`~miurafab.errors.InputError` for a password that is too short or cannot be typed
    into a field, and for one of the files without the other.
    """

    host: str
    password: str = field(repr=False)
    certificate: Path | None = None
    certificate_key: Path | None = None

    def __post_init__(self) -> None:
        if len(self.password) < SHORTEST_PASSWORD:
            raise InputError(
                f"The password has {len(self.password)} letters; take {SHORTEST_PASSWORD} or more."
            )
        if not self.password.isprintable() or self.password != self.password.strip():
            raise InputError("The password has to be one line, without blanks at its ends.")
        if (self.certificate is None) != (self.certificate_key is None):
            raise InputError("Give both `certificate` and `certificate_key`, or neither of them.")


@dataclass(frozen=True)
class ServingPlace:
    """Where a server listens: the ``family`` of sockets, the ``address``, and the ``names`` by
    which browsers call it, the one to show first.
    """

    family: socket.AddressFamily
    address: str
    names: tuple[str, ...]


def place_of(host: str) -> ServingPlace:
    """The place that ``host`` names. Raises :class:`~miurafab.errors.InputError`.

    >>> place_of("127.0.0.1").names
    ('127.0.0.1',)
    """
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM, flags=socket.AI_ADDRCONFIG)
        family, address = found[0][0], str(found[0][4][0])
        known = ipaddress.ip_address(address)
    except (OSError, UnicodeError, ValueError):
        raise InputError(
            f"`host` is {host!r}, which no address is known of; give an address of this computer, "
            "such as 192.168.1.20."
        ) from None
    if known.is_unspecified:
        raise InputError(
            f"`host` is {host}, which means every network of this computer; give its address in "
            "one of them, such as 192.168.1.20."
        )
    shown = f"[{address}]" if known.version == 6 else address
    names = dict.fromkeys((shown if _is_address(host) else host.lower(), shown))
    return ServingPlace(family, address, tuple(names))


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
