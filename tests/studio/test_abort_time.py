"""How soon an abort is on the wire: the measurement of benchmarks/abort.py, a few runs of it."""

from pathlib import Path

import abort
import pytest

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="needs pseudo-terminals and /proc"
)


def test_an_abort_is_on_the_wire_before_a_person_could_tell(tmp_path, monkeypatch):
    """Through HTTP, while other pages ask for the state and a job burns."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with abort.Rig(tmp_path) as rig:
        taken = [whole for whole, _ in abort.over_http(rig, 3)]
    # 11 ms in the median; the processor is shared with other tests
    assert min(taken) < 0.05, taken
