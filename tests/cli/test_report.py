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


def test_a_folder_that_cannot_be_written_is_a_sentence(evoclaims: Evoclaims) -> None:
    status, _, err = evoclaims("report", "--out", "pyproject.toml")
    assert (status, "Cannot write pyproject.toml/index.html: " in err) == (2, True)
