"""`evoclaims report` in the tiny project: what it writes, prints and returns."""

from __future__ import annotations

from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project


@pytest.fixture(autouse=True)
def _three_claims(evoclaims: Evoclaims, project: Project) -> None:
    project.write(a="supported", b="refuted", c="error")


def test_the_page_is_written_and_named_with_the_totals(evoclaims: Evoclaims) -> None:
    assert evoclaims("run", "right")[0] == 0
    status, out, err = evoclaims("report")
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        "wrote report/index.html",
        "claims (full): 3 not run",
        "claims (smoke): 1 supported, 2 not run",
    ]
    page = Path("report/index.html").read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>")
    assert [f'id="{anchor}"' in page for anchor in ("a-full", "a-smoke")] == [True, True]
    assert "<blockquote>a at full size</blockquote>" in page
    assert "a in small" in page


def test_one_tier_alone_still_shows_the_papers_sentence(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("report", "--tier", "smoke", "--out", "there/deep")
    assert status == 0
    assert out.splitlines()[-1] == "claims (smoke): 3 not run"
    page = Path("there/deep/index.html").read_text(encoding="utf-8")
    assert 'id="a-smoke"' in page
    assert 'id="a-full"' not in page
    assert "<blockquote>a at full size</blockquote>" in page


def test_an_empty_store_without_references_makes_a_page_that_says_so(evoclaims: Evoclaims) -> None:
    assert evoclaims("report")[0] == 0
    page = Path("report/index.html").read_text(encoding="utf-8")
    assert "No claim has been judged: neither the store nor the committed reference trials hold" in page


def test_the_accepted_verdicts_are_read(evoclaims: Evoclaims) -> None:
    Path("verdicts.toml").write_text("schema = 99\n")
    status, _, err = evoclaims("report")
    assert status == 2
    assert "its schema is 99" in err


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--tier", "fulll"), "There is no tier named 'fulll'. Did you mean 'full'? Known: all, full, smoke."),
        (("--out", "pyproject.toml"), "Cannot write pyproject.toml/index.html: "),
        (("--storage", "pyproject.toml"), "is a file, not a folder"),
    ],
)
def test_a_mistake_is_a_sentence(evoclaims: Evoclaims, arguments: tuple[str, ...], text: str) -> None:
    status, _, err = evoclaims("report", *arguments)
    assert status == 2
    assert text in " ".join(err.split())
