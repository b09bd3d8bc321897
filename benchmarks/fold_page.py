"""How fast the slider of the page of a motion is, in software GL.

    python benchmarks/fold_page.py [COLSxROWS] [STEPS]

Chromium draws with SwiftShader in a window of 1280 x 800 pixels. Each step moves the slider and
waits until the frame is drawn (``readPixels``). Told are the frames a second, and the processor
time of all processes of the browser for a frame, which counts on a busy machine. What moves is an
exactly flat-foldable fit of the hypar, by default with 60x60 facets.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from browser import Browser

import miurafab

_STEPS = """(async () => {
  const slider = document.getElementById("motion");
  const gl = document.getElementById("fold-canvas").getContext("webgl2");
  const pixel = new Uint8Array(4);
  const begin = performance.now();
  for (let step = 0; step < %d; step += 1) {
    slider.value = Math.round(40 * (0.5 - 0.5 * Math.cos(step / 20)));
    slider.dispatchEvent(new Event("input"));
    await new Promise((done) => requestAnimationFrame(() => {
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      done();
    }));
  }
  return [(performance.now() - begin) / 1000, gl.drawingBufferWidth, gl.drawingBufferHeight];
})()"""


def processor_seconds(process: int) -> float:
    """The processor time of a process and of all that it has started."""
    children: dict[int, list[int]] = {}
    ticks: dict[int, int] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                words = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue  # it has ended
            children.setdefault(int(words[1]), []).append(int(folder.name))
            ticks[int(folder.name)] = int(words[11]) + int(words[12])
    total, waiting = 0, [process]
    while waiting:
        each = waiting.pop()
        waiting += children.get(each, [])
        total += ticks.get(each, 0)
    return total / os.sysconf("SC_CLK_TCK")


def measure(page: Browser, steps: int) -> None:
    """Move the slider of the open page by ``steps`` and print how fast it was."""
    page.run(_STEPS % 20)
    before = processor_seconds(page.process.pid)
    seconds, width, height = page.run(_STEPS % steps)
    used = processor_seconds(page.process.pid) - before
    print(
        f"{width} x {height} pixels, {steps} steps: {steps / seconds:.1f} frames a second, "
        f"{1000 * used / steps:.1f} ms of processor time a frame "
        f"(load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores)"
    )


def main() -> None:
    """Fit, fold, write the page, and measure it."""
    facets = sys.argv[1] if len(sys.argv) > 1 else "60x60"
    steps = int(sys.argv[2]) if len(sys.argv) > 2 else 120
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.html"
        fitted = miurafab.fit("hypar", facets=facets, flat_foldable="exact")
        miurafab.fold(fitted).save(path)
        print(f"hypar {facets}, page of {path.stat().st_size / 1e6:.1f} MB")
        with Browser(Path(folder) / "profile") as page:
            page.call(
                "Emulation.setDeviceMetricsOverride",
                width=1280, height=800, deviceScaleFactor=1, mobile=False,
            )  # fmt: skip
            page.open(path)
            measure(page, steps)


if __name__ == "__main__":
    main()
