"""How long the first picture of a target takes after it is chosen in the studio: processor time.

    python benchmarks/first_picture.py

For each target the time of the studio for the answer, and that of the page from the choice to the
picture that is drawn (its main thread, in headless Chromium with a renderer in software). The
targets: some built-in surfaces, a formula, a height map, and meshes of 800 to 80,000 triangles,
whose second picture (how the fit lays them) comes after, from a process of its own.
"""

from __future__ import annotations

import io
import json
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from browser import Browser

from miurafab.studio.core import Studio
from miurafab.studio.guard import Guard
from miurafab.studio.messages import HttpRequest
from miurafab.studio.server import _Server
from miurafab.studio.session import Bench
from miurafab.studio.worker import Process

SURFACES = ("hypar", "vase", "log-spiral", "revolution", "formula")
SADDLE = Path(__file__).parents[1] / "patterns" / "saddle.stl"
DRAWN = """import('./target_scene.js').then(({ TargetScene, unpack }) => {
  window.scene ??= new TargetScene(document.getElementById('target-canvas'), () => {});
  window.scene.show([unpack(window.told)]);
  return new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)));
})"""
"""What the page does with an answer, up to the drawn frame."""


def files() -> dict[str, bytes]:
    """A height map of 512 x 512 pixels and three meshes."""
    held = io.BytesIO()
    steps = np.linspace(-3, 3, 512)
    shades = 127 + 120 * np.outer(np.sin(steps), np.cos(steps))
    Image.fromarray(shades.astype(np.uint8)).save(held, "PNG")
    balls = {n: trimesh.creation.icosphere(n, 50).export(file_type="stl") for n in (5, 6)}
    return {
        "hills.png": held.getvalue(),
        "saddle.stl (800)": SADDLE.read_bytes(),
        "ball.stl (20,480)": balls[5],
        "ball.stl (81,920)": balls[6],
    }


def main() -> None:
    """Print a line for each target."""
    folder = Path(tempfile.mkdtemp())
    server = _Server(0, lambda: None)
    guard = Guard(server.server_port, "k" * 32)
    bench = Bench(folder, Process)
    studio = server.studio = Studio(bench, guard)
    targets: dict[str, dict[str, object]] = {name: {"surface": name} for name in SURFACES}
    for name, content in files().items():
        source = bench.add_upload(name.partition(" ")[0], content).id
        parameters = {"height": "20"} if name.endswith(".png") else {}
        targets[name] = {"source": source, "parameters": parameters}
    threading.Thread(target=server.serve_forever, daemon=True).start()
    head = {
        "host": f"127.0.0.1:{guard.port}",
        "origin": guard.address.rpartition(f"/{guard.key}")[0],
    }
    print(f"{'target':20} {'studio, s':>10} {'page, s':>9}")
    with Browser(folder / "profile") as page:
        page.open(guard.address)
        page.run("new Promise((done) => setTimeout(done, 1500))")
        page.run("document.getElementById('follow').click()")
        page.call("Performance.enable", timeDomain="threadTicks")
        for name, target in targets.items():
            body = json.dumps({"target": target, "options": {}}).encode()
            headers = {**head, "x-studio-key": guard.key, "content-length": str(len(body))}
            asked = HttpRequest("POST", f"/{guard.key}/target", headers, body)
            begun = time.thread_time()
            answer = studio.handle(asked).json()
            spent = time.thread_time() - begun
            studio.sight.stop()
            picture = json.dumps(answer["picture"])
            before = busy(page)
            page.run(f"window.told = {picture}; 0")
            page.run(DRAWN)
            print(f"{name:20} {spent:10.3f} {busy(page) - before:9.3f}", flush=True)
    studio.live.stop()
    server.shutdown()


def busy(page: Browser) -> float:
    """Seconds of processor time of the main thread of the page."""
    metrics = page.call("Performance.getMetrics")["metrics"]
    return float(next(each["value"] for each in metrics if each["name"] == "TaskDuration"))


if __name__ == "__main__":
    main()
