"""A sample of `benchmarks/fuzz.py`: no damaged file is more than one sentence."""

import fuzz
import pytest

COUNTS = {"fold": 20, "mesh": 40, "image": 40, "gcode": 60, "quantity": 6, "job": 8}
"""Of the others 120; together they take some seconds."""


@pytest.mark.parametrize("name", fuzz.READERS)
def test_a_damaged_file_is_read_or_refused_in_a_sentence(name):
    tally = fuzz.fuzz(name, COUNTS.get(name, 120), seed=14)
    assert tally.faults == {}
    assert tally.executions == COUNTS.get(name, 120)
    assert tally.accepted > 0 or name in ("stock", "objpair")


def test_every_format_has_files_to_damage():
    assert {path.name for path in fuzz.CORPUS.iterdir()} == set(fuzz.READERS)


def test_a_fault_is_found(monkeypatch):
    """The fuzzer itself: a reader that lets an error out, and one that says too much."""

    def careless(path):
        float(path.read_bytes()[:5])

    monkeypatch.setitem(fuzz.READERS, "cp", careless)
    assert any("ValueError" in fault for fault in fuzz.fuzz("cp", 30).faults)

    def talkative(path):
        raise fuzz.InputError("something is wrong")

    monkeypatch.setitem(fuzz.READERS, "cp", talkative)
    assert any("without the file" in fault for fault in fuzz.fuzz("cp", 3).faults)
