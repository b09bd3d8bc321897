"""What a command left behind, and what a failure must look like."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Done:
    returncode: int
    stdout: str
    stderr: str


def sentence(done, exit_code):
    """The one sentence of a failure; nothing else may have been printed."""
    assert done.returncode == exit_code, done
    assert "Traceback" not in done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("miurafab: ")
    assert lines[0].endswith(".")
    return lines[0]
