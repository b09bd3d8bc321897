"""The report of a pattern on the terminal, for `fit` and `check`; JSON has every digit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from miurafab.cli.console import Console
from miurafab.workflow.report_text import headline, pattern_lines


def show_pattern(console: Console, report: Mapping[str, Any], *, opened: bool = False) -> None:
    """Print what ``report`` says of a pattern; ``opened`` if it was read from a file."""
    console.line(headline(report["status"], opened=opened))
    if report.get("advice") and not opened:
        console.line(report["advice"])
    facts = {
        line["name"]: line["value"] + (f" ({line['remark']})" if line["remark"] else "")
        for line in pattern_lines(report, whole=True)
    }
    console.facts(facts | ({"File": report["file"]} if report.get("file") else {}))
