"""The keys that judge a champion are keys that its training has never seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import numpy as np
import pytest

from evoclaims.core.keys import EVALUATION, trial_key
from evoclaims.envs.base import Episode, PolicyFn, TaskState
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.ppo import Ppo
from evoclaims.methods.random_search import RandomSearch
from evoclaims.networks.all_skips import AllSkips
from evoclaims.trials.program import Program
from evoclaims.trials.spec import Budget, Condition

pytestmark = pytest.mark.newest

Key = tuple[int, ...]
_seen: set[Key] = set()


def _note(data: Any) -> None:
    _seen.update(map(tuple, np.asarray(data).reshape(-1, np.asarray(data).shape[-1]).tolist()))


@dataclass(frozen=True)
class Watched(NParity):
    """N-parity that writes down every key it is handed."""

    name: ClassVar[str] = "watched"

    def reset(self, key: jax.Array, level: Any) -> TaskState:
        jax.debug.callback(_note, jax.random.key_data(key))
        return super().reset(key, level)

    def episode(self, policy: PolicyFn, key: jax.Array, level: Any) -> Episode:
        jax.debug.callback(_note, jax.random.key_data(key))
        return super().episode(policy, key, level)

    def examine(self, policy: PolicyFn, key: jax.Array, level: Any) -> Episode:
        jax.debug.callback(_note, jax.random.key_data(key))
        return super().examine(policy, key, level)


METHODS = {
    "random_search": RandomSearch(4, network=AllSkips(hidden=2)),
    "ppo": Ppo((4,), (4,), environments=4, batch_size=4, minibatches=2, updates_per_batch=1),
}


def _keys(condition: Condition, seed: int) -> tuple[set[Key], set[Key]]:
    """Return the keys handed out while training, and while judging."""
    program = Program(condition)

    def train() -> Any:
        return program.advance(program.start(np.int32(seed), np.zeros((), bool)), np.int32(99))[0]

    def noted(function: Callable[..., Any], *arguments: Any) -> tuple[Any, set[Key]]:
        _seen.clear()
        result = jax.jit(function)(*arguments)
        jax.effects_barrier()
        return result, set(_seen)

    trial, training = noted(train)
    _, evaluation = noted(program.examine, trial)
    return training, evaluation


@pytest.mark.parametrize("name", METHODS)
def test_no_key_of_the_evaluation_was_used_in_training(name: str) -> None:
    condition = Condition(METHODS[name], Watched(3, "sampled"), "curriculum", Budget(generations=3, reports=1))
    training, evaluation = _keys(condition, seed=5)
    assert len(training) > 3
    assert len(evaluation) == 2  # one a level
    assert not training & evaluation
    root = jax.random.split(trial_key(5, EVALUATION), 2)
    assert evaluation == set(map(tuple, np.asarray(jax.random.key_data(root)).tolist()))
