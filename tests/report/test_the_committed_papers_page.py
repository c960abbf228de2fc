"""The page of the paper under test, made from its committed trials."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from unpacked import pieces

from evoclaims.cli import main
from evoclaims.verdicts import history
from reproductions.nisioti2025 import REPRODUCTION


def test_the_page_is_below_8_kilobytes_a_claim_and_lacks_no_evidence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    (tmp_path / "store").mkdir()
    assert main(["report", f"--storage={tmp_path / 'store'}", f"--out={tmp_path}"]) == 0
    page = (tmp_path / "index.html").read_bytes()
    text = page.decode()
    judged = re.findall(r'<section class="claim [^>]*? id="([^"]+)"[^>]*? data-verdict="(?:supp|ref|smaller|inc)', text)
    assert len(judged) == len(history.load(REPRODUCTION.folder / history.FILE))
    assert len(page) < 8_000 * len(judged)
    found = pieces(text)
    assert sum("<circle" in found[anchor] for anchor in judged) == len(judged)
    assert found["all figures"].count("<figure>") == 9
