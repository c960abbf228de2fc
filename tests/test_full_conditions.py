"""The full tier, which no CI runs: its methods and tasks at least fit, begin and trace steps of several trials."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.circuit import Circuit
from evoclaims.trials.program import Program
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
def test_a_condition_of_the_full_tier_traces_steps_of_two_trials_side_by_side(condition: Condition) -> None:
    """As on an accelerator."""
    program, two = Program(condition), jnp.arange(2)
    try:
        state = jax.eval_shape(jax.vmap(program.start), two, two > 2)
    except UserError as error:
        if not getattr(condition.method, "optional", False):
            raise
        pytest.skip(str(error))
    following, report = jax.eval_shape(program.advance_together, state, two)
    assert jax.tree.structure(following) == jax.tree.structure(state)
    assert report.fitness.shape == (2,)
