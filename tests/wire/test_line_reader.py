"""Lines do not depend on the chunking of the bytes, and noise takes no memory."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.wire.line_reader import MOST_BYTES, LineReader


@settings(derandomize=True, max_examples=60)
@given(st.binary(max_size=80), st.lists(st.integers(0, 80)))
def test_chunks_make_no_difference(data: bytes, cuts: list[int]) -> None:
    pieces, reader = sorted({0, *cuts, len(data)}), LineReader()
    chunks = [data[a:b] for a, b in pairwise(pieces)]
    assert [text for chunk in chunks for text in reader.take(chunk)] == LineReader().take(data)


def test_edges_and_empty_lines_go_and_other_bytes_stand_as_escapes() -> None:
    assert LineReader().take(b"\r\n XX\r\n\x84\n\0<Idle>\nrest") == [" XX", "\\x84", "<Idle>"]
    assert LineReader(b"\r\0 ").take(b" ok \r\n \n") == ["ok"]


def test_noise_without_an_end_is_given_out_and_forgotten() -> None:
    reader = LineReader()
    assert reader.take(b"x" * MOST_BYTES) == []
    assert reader.take(b"y") == ["x" * MOST_BYTES + "y"]
    assert reader.take(b"ok\n") == ["ok"]
