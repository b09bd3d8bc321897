"""The password of a studio that other computers reach, and how slowly it can be guessed.

Guesses are judged one after another, each by scrypt (RFC 7914, N = 2^14, r = 8, p = 1: some 50 ms).
After three wrong ones an address waits for 1, 2, 4... up to 60 s. So does everybody together after
twenty, up to 10 s, because one person may have many addresses; who is in already does not wait. A
guess before its time is not judged, and so tells nothing. An IPv6 network of 64 bits is one
address.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import math
import secrets
import threading
import time
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass

_FORGOTTEN_S = 900.0
_MOST_ADDRESSES = 1024


@dataclass
class WrongGuesses:
    """How often it was wrong in a row, and when it was last (monotonic clock)."""

    free: int
    longest_s: float
    count: int = 0
    last: float = -math.inf

    def wait_s(self, now: float) -> float:
        """How long a further guess has to wait."""
        if now - self.last > _FORGOTTEN_S:
            self.count = 0
        if self.count < self.free:
            return 0.0
        pause = min(2.0 ** min(self.count - self.free, 30), self.longest_s)
        return max(0.0, self.last + pause - now)

    def one_more(self, now: float) -> None:
        """It was wrong once more."""
        self.count, self.last = self.count + 1, now


class PasswordLock:
    """Judges guesses of ``password``; every method may be called in any thread."""

    def __init__(self, password: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._salt = secrets.token_bytes(16)
        self._wanted = self._hashed(password)
        self._lock = threading.Lock()
        self._all = WrongGuesses(20, 10.0)
        self._each: dict[str, WrongGuesses] = {}

    def guess(self, address: str, password: str) -> float | None:
        """Judge a guess from the network ``address``: 0 if it is right, None if it is wrong, and
        otherwise the seconds after which a guess is judged again.
        """
        with self._lock:
            now, network = self._clock(), _network(address)
            own = self._each.get(network) or WrongGuesses(3, 60.0)
            wait = max(own.wait_s(now), self._all.wait_s(now))
            if wait > 0.0:
                return wait
            if hmac.compare_digest(self._hashed(password), self._wanted):
                self._each.pop(network, None)
                return 0.0
            own.one_more(now)
            self._all.one_more(now)
            self._each[network] = own
            while len(self._each) > _MOST_ADDRESSES:
                del self._each[next(iter(self._each))]
            return None

    def _hashed(self, password: str) -> bytes:
        given = unicodedata.normalize("NFC", password).encode("utf-8", "surrogatepass")
        return hashlib.scrypt(given, salt=self._salt, n=2**14, r=8, p=1)


def _network(address: str) -> str:
    known = ipaddress.ip_address(address.partition("%")[0])
    if known.version == 4:
        return str(known)
    mapped = known.ipv4_mapped if isinstance(known, ipaddress.IPv6Address) else None
    return str(mapped or ipaddress.ip_network((int(known) >> 64 << 64, 64)))
