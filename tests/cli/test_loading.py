"""What a command may load before its work begins: so a start costs no more than it must.

Each library here, and each of the own modules with all that they load, takes from 20 to 200 ms of
processor time. ``benchmarks/start.py`` has the times.
"""

import subprocess
import sys

import pytest

LIBRARIES = [
    "PIL",
    "matplotlib",
    "numpy",
    "reportlab",
    "scipy.fft",
    "scipy.interpolate",
    "scipy.linalg",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.sparse",
    "scipy.spatial",
    "scipy.special",
    "shapely",
    "svgwrite",
    "trimesh",
    "http.client",
    "miurafab.fabrication.sheets",
    "miurafab.origami.fitting.fit",
    "miurafab.surfaces.mesh",
]
NOTHING = set()
SHAPES = {"numpy", "shapely"}
"""What a file is read with."""

STARTS = {
    "--help": NOTHING,
    "check --help": NOTHING,
    "calibrate --help": NOTHING,
    "studio --help": NOTHING,
    "machine status --port gone": NOTHING,
    "profiles show gone": NOTHING,
    "use --machine gone": NOTHING,
    "fold --help": NOTHING,
    "energy --help": NOTHING,
    "fit --help": SHAPES,
    "cut --help": SHAPES,
    "sheets --help": SHAPES,
    "layers --help": SHAPES,
    "convert --help": SHAPES,
    "tradeoff --help": SHAPES,
    "fit gone.toml -o x.fold": SHAPES,
    "tradeoff gone.toml": SHAPES,
    "check gone.fold": SHAPES,
    "layers gone.fold": SHAPES,
    "energy gone.fold": SHAPES,
    "convert gone.fold x.svg": SHAPES,
    "sheets gone.fold -o x": SHAPES,
    "preview gone": SHAPES,
    "cut gone --port virtual": SHAPES,
    "fold gone.fold": SHAPES,
}
STARTED = """
import sys
sys.argv = ["miurafab", *sys.argv[1:]]
from miurafab.__main__ import main
try:
    main()
except SystemExit:
    print(*sorted(sys.modules), file=sys.stderr)
"""


@pytest.mark.parametrize("words", STARTS)
def test_a_command_starts_with_what_its_work_begins_with(words, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", STARTED, *words.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    loaded = set(done.stderr.splitlines()[-1].split())
    assert "miurafab.cli.program" in loaded
    assert set(LIBRARIES) & loaded <= STARTS[words]


def test_the_studio_starts_without_the_readers_of_files():
    said = "import sys, miurafab.studio.server; print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "miurafab.surfaces.profile_files" in loaded
    readers = {"ezdxf", "fontTools", "trimesh", "matplotlib", "PIL", "scipy.interpolate"}
    assert not readers & loaded
