"""Every method solves the probes of what it sees, through the engine that runs real trials."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import pytest
from probes import CONSTANT, COPY, CURRICULUM, PROBES, SELECTION, Probe
from small_methods import METHODS, Entry

from evoclaims.envs.base import Episode, PolicyFn
from evoclaims.trials.layout import FAST_TO_COMPILE, Layout
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

pytestmark = pytest.mark.slow

SEEDS = range(8)
"""One trial may be lucky: about every third untrained policy is right."""
AT_ONCE = 10
"""Steps for a probe with one level: a method that takes longer has drifted there."""


def _steps(name: str, probe: Probe) -> int:
    """Return the steps that a method may take to solve a probe; 0 where it is not held to it.

    `SELECTION` asks more of methods that select than `COPY`, and `COPY` more than `CONSTANT`. When rewards are paid is
    the affair of the task for methods that see the fitness of whole episodes alone.
    """
    entry = METHODS[name]
    if probe == SELECTION:
        return entry.selection
    if probe == CURRICULUM:
        return entry.curriculum
    held = not entry.selection if probe == COPY else entry.sees_rewards and probe != CONSTANT
    return AT_ONCE if entry.curriculum and held else 0


HELD_TO = [(name, probe) for name in METHODS for probe in PROBES.values() if _steps(name, probe)]


@pytest.fixture
def _as_shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile every trial as a user's short ones are: what takes thousands of steps is worth that."""
    monkeypatch.setattr(Layout, "options", lambda layout, condition: FAST_TO_COMPILE)


@pytest.mark.usefixtures("_as_shipped")
@pytest.mark.parametrize(("name", "task"), HELD_TO, ids=lambda one: getattr(one, "name", one))
def test_every_method_solves_the_probes_of_what_it_sees(
    name: str, entry: Entry, task: Probe, tmp_path: Path, cpus: list[Any]
) -> None:
    budget = Budget(generations=_steps(name, task), reports=1)
    for trial in run(Condition(entry.other, task, "curriculum", budget), SEEDS, Store(tmp_path), cpus):
        assert trial.status == "done"
        assert trial.metrics["furthest_solved"] == task.levels - 1
        assert trial.metrics["last_success"] == 1.0
        assert trial.metrics["last_fitness"] == task.best_fitness
        solved_at = trial.levels["solved_at"]
        assert sorted(set(solved_at)) == list(solved_at)


@dataclass(frozen=True)
class _Weighed(Probe):
    """A probe whose fitness is multiplied by a weight."""

    weight: Any = 1.0

    def episode(self, policy: PolicyFn, key: Any, level: Any) -> Episode:
        episode = super().episode(policy, key, level)
        return replace(episode, fitness=self.weight * episode.fitness)


@pytest.mark.parametrize("name", ["cma_es", "neat"])
def test_breeding_from_the_worst_or_from_anyone_is_seen_though_the_champion_is_the_best(name: str) -> None:
    """The other methods that select do so by the code of these two."""
    entry, level = METHODS[name], jnp.zeros((), jnp.int32)
    method, known = entry.other, {field.name: getattr(SELECTION, field.name) for field in fields(SELECTION)}

    start = jax.jit(lambda key: method.init(key, SELECTION))

    @jax.jit
    def step(key: jax.Array, weight: jax.Array, state: Any) -> Any:
        sound, progress = method.step(key, SELECTION, level, state)
        bred, _ = method.step(key, _Weighed(**known, weight=weight), level, state)
        judged = {part: getattr(sound, part) for part in ("champion", "episode") if hasattr(sound, part)}
        return replace(bred, **judged), progress.success

    def solves(weight: float, seed: int) -> bool:
        state = start(jax.random.key(seed))
        for key in jax.random.split(jax.random.key(seed + 1), entry.selection):
            state, success = step(key, jnp.float32(weight), state)
            if success == 1.0:
                return True
        return False

    with jax.debug_key_reuse(False):  # both steps of the fault have one key
        assert solves(1.0, seed=0)
        for weight in (-1.0, 0.0):
            assert not all(solves(weight, seed) for seed in SEEDS)


@pytest.mark.parametrize("probe", PROBES)
def test_an_untrained_policy_solves_a_probe_with_few_seeds(probe: str) -> None:
    """Otherwise the probes would be solved by luck, and would show nothing."""
    method, task = METHODS["ppo"].other, PROBES[probe]
    level = jnp.asarray(task.levels - 1, jnp.int32)

    def untrained(key: jax.Array) -> jax.Array:
        return task.examine(method.best(task, method.init(key, task)), jax.random.key(0), level).success

    successes = jax.jit(jax.vmap(untrained))(jax.random.split(jax.random.key(0), 400))
    assert float(jnp.mean((successes == 1.0).astype(jnp.float32))) < 0.4
