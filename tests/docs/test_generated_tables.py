"""The tables in README and in the guides are what the committed reference trials give."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from evoclaims import cli

ROOT = Path(__file__).parents[2]
PAGES = tuple(
    path.relative_to(ROOT)
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
    if "\n<!-- evoclaims: " in path.read_text(encoding="utf-8")
)


def test_the_tables_are_as_the_reference_trials_give_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert Path("README.md") in PAGES
    copies = [shutil.copy(ROOT / page, tmp_path / page.name) for page in PAGES]
    monkeypatch.chdir(ROOT)
    status = cli.main(["tables", *map(str, copies)])
    assert status == 0, f"{capsys.readouterr().out}`evoclaims tables {' '.join(map(str, PAGES))}` writes them anew."
