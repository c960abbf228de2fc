"""The repository that the guide shows is made from the guide, word for word, and run."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

GUIDE = Path(__file__).parents[2] / "docs" / "extending.md"


def files() -> dict[str, str]:
    """Return the guide's files by name: each block follows a line that ends with its name in backquotes and a colon."""
    found = re.findall(r"`([\w/.]+)`:\n\n```\w+\n(.*?)```", GUIDE.read_text(encoding="utf-8"), flags=re.DOTALL)
    return dict(found)


def test_the_guide_shows_every_file_and_each_is_short() -> None:
    assert set(files()) == {
        "pyproject.toml",
        "hill_climber.py",
        "majority.py",
        "our_paper.py",
        "claims/test_majority.py",
    }
    for name, text in files().items():
        assert sum(bool(line.strip()) for line in text.splitlines()) <= 30, name


def test_the_guide_s_repository_comes_to_a_verdict(pytester: pytest.Pytester) -> None:
    for name, text in files().items():
        path = pytester.path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    result = pytester.runpytest_subprocess("-m", "smoke", "--claims-json=out.json", "-p", "no:xdist")
    assert result.ret == 0
    claims = json.loads((pytester.path / "out.json").read_text())["claims"]
    assert [(claim["claim"], claim["outcome"]) for claim in claims] == [("H1", "supported")]
