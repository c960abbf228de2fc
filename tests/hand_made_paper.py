"""A small paper and trials made by hand: what the tests of the suite judge without an engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from made_trials import trial_of

from evoclaims.claims.claim import Claim
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.result import Status, TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

CONDITIONS = {
    (method, task): Condition(HandBuilt(method == "worse"), NParity(bits), "curriculum", Budget(generations=2))
    for method in ("better", "worse")
    for task, bits in (("small", 3), ("large", 4))
}


def _made(condition: Condition, seed: int, value: float, status: Status = "done", **provenance: Any) -> TrialResult:
    """Return a sound record whose numbers all follow from `value`."""
    last = condition.task.levels - 1.0
    metrics = {
        "last_success": value / 2,
        "last_fitness": value - 1.0,
        "furthest_solved": last if value == 1.0 else -1.0,
        "furthest_reached": last,
        "environment_steps": 100.0 + seed,
    }
    return trial_of(condition, seed, value, status, metrics=metrics, provenance=provenance)


@pytest.fixture(scope="session")
def made() -> Callable[..., TrialResult]:
    """A function that makes a record; see `_made`."""
    return _made


@pytest.fixture(scope="session")
def served() -> Callable[..., Any]:
    """A function that makes a `Fetch` from `value(condition, seed)`."""

    def make(value: Callable[[Condition, int], float]) -> Any:
        def fetch(condition: Condition, seeds: Sequence[int]) -> list[TrialResult]:
            return [_made(condition, seed, value(condition, seed)) for seed in seeds]

        return fetch

    return make


@pytest.fixture
def reproduction(tmp_path: Path) -> Reproduction:
    """Two methods on two tasks; six trials at the smoke tier, ten at the full one."""
    tiers = {"smoke": Tier(CONDITIONS, Design.fixed(6)), "full": Tier(CONDITIONS, Design.fixed(10))}
    return Reproduction("tiny", "A Tiny Paper", tmp_path / "reproduction", tiers)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """A store that no folder exists for yet."""
    return Store(tmp_path / "store")


@pytest.fixture
def says() -> Claim:
    """A claim."""
    return Claim("T1", "Better is better", "§1", "Better is better on six trials")
