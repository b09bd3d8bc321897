"""What tests of sessions in real processes share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from benches import Terminal


@pytest.fixture
def screen() -> Iterator[Terminal]:
    screen = Terminal()
    yield screen
    screen.close()
