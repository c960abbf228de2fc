"""The guide's table, reproduction and claim, word for word, with results of the paper's trials as the table."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from evoclaims.paper import references

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "importing.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"`([\w/.]+)`:\n\n```python\n(.*?)```", GUIDE, flags=re.DOTALL))
(SHOWN,) = re.findall(r"```csv\n(.*?)```", GUIDE, flags=re.DOTALL)


def _table() -> str:
    """Return trials of the paper as a tracker's table; in no order, as trackers have none."""
    folder = ROOT / "reproductions" / "nisioti2025" / "reference" / "smoke"
    rows = [
        f"{algo}-stones-{trial.seed},finished,{algo},stones,{trial.seed},{trial.metrics['last_fitness']!r}\n"
        for algo in ("neat", "ppo")
        for trial in reversed(references.load(folder / f"{algo}-stones.jsonl"))
    ]
    return SHOWN.splitlines(keepends=True)[0] + "".join(rows)


def test_a_claim_about_a_table_and_its_reproduction_take_ten_lines_or_fewer() -> None:
    assert set(FILES) == {"our_paper.py", "claims/test_returns.py"}
    lines = [line for text in FILES.values() for line in text.splitlines() if line.strip()]
    assert len(lines) <= 10


@pytest.mark.parametrize("tier", ["smoke", "full"])
def test_the_guide_s_table_is_judged_and_at_the_full_tier_it_needs_no_smoke_tier(
    tier: str, pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = _table()
    assert set(SHOWN.splitlines()) <= set(table.splitlines())
    for name, text in FILES.items():
        (pytester.path / name).parent.mkdir(exist_ok=True)
        (pytester.path / name).write_text(text if tier == "smoke" else text.replace('("smoke", "full")', '("full",)'))
    (pytester.path / "runs.csv").write_text(table)
    pytester.makepyprojecttoml('[tool.evoclaims]\nreproduction = "our_paper"\n[tool.pytest.ini_options]\n')
    sys.modules.pop("our_paper", None)
    monkeypatch.setenv("COLUMNS", "160")
    result = pytester.runpytest_inprocess("claims", "-m", tier)
    result.stdout.fnmatch_lines(["R1 *NEAT earns more than PPO (Table 1) * supported *10 * 1.00 *"])
