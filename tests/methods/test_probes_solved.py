"""Every method solves the probes of what it sees, through the engine that runs real trials."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import pytest
from probes import PROBES
from small_methods import METHODS, Entry

from evoclaims.trials import lanes
from evoclaims.trials.budget import Budget
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Condition
from evoclaims.trials.store import Store

pytestmark = pytest.mark.slow

SEEDS = range(8)
"""One trial may be lucky: about every third untrained policy is right."""
OF_EPISODES = ("probe_copy", "probe_curriculum")
"""Probes for a method that sees the fitness of whole episodes alone: when it is paid is the affair of the task, and
one such method stands for all."""
HELD_TO = [
    (name, probe)
    for name, entry in METHODS.items()
    for probe in PROBES
    if entry.curriculum and (entry.sees_rewards or name == "cma_es" or probe in OF_EPISODES)
]
AT_ONCE = 10
"""Steps for a probe with one level: a method that takes longer has drifted there."""


@pytest.fixture
def _as_shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile every trial as a user's short ones are: what takes thousands of steps is worth that."""
    monkeypatch.setattr(lanes, "options_for", lambda condition, layout: lanes.FAST_TO_COMPILE)


@pytest.mark.usefixtures("_as_shipped")
@pytest.mark.parametrize(("name", "probe"), HELD_TO)
def test_every_method_solves_the_probes_of_what_it_sees(
    entry: Entry, probe: str, tmp_path: Path, cpus: list[Any]
) -> None:
    task = PROBES[probe]
    budget = Budget(generations=entry.curriculum if task.levels > 1 else AT_ONCE, reports=1)
    for trial in run(Condition(entry.other, task, "curriculum", budget), SEEDS, Store(tmp_path), cpus):
        assert trial.status == "done"
        assert trial.metrics["furthest_solved"] == task.levels - 1
        assert trial.metrics["last_success"] == 1.0
        assert trial.metrics["last_fitness"] == task.best_fitness
        solved_at = trial.levels["solved_at"]
        assert sorted(set(solved_at)) == list(solved_at)


@pytest.mark.parametrize("probe", PROBES)
def test_an_untrained_policy_solves_a_probe_with_few_seeds(probe: str) -> None:
    """Otherwise the probes would be solved by luck, and would show nothing."""
    method, task = METHODS["ppo"].other, PROBES[probe]
    level = jnp.asarray(task.levels - 1, jnp.int32)

    def untrained(key: jax.Array) -> jax.Array:
        return task.examine(method.best(task, method.init(key, task)), jax.random.key(0), level).success

    successes = jax.jit(jax.vmap(untrained))(jax.random.split(jax.random.key(0), 400))
    assert float(jnp.mean((successes == 1.0).astype(jnp.float32))) < 0.4
