"""How long the full tier took, as docs/performance.md says, is what the committed records say."""

from __future__ import annotations

from pathlib import Path

from evoclaims.paper import references
from evoclaims.paper.cost import took
from evoclaims.report.live_line import duration
from reproductions.nisioti2025 import REPRODUCTION

PAGE = " ".join((Path(__file__).parents[2] / "docs" / "performance.md").read_text(encoding="utf-8").split())

NUMBERS = {8: "eight", 15: "fifteen"}


def test_the_time_of_the_whole_full_tier_is_that_of_its_records() -> None:
    files = sorted((REPRODUCTION.references / "full").glob("*.jsonl"))
    trials = [references.load(file) for file in files]
    assert sorted({len(each) for each in trials}) == [10, 30]
    assert f"of {NUMBERS[sum(len(each) == 30 for each in trials)]} conditions thirty" in PAGE
    on = {card: [took(each).get(card, 0.0) for each in trials] for card in ("NVIDIA H200", "NVIDIA H100 80GB HBM3")}
    h200, h100 = on.values()
    assert f"**In all {duration(sum(h200))}** for {sum(map(bool, h200))} of the {len(files)} conditions" in PAGE
    assert f"{NUMBERS[sum(map(bool, h100))]} ran three at a time on an H100, in {duration(sum(h100))}" in PAGE
