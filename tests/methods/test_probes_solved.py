"""Every method solves every probe, through the engine that runs real trials."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import pytest

from evoclaims.envs.probes import PROBES
from evoclaims.trials.budget import Budget
from evoclaims.trials.result import TrialResult
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

SEEDS = range(4)
"""One trial may be lucky: about every third one is without any learning."""


def _trials(method: Any, probe: str, budget: Budget, folder: Path, cpus: list[Any]) -> list[TrialResult]:
    return run(Condition(method, PROBES[probe], "curriculum", budget), SEEDS, Store(folder), cpus)


@pytest.mark.parametrize("probe", PROBES)
def test_every_method_solves_every_probe(entry: Any, probe: str, tmp_path: Path, cpus: list[Any]) -> None:
    levels = PROBES[probe].levels
    for trial in _trials(entry.prober, probe, entry.probing, tmp_path, cpus):
        assert trial.status == "done"
        assert trial.metrics["last_success"] == 1.0
        assert trial.metrics["last_fitness"] == PROBES[probe].best_fitness
        assert trial.metrics["furthest_solved"] == levels - 1
        assert trial.metrics["steps"] < entry.probing.generations
        solved_at = trial.levels["solved_at"]
        assert sorted(solved_at) == list(solved_at)
        assert len(set(solved_at)) == levels


@pytest.mark.parametrize("probe", PROBES)
def test_an_untrained_policy_solves_a_probe_with_few_seeds(probe: str, probers: dict[str, Any]) -> None:
    """Otherwise the probes would be solved by luck, and would show nothing."""
    method, task = probers["ppo"], PROBES[probe]
    level = jnp.asarray(task.levels - 1, jnp.int32)

    def untrained(key: jax.Array) -> jax.Array:
        return task.examine(method.best(task, method.init(key, task)), jax.random.key(0), level).success

    successes = jax.jit(jax.vmap(untrained))(jax.random.split(jax.random.key(0), 400))
    assert float(jnp.mean((successes == 1.0).astype(jnp.float32))) < 0.4
