"""The same bytes on the same processor; on another kind, coordinates within 1e-6 mm."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FIT = """
import miurafab.__main__, sys
import miurafab as mf
mf.fit(sys.argv[1], facets=(6, 6), size=120).pattern.save(sys.argv[2])
"""


def fitted(target: str, path: Path, kernel: str) -> bytes:
    """The pattern of ``target``, with the linear algebra that OpenBLAS has for ``kernel``."""
    subprocess.run(
        [sys.executable, "-c", FIT, target, path],
        env={**os.environ, "OPENBLAS_CORETYPE": kernel},
        check=True,
        capture_output=True,
    )
    return path.read_bytes()


def has_both() -> bool:
    """Whether this processor can run the newer of the two kernels."""
    known = Path("/proc/cpuinfo")
    return known.is_file() and "avx2" in known.read_text()


@pytest.mark.skipif(not has_both(), reason="needs a processor with AVX2, and Linux to tell")
def test_another_kernel_moves_no_vertex_by_a_millionth(tmp_path: Path) -> None:
    old, new = (fitted("hypar", tmp_path / f"{k}.fold", k) for k in ("Nehalem", "Haswell"))
    first, second = json.loads(old), json.loads(new)
    frames = [(first, second), (first["file_frames"][0], second["file_frames"][0])]
    for one, other in frames:
        points = [np.array(frame["vertices_coords"]) for frame in (one, other)]
        np.testing.assert_allclose(*points, rtol=0, atol=1e-6)
    assert first["edges_assignment"] == second["edges_assignment"]
    assert old != new  # the kernels differ in the last digits
