"""The full tier, which no CI runs: its conditions at least begin and trace a step."""

from __future__ import annotations

import jax
import pytest

from evoclaims.core.errors import UserError
from evoclaims.trials.spec import Condition
from reproductions.nisioti2025 import REPRODUCTION

CONDITIONS = REPRODUCTION.tier("full").conditions
# One of each method with each kind of task and robot: what differs beyond is a number.
KINDS = {(type(c.method), type(c.task), getattr(c.task, "robot", None)): names for names, c in CONDITIONS.items()}


@pytest.mark.parametrize("condition", [pytest.param(CONDITIONS[n], id="-".join(n)) for n in KINDS.values()])
def test_a_condition_of_the_full_tier_traces_a_step(condition: Condition) -> None:
    key, method, task = jax.random.key(0), condition.method, condition.task
    try:
        state = jax.eval_shape(lambda: method.init(key, task))
    except UserError as error:  # an optional library
        pytest.skip(str(error))
    following, progress = jax.eval_shape(lambda state: method.step(key, task, 0, state), state)
    assert jax.tree.structure(following) == jax.tree.structure(state)
    assert progress.fitness.shape == ()
