"""The example of docs/judging.md: one verdict, computed from the committed records without evoclaims."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
SECTION = (ROOT / "docs" / "judging.md").read_text(encoding="utf-8").partition("## One verdict, by hand")[2]


def test_the_verdict_computed_by_hand_is_the_accepted_one() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", SECTION, re.DOTALL)
    told = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert code.rstrip().endswith(f"\n# {told.strip()}")
    accepted = tomllib.loads((ROOT / "reproductions/nisioti2025/verdicts.toml").read_text(encoding="utf-8"))
    last = accepted["verdicts"]["full"]["O5"][-1]
    assert last["outcome"] == "refuted"
    assert last["reason"].startswith("p = 0.00865 against it <= alpha = 0.04")
    assert "p = 0.00865 against it" in told


def test_the_assertion_that_is_shown_is_the_claims_own() -> None:
    (shown,) = re.findall(r"`(ppo\.passes_at_most.*?)`\. It", SECTION)
    claim = (ROOT / "claims" / "test_obstacles.py").read_text(encoding="utf-8").partition('"O5",')[2]
    assert f"verdict({shown})" in claim
