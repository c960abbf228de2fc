"""The plan of this paper's full tier, with long names and large numbers, on any terminal; that of a damaged store."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from rich.cells import cell_len
from tiny_project import Evoclaims, Project, forget, trials_of

from evoclaims import cli
from evoclaims.cli.project import Project as Opened
from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.report.live_line import duration
from evoclaims.trials.store import Store
from reproductions.nisioti2025 import REPRODUCTION

ROOT = Path(__file__).parents[2]


@pytest.mark.oldest
def test_the_full_plan_fits_eighty_columns_and_says_there_what_it_says_on_a_wide_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    store = tmp_path / "store"
    store.mkdir()

    known: list[Any] = []

    judge = Opened.judge_sessions

    def once(*arguments: Any) -> list[Any]:
        """Judge for the first width alone: most of a plan's time is for that."""
        known[:] = known or judge(*arguments)
        return known

    monkeypatch.setattr(Opened, "judge_sessions", once)

    def plan(columns: int) -> str:
        monkeypatch.setenv("COLUMNS", str(columns))
        status = cli.main(["plan", "--tier", "full", "--device", "cpu", "--storage", str(store)])
        out, err = capsys.readouterr()
        assert (status, err) == (0, "")
        return out

    narrow, wide = plan(80), plan(300)
    assert max(cell_len(line.rstrip()) for line in narrow.splitlines()) <= 80
    assert Counter(narrow.split()) == Counter(wide.split())
    to_run, took = (line.split()[3:] for line in wide.splitlines() if line.startswith("neat on stones "))
    assert to_run[:3] == ["0", "30", "61,440,000,000"]  # as a third look may ask
    assert re.fullmatch(r"\d+ (h|min) \d\d (min|s)", " ".join(to_run[3:7]))  # by smoke's pace on a processor
    committed = REPRODUCTION.references / "full" / "neat-stones.jsonl"
    batches = {
        timing["started"]: timing
        for timing in (json.loads(line)["timing"] for line in committed.read_text().splitlines())
    }
    seconds = sum(timing["run"] + timing["compile"] for timing in batches.values())
    assert [word for word in took if word != "–"][:4] == duration(seconds).split()  # one column for each card


@pytest.mark.oldest
def test_a_damaged_record_is_planned_and_submitted_as_a_trial_to_run_and_named_by_the_run(
    evoclaims: Evoclaims, project: Project, stored: Store
) -> None:
    """Trials of the right network are missing, so that nothing has read the wrong one's before they are counted."""
    project.write(c="verdict(trials('right', on='parity').last_success > trials('wrong', on='parity').last_success)")
    forget(stored, trials_of(stored, "hand_built")[:2])
    record = stored.record_files(trials_of(stored, "hand_built_negated")[3].id)[-1]
    torn = record.read_bytes()[:50]
    record.write_bytes(torn)
    status, out, err = evoclaims("plan")
    assert (status, err) == (0, "")
    assert re.search(r"^right on parity +8 +2 +8 +\d+ s$", out, re.MULTILINE)
    assert re.search(r"^wrong on parity +9 +1 +4 +\d+ s$", out, re.MULTILINE)
    said = evoclaims("submit", "wrong", "--dry-run", "--cluster=local")[1]
    assert "wrong on parity: 1 trial, about" in said
    for command in (["run", "wrong"], ["run", "--variant=traded"]):
        status, out, err = evoclaims(*command)
        assert (status, err.count(f"Cannot use {record}: ")) == (1, 1)
    assert "traded: The right network is wrong\n  right on parity (smoke): 1 trial to run" in out
    assert record.read_bytes() == torn


def test_a_method_whose_steps_cannot_be_timed_is_named_and_the_others_are_planned(
    evoclaims: Evoclaims, project: Project
) -> None:
    project.write(a="supported", d="error")
    status, out, err = evoclaims("plan", "--measure")
    place = 1 + Path("tiny_paper.py").read_text().splitlines().index('        raise RuntimeError("out of order")')
    said = f"RuntimeError: out of order (tiny_paper.py, line {place})"
    assert (status, err) == (1, f"evoclaims: broken on parity cannot be timed: {said}.\n")
    assert re.search(r"^broken on parity +0 +10 +4\d +unknown$", out, re.MULTILINE)
    assert re.search(r"^right on parity +0 +10 +4\d +\d+ s$", out, re.MULTILINE)
    assert re.search(r"^d +10 +0.05 ", out, re.MULTILINE)
    assert "--measure times a few steps" not in out
    assert not Path(".evoclaims/trials").exists()


def test_a_task_that_is_refused_is_refused_when_it_is_planned(
    evoclaims: Evoclaims, project: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(task: NParity) -> None:
        raise UserError(f"The robot of {task.name} is not simulated here as its file says.")

    project.write(a="supported")
    monkeypatch.setattr(NParity, "check", refuse, raising=False)
    status, out, err = evoclaims("plan")
    assert (status, out) == (2, "")
    assert err == "evoclaims: The robot of n_parity is not simulated here as its file says.\n"
