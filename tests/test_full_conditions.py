"""The full tier, which no CI runs: its methods and tasks at least fit, begin and trace a step of several trials."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Numbered
from evoclaims.envs.gates.circuit import Circuit
from evoclaims.trials.compatibility import traced_progress
from evoclaims.trials.spec import Condition
from reproductions.nisioti2025 import REPRODUCTION

pytestmark = pytest.mark.slow

SMOKE = [(c.method, c.task) for c in REPRODUCTION.tier("smoke").conditions.values()]
CONDITIONS = {n: c for n, c in REPRODUCTION.tier("full").conditions.items() if (c.method, c.task) not in SMOKE}
"""Those that the smoke tier does not run."""
# Each method with each kind of task, and each kind of task with each robot: what differs beyond is a number.
KINDS = {
    (type(c.method), Circuit if isinstance(c.task, Circuit) else type(c.task)): names for names, c in CONDITIONS.items()
}
ROBOTS = {(type(c.task), getattr(c.task, "robot", None)): names for names, c in CONDITIONS.items()}


@pytest.mark.parametrize(
    "condition",
    [pytest.param(CONDITIONS[n], id="-".join(n)) for n in dict.fromkeys([*KINDS.values(), *ROBOTS.values()])],
)
def test_a_condition_of_the_full_tier_traces_a_step_of_two_trials(condition: Condition) -> None:
    method, task = condition.method, condition.task
    keys = jax.random.split(jax.random.key(0), 2)
    try:
        traced_progress(method, task)
    except UserError as error:
        if not getattr(method, "optional", False):
            raise
        pytest.skip(str(error))
    state = jax.eval_shape(jax.vmap(lambda key: method.init(key, task)), keys)
    # On an accelerator trials are a batch, each with the numbers of its task (`Program`).
    numbers = jax.tree.map(lambda x: jnp.stack([x, x]), task.numbers) if isinstance(task, Numbered) else ()

    def step(key: Any, numbers: Any, state: Any) -> Any:
        own = task.with_numbers(numbers) if isinstance(task, Numbered) else task
        return method.step(key, own, jnp.int32(0), state)

    following, progress = jax.eval_shape(jax.vmap(step), keys, numbers, state)
    assert jax.tree.structure(following) == jax.tree.structure(state)
    assert progress.fitness.shape == (2,)
