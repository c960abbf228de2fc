"""The examples of docs/judging.md: a table of verdicts, and one verdict computed from the records without evoclaims."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from evoclaims.cli import main

ROOT = Path(__file__).parents[2]
PAGE, _, SECTION = (ROOT / "docs" / "judging.md").read_text(encoding="utf-8").partition("## One verdict, by hand")


def test_the_verdict_computed_by_hand_is_that_of_the_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", SECTION, re.DOTALL)
    told = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert code.rstrip().endswith(f"\n# {told.strip()}")
    (p,) = re.findall(r"p = \S+ against", told)
    shown = r"`evoclaims (status .*?)` prints this table:\n\n```text\n(.*?)```"
    ((command, table),) = re.findall(shown, PAGE, re.DOTALL)
    asked = [*shlex.split(command), "--why", "--storage", str(tmp_path)]
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", "104")
    main(asked)
    judged = capsys.readouterr().out
    assert judged.replace("†", " ").startswith(table)
    assert re.search(
        rf"O5\b.*smaller than claimed.*{re.escape(p)} an effect as large as claimed <= alpha = 0\.04", judged, re.DOTALL
    )


def test_the_assertion_that_is_shown_is_the_claims_own() -> None:
    (shown,) = re.findall(r"`(ppo\.passes_at_most.*?)`\. It", SECTION)
    claim = (ROOT / "claims" / "test_obstacles.py").read_text(encoding="utf-8").partition('"O5",')[2]
    assert f"verdict({shown})" in claim
