"""What the program settles before it loads anything."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

THREADS = "import os, miurafab.__main__, scipy.linalg; print(len(os.listdir('/proc/self/task')))"


def threads_of_a_program(**more):
    kept = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", THREADS],
        cwd=Path(__file__).parents[2],
        env=kept | more,
        capture_output=True,
        text=True,
        check=True,
    )
    return int(done.stdout)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs Linux to count threads")
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one processor: one thread in any case")
def test_small_matrices_get_one_thread_unless_the_user_says_otherwise():
    assert threads_of_a_program() == 1
    assert threads_of_a_program(OPENBLAS_NUM_THREADS="2") > 1


def test_the_tests_have_the_threads_of_the_program():
    assert "OPENBLAS_NUM_THREADS" in os.environ
