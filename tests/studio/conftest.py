"""The studio as its requests find it, without a page."""

import pytest
from studios import Asked, Done


@pytest.fixture
def asked(tmp_path):
    """A studio whose tasks say what the test says."""
    return Asked(tmp_path)


@pytest.fixture
def done(tmp_path):
    """A studio whose tasks are carried out at once."""
    return Asked(tmp_path, Done)
