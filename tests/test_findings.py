"""Every code stands once in the table of rules, and every rule is used."""

import json
import re
from pathlib import Path

import pytest

import miurafab
from miurafab.findings import RULES, Finding, finding_from_json, findings_json, refusals

CODE = re.compile(r'Finding\(\s*"([a-z0-9-]+)"')
MADE_ELSEWHERE = re.compile(
    r'(?:at_line|of_word|_finding|_in_moves|_power|_loss|code, says = )\(\s*"([a-z0-9-]+)"'
)
LISTED = {"planarity", "developability", "isometry", "laser-mode", "s-range", "settings"}
LISTED |= {"assignment", "fold-angle"}
"""Codes that a loop over a table of checks makes."""


def made_in_the_package():
    package = Path(miurafab.__file__).parent
    texts = [path.read_text(encoding="utf-8") for path in sorted(package.rglob("*.py"))]
    return {code for text in texts for way in (CODE, MADE_ELSEWHERE) for code in way.findall(text)}


def test_every_code_has_a_rule_and_every_rule_is_used():
    assert made_in_the_package() | LISTED == RULES.keys()


def test_only_refusals_can_be_forced():
    assert {rule.severity for rule in RULES.values() if rule.forceable} == {"refusal"}
    assert {rule.severity for rule in RULES.values()} == {"note", "warning", "refusal"}


@pytest.mark.parametrize("where", ["", "edge.nc:5", (3, 7)])
def test_a_finding_is_read_back_as_it_was_written(where):
    finding = Finding("bounds", "Raise `min_edge`.", where)
    written = json.loads(json.dumps(findings_json([finding])))
    assert list(written[0]) == ["code", "severity", "where", "sentence"]
    assert [finding_from_json(values) for values in written] == [finding]
    assert str(finding) == "Raise 'min_edge'."


def test_a_code_without_a_rule_is_a_mistake():
    with pytest.raises(KeyError, match="no-such-code"):
        finding_from_json({"code": "no-such-code", "sentence": "", "where": ""})


def test_refusals_are_what_stops_the_work():
    note, warning, refusal = (Finding(code, ".") for code in ("relative", "rate", "bounds"))
    assert refusals([note, refusal, warning]) == (refusal,)
