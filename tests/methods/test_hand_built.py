"""The positive control: right about every row of every gate, and its negation wrong about every row."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest
from probes import COPY

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.alu import SimpleAlu
from evoclaims.envs.gates.circuit import TruthTable
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.trials.program import examine_every_level

GATES = [
    *(NParity(bits) for bits in range(2, 9)),
    NParity(4, "sampled"),
    *(
        SimpleAlu(operations=operations, multiplexer=multiplexer)
        for operations in ("paper", "published_code")
        for multiplexer in ("paper", "published_code")
    ),
]


@pytest.mark.parametrize("task", GATES, ids=str)
@pytest.mark.parametrize(("negated", "success", "fitness"), [(False, 1.0, 0.0), (True, 0.0, -1.0)])
def test_it_is_exactly_right_at_every_level_and_its_negation_exactly_wrong(
    task: Any, negated: bool, success: float, fitness: float
) -> None:
    method = HandBuilt(negated)
    assert method.name == ("hand_built_negated" if negated else "hand_built")
    policy = method.best(task, method.init(jax.random.key(0), task))
    final = jax.jit(lambda key: examine_every_level(task, policy, key))(jax.random.key(0))
    np.testing.assert_array_equal(final.success, np.full(task.levels, success, np.float32))
    np.testing.assert_array_equal(final.fitness, np.full(task.levels, fitness, np.float32))


class DeafParity(NParity):
    """Parity as a bug might have it: the first bit is ignored."""

    @property
    def table(self) -> TruthTable:
        right = NParity(self.bits).table
        return replace(right, targets=right.inputs[:, 1:].sum(axis=1, keepdims=True) % 2 == 1)


def test_a_wrong_truth_table_does_not_make_it_wrong_alike() -> None:
    task = DeafParity(4)
    final = examine_every_level(task, HandBuilt().best(task, jax.numpy.int32(0)), jax.random.key(0))
    np.testing.assert_array_equal(final.success, [1.0, 1.0, 0.5])


def test_a_task_without_a_truth_table_is_one_sentence() -> None:
    with pytest.raises(UserError, match="no circuit built by hand for the task 'probe_copy'"):
        HandBuilt().best(COPY, jax.numpy.int32(0))
