"""A trial is the same trial to the bit, whatever shares its program and however many devices there are."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trial_toys import walk

from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.ppo import Ppo
from evoclaims.networks.all_skips import AllSkips
from evoclaims.trials.layout import Layout
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

PPO = Ppo(policy_layers=(4,), value_layers=(4,), environments=8, batch_size=8, minibatches=2, updates_per_batch=1)
BUDGET = Budget(generations=12, reports=4)
CONDITIONS: Mapping[str, Condition] = {
    "cma_es": Condition(CmaEs(6, network=AllSkips(hidden=2)), NParity(3), "curriculum", BUDGET),
    "ppo": Condition(PPO, NParity(3, "sampled"), "curriculum", BUDGET),
    "walker": walk(chance=0.1),
}
SEEDS = (3, 0, 5)


@pytest.fixture(scope="module", autouse=True)
def compiled_once() -> None:
    """Nothing is kept here from other tests: programs of the same bits are compiled apart."""


def _digests(results: list[TrialResult]) -> dict[int, str]:
    return {result.seed: result.digest for result in results}


@pytest.mark.parametrize("name", CONDITIONS)
def test_a_trial_alone_equals_the_same_trial_in_a_batch_on_two_devices(
    name: str, tmp_path: Path, cpus: list[Any]
) -> None:
    condition = CONDITIONS[name]
    batch = run(condition, SEEDS, Store(tmp_path / "batch"), cpus)
    alone = run(condition, SEEDS[1:2], Store(tmp_path / "alone"), cpus[:1])
    assert [result.seed for result in batch] == list(SEEDS)
    assert len(set(_digests(batch).values())) == len(SEEDS)
    assert alone[0].digest == _digests(batch)[SEEDS[1]]


def test_trials_side_by_side_climb_and_end_as_trials_one_after_the_other(
    tmp_path: Path, cpus: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The "vector" layout, which narrows as trials end; its arithmetic may round otherwise, so no digests here."""
    seeds, condition = range(5), walk(chance=0.25)
    loop = run(condition, seeds, Store(tmp_path / "alone"), cpus)
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: Layout.VECTOR)
    vector = run(condition, seeds, Store(tmp_path / "vector"), cpus)
    for one, other in zip(loop, vector, strict=True):
        assert (one.seed, one.status) == (other.seed, other.status)
        assert one.levels["solved_at"] == other.levels["solved_at"]
        assert one.levels["success"] == other.levels["success"]
        for curve in ("steps", "level", "success"):
            assert one.curves[curve] == other.curves[curve]
        np.testing.assert_allclose(one.curves["fitness"], other.curves["fitness"], rtol=1e-5)
    assert len({result.metrics["steps"] for result in loop}) > 1
