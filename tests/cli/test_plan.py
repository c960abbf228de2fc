"""The plan of this paper's full tier, which has long names and large numbers, on terminals of any width."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest
from rich.cells import cell_len

from evoclaims import cli
from evoclaims.report.live_line import duration
from reproductions.nisioti2025 import REPRODUCTION

ROOT = Path(__file__).parents[2]


@pytest.mark.oldest
def test_the_full_plan_fits_eighty_columns_and_says_there_what_it_says_on_a_wide_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    store = tmp_path / "store"
    store.mkdir()

    def plan(columns: int) -> str:
        monkeypatch.setenv("COLUMNS", str(columns))
        status = cli.main(["plan", "--tier", "full", "--device", "cpu", "--storage", str(store)])
        out, err = capsys.readouterr()
        assert (status, err) == (0, "")
        return out

    narrow, wide = plan(80), plan(300)
    assert max(map(cell_len, narrow.splitlines())) <= 80
    assert Counter(narrow.split()) == Counter(wide.split())
    to_run, took = (line.split()[3:] for line in wide.splitlines() if line.startswith("neat on stones "))
    assert to_run == ["0", "10", "20,480,000,000", "unknown"]
    committed = REPRODUCTION.references / "full" / "neat-stones.jsonl"
    batches = {
        timing["started"]: timing
        for timing in (json.loads(line)["timing"] for line in committed.read_text().splitlines())
    }
    seconds = sum(timing["run"] + timing["compile"] for timing in batches.values())
    assert took[:4] == duration(seconds).split()
