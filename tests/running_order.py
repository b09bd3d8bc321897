"""Which files of tests begin first.

A file is run by one worker. pytest-xdist begins those with the most tests, so that a file with four
notebooks came last: one of two cores was idle for a minute and a half. These take the longest, or
long for the number of their tests; all others follow by name.
"""

from pathlib import Path

TESTS = Path(__file__).parent
FIRST = (
    "examples/test_pages.py",
    "test_notebooks.py",
    "origami/fitting/test_fit.py",
    "examples/test_help.py",
    "origami/fitting/test_barrier.py",
    "fabrication/test_creases.py",
    "studio/test_studio_page.py",
    "machine/test_cut_process.py",
    "machine/test_one_session.py",
    "cli/test_cut.py",
    "studio/test_studio_server.py",
    "fabrication/test_open_ring.py",
    "workflow/test_end_to_end.py",
    "test_python_api.py",
    "test_corruptions.py",
    "test_first_calls.py",
    "test_gallery.py",
    "test_cluster.py",
    "studio/test_studio_tour.py",
    "studio/test_target_page.py",
    "workflow/test_mates.py",
    "test_writing.py",
)


def place(path: Path) -> int:
    """The place of a file in that order; the same for all that are not in it."""
    name = path.relative_to(TESTS).as_posix()
    return FIRST.index(name) if name in FIRST else len(FIRST)
