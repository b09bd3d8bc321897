"""The drawing of the rooms in CONTRIBUTING is what the import rules and the folders are."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "miurafab"
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ROOMS, INNER = re.findall(r"```text\n(.*?)```", TEXT, re.DOTALL)
CONTRACTS = {
    contract["name"]: contract
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "importlinter"
    ]["contracts"]
}


def names(text: str) -> frozenset[str]:
    return frozenset(re.split(r"\s*[|,]\s*", text.strip()))


def packages(folder: Path) -> set[str]:
    return {path.parent.name for path in folder.glob("*/__init__.py")}


def drawn() -> list[frozenset[str]]:
    """The rooms of each line of the drawing; what they are for stands behind them."""
    lines = [re.split(r"\s{3,}", line.strip()) for line in ROOMS.splitlines()]
    return [names(rooms) for rooms, _ in lines]


def test_its_lines_are_the_layers():
    layers = CONTRACTS["Rooms import downward only"]["layers"]
    assert drawn() == [names(layer) for layer in layers]


def test_every_folder_and_module_of_the_package_is_a_room():
    modules = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    assert frozenset().union(*drawn()) == packages(PACKAGE) | modules


def test_rooms_within_rooms_are_the_folders():
    rows = [re.split(r"\s{2,}", line.strip()) for line in INNER.splitlines()]
    rooms = {room: packages(PACKAGE / room) for room in packages(PACKAGE)}
    assert {outer: names(inner) for outer, inner, _ in rows} == {
        room: inner for room, inner in rooms.items() if inner
    }


def test_the_towers_are_those_of_the_contracts():
    ((origami, machine),) = re.findall(
        r"The origami tower \(([^)]*)\) and\nthe machine tower \(([^)]*)\)", TEXT
    )
    for name, knows, unknown in (
        ("The origami tower does not know the machine tower", origami, machine),
        ("The machine tower does not know the origami tower", machine, origami),
    ):
        modules = [CONTRACTS[name][key] for key in ("source_modules", "forbidden_modules")]
        told = [{f"miurafab.{room}" for room in names(text)} for text in (knows, unknown)]
        assert [set(found) for found in modules] == told
