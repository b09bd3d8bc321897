"""The texts of the page, all in one file, so that others can translate it: ``page/texts.js``."""

from __future__ import annotations

import json
import re
from functools import cache
from importlib import resources
from typing import cast

_BEGIN = "export const texts = "
_MARK = re.compile(r"@([a-z_]+)\.([a-z_]+)@")


@cache
def texts() -> dict[str, dict[str, str]]:
    """The texts by group and name.

    >>> texts()["shape"]["fit"]
    'Fit'
    """
    file = resources.files(__package__).joinpath("page", "texts.js")
    script = file.read_text(encoding="utf-8")
    return cast(
        dict[str, dict[str, str]], json.loads(script.partition(_BEGIN)[2].rstrip().rstrip(";"))
    )


def with_texts(page: str) -> str:
    """``page`` with each mark ``@group.name@`` filled in; raises ``KeyError`` for an unknown one.

    >>> with_texts("<h2>@shape.fit@</h2>")
    '<h2>Fit</h2>'
    """
    return _MARK.sub(lambda found: texts()[found[1]][found[2]], page)
