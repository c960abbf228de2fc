"""Reasons of refutations have no numbers of trials; those that docs/results.md prints are those of the records."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from evoclaims.paper.references import committed
from evoclaims.trials.result import TrialResult
from reproductions.nisioti2025 import REPRODUCTION

ROOT = Path(__file__).parents[2]
RESULTS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
Value = Callable[[TrialResult], float]


def _accepted() -> dict[str, str]:
    """Return the reasons of accepted refutations, by file and line."""
    found = {}
    for path in sorted((ROOT / "claims").glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        constants = {
            node.targets[0].id: node.value.value
            for node in tree.body
            if isinstance(node, ast.Assign)
            and isinstance(node.targets[0], ast.Name)
            and isinstance(node.value, ast.Constant)
        }
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            if isinstance(call.func, ast.Name) and call.func.id == "expected":
                (reason,) = (keyword.value for keyword in call.keywords if keyword.arg == "because")
                text = constants[reason.id] if isinstance(reason, ast.Name) else ast.literal_eval(reason)
                found[f"{path.name}:{call.lineno}"] = str(text)
    return found


def test_no_reason_has_numbers_of_trials() -> None:
    """Numbers of protocols and names stay: 6-parity, a 4 x 32 perceptron, §4, G2."""
    reasons = _accepted()
    assert len(reasons) > 15
    named = re.compile(r"\d+-parity|\d+ x \d+|§[\d.]+|appendix A\.\d|\b[A-Z]\d+\b")
    assert {place: text for place, text in reasons.items() if re.search(r"\d", named.sub("", text))} == {}


def _printed(claim: str, case: str = "") -> str:
    """Return what docs/results.md prints behind a verdict of the full tier."""
    (row,) = re.findall(rf"^\| {claim} \| [^|]* \| ([^|]*) \|", RESULTS, re.MULTILINE)
    verdicts = row.split("<br>")
    (verdict,) = [one for one in verdicts if not case or one.partition(": ")[0].replace("\\", "") == case]
    return verdict[verdict.index("(") + 1 : verdict.rindex(";")]


def _values(method: str, task: str, value: Value, printed: str) -> list[float]:
    """Return what the trials of the look that decided have: the first 5 or 10 seeds."""
    (n,) = re.findall(r"\b(\d+) trials", printed)
    trials = committed(REPRODUCTION.references, "full", method, task)
    return [value(trial) for trial in sorted(trials, key=lambda trial: trial.seed)[: int(n)]]


def _reward(trial: TrialResult) -> float:
    return float(trial.metrics["last_fitness"])


def _stones(trial: TrialResult) -> float:
    return float(trial.metrics["stones"])


@pytest.mark.parametrize(
    ("claim", "case", "method", "task", "holds"),
    [
        ("G1", "n_parity", "cma_es", "n_parity", lambda trial: trial.metrics["mean_success"] == 1),
        ("G7", "", "ppo", "n_parity_direct", lambda trial: trial.metrics["last_success"] == 1),
    ],
)
def test_printed_counts_of_trials_are_those_of_the_records(
    claim: str, case: str, method: str, task: str, holds: Callable[[TrialResult], bool]
) -> None:
    printed = _printed(claim, case)
    held = _values(method, task, lambda trial: float(holds(trial)), printed)
    assert f"{sum(held):.0f} of {len(held)} trials" in printed


@pytest.mark.parametrize(
    ("claim", "case", "method", "low", "high"), [("S1", "", "neat", 4, 6), ("S2", "cma_es", "cma_es", 2, 4)]
)
def test_printed_counts_of_stones_are_those_of_the_records(
    claim: str, case: str, method: str, low: float, high: float
) -> None:
    printed = _printed(claim, case)
    stones = _values(method, "stones", _stones, printed)
    below, above = sum(value < low for value in stones), sum(value > high for value in stones)
    assert f"{below} below, {len(stones) - below - above} inside, {above} above \\[{low}, {high}\\]" in printed


@pytest.mark.parametrize(
    ("claim", "case", "one", "other"),
    [
        ("S4", "cma_es", ("neat", "stones"), ("cma_es", "stones")),
        ("S4", "goal_ppo", ("neat", "stones"), ("goal_ppo", "stones")),
        ("O5", "", ("neat", "obstacles_high"), ("ppo", "obstacles_high")),
    ],
)
def test_printed_effects_are_those_of_the_records(
    claim: str, case: str, one: tuple[str, str], other: tuple[str, str]
) -> None:
    """A12 is the share of pairs in which the first side has more reward; ties count half."""
    printed = _printed(claim, case)
    ours, theirs = (_values(*side, _reward, printed) for side in (one, other))
    wins = [(a > b) + (a == b) / 2 for a in ours for b in theirs]
    assert f"A12 {sum(wins) / len(wins):.2f}, {len(ours)} trials a side" in printed
