"""How long the full tier took, as docs/performance.md says, is what the committed records say."""

from __future__ import annotations

from pathlib import Path

from evoclaims.paper.spent import spent
from evoclaims.report.live_line import duration
from reproductions.nisioti2025 import REPRODUCTION

PAGE = " ".join((Path(__file__).parents[2] / "docs" / "performance.md").read_text(encoding="utf-8").split())


def test_the_time_of_the_whole_full_tier_is_that_of_its_records() -> None:
    files = sorted((REPRODUCTION.references / "full").iterdir())
    costs = [spent(REPRODUCTION, "full", *file.stem.split("-", 1)) for file in files]
    assert all(cost.trials == 10 for cost in costs)
    total = duration(sum(cost.seconds.get("NVIDIA H200", 0.0) for cost in costs))
    assert f"**In all {total}** for the {len(files)} conditions of the full tier" in PAGE
