"""Links between the documents: each leads to a file that exists, and to a heading of it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md")), ROOT / "benchmarks" / "NOTEBOOK.md"]


def _prose(path: Path) -> str:
    """Return a document without its blocks of code and its comments."""
    return re.sub(r"^```.*?^```|<!--.*?-->", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(path: Path) -> set[str]:
    """Return the anchors of a document's headings, as pages of the repository and of the site have them."""
    headings = re.findall(r"^#+ (.*)$", _prose(path), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken(path: Path) -> list[str]:
    """Return the links of a document that lead nowhere."""
    targets = re.findall(r"\[[^\]]*\]\(([^)\s]+)\)", _prose(path))
    found = []
    for target in (target for target in targets if not re.match(r"[a-z]+:", target)):
        name, _, anchor = target.partition("#")
        there = (path.parent / name).resolve() if name else path
        if not there.exists() or (anchor and anchor not in anchors(there)):
            found.append(target)
    return found


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_leads_somewhere(path: Path) -> None:
    assert broken(path) == []


def test_a_link_to_nothing_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# One `two`, three?\n[a](#one-two-three) [b](#four) [c](page.md#one) [d](none.md) [e](https://x.y)\n"
    )
    assert broken(page) == ["#four", "page.md#one", "none.md"]


def test_every_document_is_a_page_of_the_site() -> None:
    site = (ROOT / "docs" / "site" / "mkdocs.yml").read_text(encoding="utf-8")
    pages = set(re.findall(r": ([\w.]+\.md)$", site, re.MULTILINE))
    there = {path.name for path in (ROOT / "docs").glob("*.md")}
    assert pages == there | {"index.md", "contributing.md", "changelog.md"}
