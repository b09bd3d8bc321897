"""A studio to be asked without a socket: its orders are noted, and done only if they are to be."""

import json
from pathlib import Path

from miurafab.errors import MiurafabError
from miurafab.studio.core import Studio
from miurafab.studio.guard import Guard
from miurafab.studio.messages import HttpRequest
from miurafab.studio.session import Bench
from miurafab.studio.work import carry_out, failure

PORT, KEY = 8123, "k" * 32
ORIGIN = f"http://127.0.0.1:{PORT}"
GUARD = Guard(PORT, KEY)


class Waiting:
    """An order whose news is what the test says."""

    def __init__(self, order):
        self.order, self.coming, self.stopped = order, [], False

    def news(self):
        said, self.coming = self.coming, []
        return said

    def stop(self):
        self.stopped = True


class Done(Waiting):
    """An order that is carried out at once, in this process."""

    def __init__(self, order):
        super().__init__(order)
        try:
            carry_out(order, lambda news: self.coming.append(json.loads(json.dumps(news))))
            self.coming.append({"done": True})
        except (MiurafabError, OSError) as fault:
            self.coming.append({"error": failure(fault)})


class Asked:
    """A studio and short ways to ask it; ``orders`` are those that it has started."""

    def __init__(self, folder: Path, running=Waiting, first=None):
        self.orders, self.running = [], running

        def start(order):
            self.orders.append(self.running(order))
            return self.orders[-1]

        self.studio = Studio(Bench(folder, start), GUARD, first)

    def get(self, route=""):
        return self.studio.handle(request("GET", route))

    def post(self, route, body, **headers):
        return self.studio.handle(request("POST", route, body, **headers))

    def state(self):
        return self.get("state").json()

    def upload(self, name, content):
        return self.post("upload", content, x_file_name=name)

    def fit(self, surface="plane", facets="4x4", **options):
        target = {"surface": surface}
        return self.post("fit", {"target": target, "options": {"facets": facets, **options}})


def request(method, route, body=b"", **headers):
    content = body if isinstance(body, bytes) else json.dumps(body).encode()
    given = {"host": f"127.0.0.1:{PORT}"}
    if method == "POST":
        given |= {"origin": ORIGIN, "x-studio-key": KEY, "content-length": str(len(content))}
    given |= {name.replace("_", "-"): value for name, value in headers.items()}
    return HttpRequest(method, f"/{KEY}/{route}", given, content)


def sentence(response, status=400):
    """The one sentence of a refusal."""
    assert response.status == status, response
    said = response.json()
    assert list(said) == ["error"]
    assert said["error"].endswith(".")
    assert "Traceback" not in said["error"]
    return said["error"]


def saddle_obj(count=12):
    """A shallow saddle, 100 mm wide, as an OBJ file."""
    side = [100 * at / (count - 1) - 50 for at in range(count)]
    points = [f"v {x} {y} {(x * x - y * y) / 250}" for y in side for x in side]
    corners = [row * count + column + 1 for row in range(count - 1) for column in range(count - 1)]
    faces = [f"f {at} {at + 1} {at + count + 1} {at + count}" for at in corners]
    return "\n".join([*points, *faces, ""]).encode()
