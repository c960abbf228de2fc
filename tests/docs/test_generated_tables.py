"""The tables in README and in the guides, and the page of the paper under test, are what its committed trials give."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from unpacked import pieces

from evoclaims import cli
from evoclaims.claims.as_published import AsPublished
from evoclaims.claims.session import Session
from evoclaims.cli.project import Project
from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import ClaimReport
from reproductions.nisioti2025 import REPRODUCTION

ROOT = Path(__file__).parents[2]
PAGES = tuple(
    path.relative_to(ROOT)
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
    if "\n<!-- evoclaims: " in path.read_text(encoding="utf-8")
)


@pytest.fixture(scope="module", autouse=True)
def judged_once() -> Iterator[None]:
    """All variants are judged once for both commands, which takes half of their time: both have an empty store."""
    known: dict[tuple[str, bool, str], list[ClaimReport]] = {}
    judge = Project.judge_sessions

    def once(project: Project, asked: Sequence[tuple[Session, str]]) -> list[list[ClaimReport]]:
        keys = [(session.variant, isinstance(session.fetch, AsPublished), tier) for session, tier in asked]
        missing = {key: one for key, one in zip(keys, asked, strict=True) if key not in known}
        known.update(zip(missing, judge(project, [*missing.values()]) if missing else (), strict=True))
        return [known[key] for key in keys]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Project, "judge_sessions", once)
        yield


def test_the_tables_are_as_the_reference_trials_give_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert Path("README.md") in PAGES
    copies = [shutil.copy(ROOT / page, tmp_path / page.name) for page in PAGES]
    monkeypatch.chdir(ROOT)
    status = cli.main(["tables", *map(str, copies)])
    assert status == 0, f"{capsys.readouterr().out}`evoclaims tables {' '.join(map(str, PAGES))}` writes them anew."


def test_the_page_is_below_8_kilobytes_a_claim_and_lacks_no_evidence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    (tmp_path / "store").mkdir()
    assert cli.main(["report", f"--storage={tmp_path / 'store'}", f"--out={tmp_path}"]) == 0
    page = (tmp_path / "index.html").read_bytes()
    text = page.decode()
    judged = re.findall(r'<section class="claim [^>]*? id="([^"]+)"[^>]*? data-verdict="(?:supp|ref|smaller|inc)', text)
    assert len(judged) == len(history.load(REPRODUCTION.folder / history.FILE))
    assert len(page) < 8_000 * len(judged)
    found = pieces(text)
    assert sum("<circle" in found[anchor] for anchor in judged) == len(judged)
    assert found["all figures"].count("<figure>") == 9
