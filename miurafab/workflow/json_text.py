"""Answers as JSON, which has no word for numbers that are infinite or none."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def json_text(value: Any, *, one_line: bool = False) -> str:
    """``value`` as JSON, for people to read unless on ``one_line``; what is no finite number
    becomes null.
    """
    indent, separators = (None, (",", ":")) if one_line else (2, None)
    return json.dumps(_finite(value), indent=indent, separators=separators, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
