"""A studio at a practice machine on a pseudo-terminal: the bytes that came, and short requests."""

from __future__ import annotations

import contextlib
import threading
import time

from benches import Bench
from studios import Asked, request

from miurafab.machine.sleeping import slept_s
from miurafab.profiles.own import OwnDefaults, write_defaults
from miurafab.studio.core import Studio
from miurafab.studio.desk import Desk

MACHINE = "grbl-laser-400"
LINE = "M4 S0\nG0 X5 Y5\nG1 X15 S500 F3000\nM5\nG0X0Y0\n"
ROWS = "M4 S0\n" + "".join(f"G0 X5 Y{n % 300}\nG1 X35 S500 F2000\n" for n in range(200)) + "M5\n"


class Pumped:
    """A bench whose device lives by itself, in a thread; ``with Pumped(...) as bench``.

    The configuration folder of the test names its port, so that a studio lists it.
    """

    def __init__(self, *faults: str, speed: float = 1.0, limit: float = 120.0) -> None:
        self._limit = limit
        self.bench = Bench(*faults, speed=speed)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._pump, daemon=True)
        write_defaults(OwnDefaults(port=self.bench.wire.address))

    def _pump(self) -> None:
        with contextlib.suppress(AssertionError):  # the limit of a test that hangs
            self.bench.run(self._over.is_set, self._limit)

    def __enter__(self) -> Bench:
        self._thread.start()
        return self.bench

    def stop(self) -> Bench:
        """The bench, whose time passes no more by itself."""
        self._over.set()
        self._thread.join()
        return self.bench

    def __exit__(self, *_: object) -> None:
        self.stop().wire.close()


def until(true, seconds=30.0):
    """Wait until ``true()``, and what it then is."""
    end = time.monotonic() + seconds
    while not (found := true()):
        assert time.monotonic() < end, "it never came"
        time.sleep(0.01)
    return found


class AtMachine(Asked):
    """A studio asked without a socket, connected to a machine with a job on it."""

    def __init__(self, folder, job, port, *, asleep=slept_s):
        super().__init__(folder)
        self.desk = Desk(asleep=asleep)
        self.studio = Studio(self.studio.bench, self.studio.guard, desk=self.desk, own_job=job)
        self.control = ""
        self.port = port
        self.connect()

    def connect(self):
        answered = self.post("machine/connect", {"port": self.port, "machine": MACHINE})
        assert answered.status == 200, answered
        self.control = answered.json()["control"]
        self.until(busy="", state="Idle")
        self.ok("job")

    def ask(self, route, **order):
        return self.post(f"machine/{route}", {"control": self.control} | order)

    def ok(self, route, **order):
        answered = self.ask(route, **order)
        assert answered.status == 200, answered
        return answered.json()

    def seen(self, after=0):
        return self.get(f"machine?after={after}").json()

    def until(self, **wanted):
        """Wait until the state has these values, and the whole state then."""

        def there():
            seen = self.seen()
            return all(seen.get(key) == value for key, value in wanted.items()) and seen

        return until(there)

    def start(self):
        """The two steps of a start."""
        self.ok("start", code=self.ok("arm")["armed"]["code"])


__all__ = ["LINE", "MACHINE", "ROWS", "AtMachine", "Pumped", "request", "until"]
