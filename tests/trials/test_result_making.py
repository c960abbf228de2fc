"""The record of a run: what it says of a trial that climbed, of one that diverged, and of where it was made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from trial_toys import Walker, walk

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.base import Policy
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition, TrialSpec
from evoclaims.trials.store import Store

pytestmark = pytest.mark.oldest

SEEDS = range(6)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory, cpus: list[Any]) -> list[TrialResult]:
    """Some climb to the end, some diverge."""
    return run(walk(chance=0.35, hazard=0.1), SEEDS, Store(tmp_path_factory.mktemp("store")), cpus)


def _of(results: Sequence[TrialResult], status: str) -> list[TrialResult]:
    found = [result for result in results if result.status == status]
    assert found
    return found


def test_a_nan_ends_its_own_trial_as_diverged_and_the_others_go_on(results: list[TrialResult]) -> None:
    for diverged in _of(results, "diverged"):
        assert np.isnan(diverged.curves["fitness"][-1])
        assert not np.isnan(diverged.curves["fitness"][:-1]).any()
        assert len(diverged.curves["fitness"]) == -(-int(diverged.metrics["steps"]) // 2)
        assert (
            diverged.metrics["steps"] * 10 not in diverged.levels["solved_at"]
        )  # though the toy reports success with it
    for done in _of(results, "done"):
        assert not np.isnan(done.curves["fitness"]).any()


def test_a_method_that_calls_itself_unhealthy_diverges_as_one_that_yields_nan(
    results: list[TrialResult], tmp_path: Path, cpus: list[Any]
) -> None:
    unhealthy = run(walk(chance=0.35, hazard=0.1, unhealthy=True), SEEDS, Store(tmp_path), cpus)
    assert [(r.seed, r.status, r.metrics["steps"]) for r in unhealthy] == [
        (r.seed, r.status, r.metrics["steps"]) for r in results
    ]
    assert not any(np.isnan(result.curves["fitness"]).any() for result in unhealthy)


@dataclass(frozen=True)
class Doubter(Walker):
    """Reports a success of NaN where a walker's fitness would be NaN."""

    name: ClassVar[str] = "doubter"

    def step(self, key: Any, task: Any, level: Any, state: Any) -> tuple[Any, Any]:
        state, progress = super().step(key, task, level, state)
        lost = jnp.isnan(progress.fitness)
        success = jnp.where(lost, jnp.nan, progress.success)
        return state, replace(progress, fitness=jnp.where(lost, 0.0, progress.fitness), success=success)


def test_a_success_of_nan_diverges_as_a_fitness_of_nan(tmp_path: Path, cpus: list[Any]) -> None:
    condition = walk(chance=0.35, hazard=0.1)
    doubter = replace(condition, method=Doubter(0.35, 0.1))
    found = run(doubter, SEEDS, Store(tmp_path), cpus)
    assert {result.status for result in found} == {"done", "diverged"}
    assert all(np.isfinite(result.curves["success"]).all() for result in found if result.status == "done")
    assert all(np.isnan(result.curves["success"][-1]) for result in found if result.status == "diverged")


def test_metrics_and_levels_agree_with_each_other(results: list[TrialResult]) -> None:
    for result in results:
        solved = [level for level, steps in enumerate(result.levels["solved_at"]) if steps != -1]
        assert result.metrics["furthest_solved"] == (solved[-1] if solved else -1)
        assert result.metrics["furthest_reached"] == min(result.metrics["furthest_solved"] + 1, 2)
        assert result.metrics["environment_steps"] == 10 * result.metrics["steps"]
        assert result.metrics["mean_success"] == pytest.approx(np.mean(result.levels["success"]))
        assert result.metrics["last_success"] == result.levels["success"][-1]
        assert result.metrics["last_fitness"] == result.levels["fitness"][-1]
    finished = [r for r in results if r.metrics["furthest_solved"] == 2]
    assert finished  # and they have spent no step after their last level
    assert all(result.levels["solved_at"][-1] == result.metrics["environment_steps"] for result in finished)


def test_a_curve_has_one_point_a_report_until_the_trial_ends(results: list[TrialResult]) -> None:
    for result in results:
        steps = result.curves["steps"]
        assert list(steps[:-1]) == [2 * (i + 1) for i in range(len(steps) - 1)]
        assert steps[-1] == result.metrics["steps"]
        assert set(result.curves) == {"steps", "environment_steps", "level", "fitness", "success", "first"}
        assert list(result.curves["level"]) == sorted(result.curves["level"])


