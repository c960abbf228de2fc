"""The page about the architecture speaks of the rooms that there are, in their order, and of files that exist."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "evoclaims"
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ROOMS = {path.name for path in SOURCE.iterdir() if (path / "__init__.py").exists()}
DESCRIBED = re.findall(r"^\* \*\*(\w+)\*\*(.*?)(?=^\* |^## )", PAGE, re.MULTILINE | re.DOTALL)


def _drawn() -> list[list[str]]:
    """Return the rooms of each floor of the drawing, from above."""
    drawing = PAGE.split("```")[1]
    found = re.findall(r"^ {5}([a-z]+(?: │ [a-z]+)?)  ", drawing, re.MULTILINE)
    return [floor.split(" │ ") for floor in found]


def test_each_room_is_described_once() -> None:
    names = [name for name, _ in DESCRIBED]
    assert sorted(names) == sorted(ROOMS)
    assert len(PAGE.splitlines()) <= 90


def test_the_drawing_has_the_floors_that_the_linter_checks() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (layers,) = [c["layers"] for c in settings["tool"]["importlinter"]["contracts"] if c["type"] == "layers"]
    assert _drawn() == [layer.split(" : ") for layer in layers]
    assert {room for floor in _drawn() for room in floor} == ROOMS


def test_every_file_that_is_named_is_in_its_room() -> None:
    named = [(room, name) for room, text in DESCRIBED for name in re.findall(r"`(\w+\.py|\w+/)`", text)]
    assert len(named) > 30
    assert [(room, name) for room, name in named if not (SOURCE / room / name).exists()] == []
