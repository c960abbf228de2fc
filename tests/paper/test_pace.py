"""How long a condition would take here, as its trials tell: on other cores they may have been sooner done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hand_made_paper import CONDITIONS

from evoclaims.paper import pace, references
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store


@pytest.mark.parametrize(("processor", "seconds"), [(7_200.0, 3_600.0), (600.0, 900.0), (None, 900.0)])
def test_trials_of_more_cores_than_there_are_here_take_longer_here(
    reproduction: Reproduction,
    made: Callable[..., TrialResult],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    processor: float | None,
    seconds: float,
) -> None:
    """A batch of 900 s that took two hours of cores takes one hour of two; one that waited takes as long again."""
    monkeypatch.setattr(pace, "usable_cores", lambda: 2)
    condition = CONDITIONS["better", "small"]
    timing = {"run": 900.0, "compile": 0.0, "batch": 2, "started": "now"}
    timing |= {} if processor is None else {"processor": processor}
    device = {"platform": "cpu", "kind": "cpu", "count": 1}
    trials = [replace(made(condition, seed, 1.0, device=device), timing=timing) for seed in range(2)]
    trials = [replace(trial, metrics={**trial.metrics, "steps": float(condition.steps)}) for trial in trials]
    references.write(references.path_of(reproduction.references, "full", "better", "small"), trials)
    found = pace.known_pace(
        condition, Store(tmp_path / "none"), reproduction.references, "full", "better", "small", "cpu"
    )
    assert found is not None
    assert found.seconds(condition, 2) == pytest.approx(seconds)
