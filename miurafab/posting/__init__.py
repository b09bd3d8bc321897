"""The one bridge between the towers: the strokes of a sheet become a job for one machine."""

from miurafab.posting.make_job import NO_PATCH, post
from miurafab.posting.text import LINE_CHARS

__all__ = ["LINE_CHARS", "NO_PATCH", "post"]