def test_a_record_says_what_it_is_and_where_it_was_made(results: list[TrialResult]) -> None:
    for seed, result in zip(SEEDS, results, strict=True):
        spec = TrialSpec(walk(chance=0.35, hazard=0.1), seed)
        assert (result.id, result.condition, result.seed) == (spec.id, spec.condition.id, seed)
        assert result.provenance["device"]["platform"] == "cpu"
        assert result.provenance["device"]["count"] == 2
        assert result.provenance["matmul_precision"] == "highest"
        assert result.timing["batch"] == len(SEEDS)
        assert datetime.fromisoformat(result.timing["started"]) <= datetime.fromisoformat(result.timing["ended"])
        assert result.timing["run"] >= 0
        assert result.timing["processor"] > 0
        assert result.timing["compile"] >= 0


@pytest.mark.parametrize(
    ("negated", "progression", "solved_at", "steps"),
    [(False, "curriculum", (8.0, 16.0), 2), (True, "curriculum", (-1.0, -1.0), 9), (False, "direct", (-1.0, 8.0), 1)],
)
def test_a_right_network_goes_through_the_levels_of_its_training_and_a_wrong_one_through_none(
    negated: bool, progression: Any, solved_at: tuple[float, ...], steps: int, tmp_path: Path, cpus: list[Any]
) -> None:
    condition = Condition(HandBuilt(negated), NParity(3), progression, Budget(generations=9, reports=3))
    (result,) = run(condition, [0], Store(tmp_path), cpus[:1])
    assert result.levels["success"] == ((0.0, 0.0) if negated else (1.0, 1.0))  # it is examined on all
    assert result.levels["solved_at"] == solved_at
    assert result.metrics["furthest_solved"] == (-1 if negated else 1)
    assert result.metrics["steps"] == steps


@dataclass(frozen=True)
class Spoilt(Walker):
    """Trains in good health, and ends with a champion that holds a number which is not finite, used or not."""

    worst: str = "nan"  # a word, since no setting may be NaN
    acts_by_it: bool = True

    def best(self, task: Any, state: Any) -> Policy:
        parameters = {"weights": state, "beside": jnp.array([float(self.worst)])}
        return Policy(parameters, lambda own, bits: jnp.where(own["weights"][:1] > 0, 1.0, -1.0))


@dataclass(frozen=True)
class Careful(Spoilt):
    """Says what it does not act by."""

    acts_by_it: bool = False

    def used(self, parameters: Any) -> Any:
        return parameters["weights"]


@dataclass(frozen=True)
class Unscored(NParity):
    """An examination whose fitness or success is not finite."""

    fitness: str = "0"
    success: str = "0"

    def examine(self, policy: Any, key: Any, level: Any) -> Any:
        episode = super().examine(policy, key, level)
        fitness, success = episode.fitness + float(self.fitness), episode.success + float(self.success)
        return replace(episode, fitness=fitness, success=success)


@pytest.mark.parametrize(
    ("method", "task", "status"),
    [
        (Spoilt(), NParity(3), "diverged"),
        (Spoilt(worst="1"), NParity(3), "done"),
        (Careful(), NParity(3), "done"),
        (Walker(), Unscored(3, fitness="-inf"), "diverged"),
        (Walker(), Unscored(3, success="nan"), "diverged"),
    ],
)
def test_a_trial_has_diverged_when_its_final_policy_or_its_score_is_not_finite(
    method: Any, task: Any, status: str, tmp_path: Path, cpus: list[Any]
) -> None:
    condition = Condition(method, task, "direct", Budget(generations=2, reports=1))
    (result,) = run(condition, [0], Store(tmp_path), cpus[:1])
    assert result.status == status
    assert result.metrics["steps"] == 2


@dataclass(frozen=True)
class InPercent(Walker):
    """Reports its success in percent."""

    name: ClassVar[str] = "in_percent"

    def step(self, *arguments: Any) -> Any:
        state, progress = super().step(*arguments)
        return state, replace(progress, success=100.0 * progress.success)


@dataclass(frozen=True)
class Generous(NParity):
    """Gives twice the success."""

    name: ClassVar[str] = "generous"

    def examine(self, *arguments: Any) -> Any:
        episode = super().examine(*arguments)
        return replace(episode, success=2.0 * episode.success)


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"method": InPercent(chance=1.0)}, "in_percent on n_parity reports a success of 100"),
        ({"task": Generous(4)}, "The examination of walker on generous reports a success of"),
    ],
)
def test_a_success_that_is_no_share_is_a_sentence_and_no_trial(
    changes: dict[str, Any], what: str, tmp_path: Path, cpus: list[Any]
) -> None:
    """No level would be solved at 100, or any would at 2, and claims would be about nothing."""
    condition = replace(walk(steps=2), **changes)
    with pytest.raises(UserError, match=what + ".*A success is a share from 0 to 1"):
        run(condition, [0], Store(tmp_path), cpus)
    assert not list(Store(tmp_path).results([condition.id]))
