"""Examinations and episodes of the gates: exact at both ends, and the same however a row comes to be asked."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gate_oracles import GATES, Gate, every_level, right_answers, table_policy
from numpy.typing import NDArray
from scipy.stats import chisquare

from evoclaims.envs.base import Episode, averaged, share
from evoclaims.envs.gates.circuit import Circuit, Sampling, TruthTable
from evoclaims.envs.gates.parity import NParity

pytestmark = pytest.mark.newest

few = pytest.mark.parametrize("gate", [GATES[name] for name in list(GATES)[1::3]], ids=list(GATES)[1::3])
"""The parities of 3 and 6, and two of the ALUs: enough where the rows have been checked one by one."""


@functools.cache
def _examiner(task: Any) -> Callable[[jax.Array], Episode]:
    """Return a function that examines a table of answers [lines, outputs] on every level of `task`."""

    def examine(answers: jax.Array) -> Episode:
        policy = table_policy(task.table.inputs, answers)
        return jax.vmap(lambda level: task.examine(policy, jax.random.key(0), level))(every_level(task))

    return jax.jit(examine)


def _examine(task: Any, answers: NDArray[Any]) -> Episode:
    """Examine a table of answers on every level; the leaves are NumPy arrays [levels]."""
    return jax.tree.map(np.asarray, _examiner(task)(jnp.asarray(answers, jnp.float32)))


@few
@pytest.mark.parametrize("unscored", [-1.0, 1.0, np.nan])
def test_unscored_outputs_do_not_matter(gate: Gate, unscored: float) -> None:
    episode = _examine(gate.task, right_answers(gate.last, unscored))
    assert (episode.success == 1.0).all()
    assert (episode.fitness == 0.0).all()


@pytest.mark.parametrize("output", [0.0, -0.0, -np.inf])
def test_an_output_that_is_not_above_0_is_the_bit_0(output: float) -> None:
    right = right_answers(GATES["parity of 2"].last)
    assert _examine(NParity(2), np.where(right < 0, output, 1.0)).success[0] == 1.0
    assert _examine(NParity(2), np.where(right > 0, output, -1.0)).success[0] == 0.5


def test_no_number_is_the_answer_to_nothing() -> None:
    episode = _examine(NParity(2), np.full_like(right_answers(GATES["parity of 2"].last), np.nan))
    assert (episode.success == 0.0).all()
    assert (episode.fitness == -1.0).all()


@few
def test_the_examination_is_an_average_over_rows_of_the_integers_errors(gate: Gate) -> None:
    answers = np.random.default_rng(0).normal(size=(len(gate.last), gate.task.action_size))
    episode = _examine(gate.task, answers)
    for level in range(gate.task.levels):
        lines = gate.lines(level)
        errors = [
            np.mean([(x > 0) != bit for x, bit in zip(given, line.wanted, strict=True) if bit is not None])
            for line, given in zip(lines, answers, strict=False)
        ]
        assert episode.fitness[level] == pytest.approx(-np.mean(errors), abs=1e-6)
        assert episode.success[level] == pytest.approx(np.mean(np.array(errors) == 0), abs=1e-6)


@few
def test_an_exhaustive_episode_asks_every_row_once_in_order_and_pays_what_the_examination_says(gate: Gate) -> None:
    answers = np.random.default_rng(1).normal(size=(len(gate.last), gate.task.action_size))
    policy = table_policy(gate.task.table.inputs, answers)
    examined = _examine(gate.task, answers)
    act = jax.jit(lambda state: gate.task.step(state, policy(state.observation)))
    assert gate.task.horizon == len(gate.last)
    for level in range(gate.task.levels):
        state = gate.task.reset(jax.random.key(0), jnp.asarray(level, jnp.int32))
        shown, rewards = [], []
        while not state.terminated:
            assert not state.truncated
            shown.append(tuple(map(int, state.observation)))
            state = act(state)
            rewards.append(float(state.reward))
        assert shown == [line.shown for line in gate.lines(level)]
        assert np.mean(rewards) == pytest.approx(float(examined.fitness[level]), abs=1e-6)
    last = jnp.asarray(gate.task.levels - 1, jnp.int32)
    trained = jax.jit(lambda key: gate.task.episode(policy, key, last))(jax.random.key(5))
    assert (float(trained.fitness), float(trained.success)) == (examined.fitness[-1], examined.success[-1])


@few
def test_sampled_rows_are_uniform_over_the_level_and_never_beyond_it(gate: Gate) -> None:
    task = replace(gate.task, sampling="sampled")
    reset = jax.jit(jax.vmap(task.reset, in_axes=(0, None)))
    for level, rows in enumerate(task.table.rows_at_level):
        keys = jax.random.split(jax.random.key(level), 40 * task.table.rows)
        states = reset(keys, jnp.asarray(level, jnp.int32))
        counts = np.bincount(np.asarray(states.inner.index), minlength=rows)
        assert len(counts) == rows
        assert chisquare(counts).pvalue > 1e-4
        assert (np.asarray(states.observation) == task.table.inputs[np.asarray(states.inner.index)]).all()


@few
def test_a_sampled_episode_is_one_step_that_pays_its_rows_error(gate: Gate) -> None:
    task = replace(gate.task, sampling="sampled")
    assert task.horizon == 1
    answers = np.random.default_rng(3).normal(size=(len(gate.last), task.action_size))
    policy = table_policy(task.table.inputs, answers)
    level = jnp.asarray(task.levels - 1, jnp.int32)
    keys = jax.random.split(jax.random.key(3), 300)
    starts = jax.jit(jax.vmap(lambda key: task.reset(key, level)))(keys)
    ends = jax.jit(jax.vmap(lambda state: task.step(state, policy(state.observation))))(starts)
    assert np.asarray(ends.terminated).all()
    assert not np.asarray(ends.truncated).any()
    for row, reward in zip(np.asarray(starts.inner.index), np.asarray(ends.reward), strict=True):
        wanted = [(x > 0) != bit for x, bit in zip(answers[row], gate.last[row].wanted, strict=True) if bit is not None]
        assert reward == pytest.approx(-np.mean(wanted), abs=1e-7)
    again = jax.random.split(jax.random.key(3), 300)
    episodes = jax.jit(jax.vmap(lambda key: task.episode(policy, key, level)))(again)
    np.testing.assert_array_equal(np.asarray(episodes.fitness), np.asarray(ends.reward))
    # One right row must not pass for a solved level.
    assert set(np.asarray(episodes.success).tolist()) == {_examine(gate.task, answers).success[-1]}


@dataclass(frozen=True)
class Ones(Circuit):
    """As many rows as one likes, each wanting a 1."""

    name: ClassVar[str] = "ones"
    revision: ClassVar[int] = 1
    row_counts: tuple[int, ...]
    sampling: Sampling = "exhaustive"

    @cached_property
    def table(self) -> TruthTable:
        rows = self.row_counts[-1]
        yes = np.ones((rows, 1), bool)
        return TruthTable(np.arange(rows, dtype=np.float32)[:, None], yes, yes, self.row_counts)


def test_a_solved_level_is_exactly_1_whatever_its_number_of_rows() -> None:
    """41 · float32(1 / 41) is 0.99999994, and XLA divides by constants that way."""
    task = Ones(tuple(range(1, 260)))
    solved = _examine(task, np.ones((259, 1)))
    assert (solved.success == 1.0).all()
    one_wrong = _examine(task, np.where(np.arange(259) == 0, -1.0, 1.0)[:, None])
    assert (one_wrong.success < 1.0).all()
    for level in (40, 46):
        known = jax.jit(lambda level=level: task.examine(lambda _: jnp.ones(1), jax.random.key(0), jnp.int32(level)))()
        assert known.success == 1.0


def test_a_share_is_that_of_whole_numbers() -> None:
    pairs = np.array([(part, whole) for whole in range(1, 60) for part in range(whole + 1)], np.int32)
    shares = np.asarray(jax.jit(share)(pairs[:, 0], pairs[:, 1]))
    np.testing.assert_allclose(shares, pairs[:, 0] / pairs[:, 1], rtol=1e-6)
    np.testing.assert_array_equal(shares == 1.0, pairs[:, 0] == pairs[:, 1])


@pytest.mark.parametrize("count", [1, 10, 41, 47, 94, 97])
def test_episodes_that_all_succeed_average_to_exactly_1(count: int) -> None:
    """The mean of 41 ones, which XLA computes with the rounded reciprocal, is 0.99999994."""
    all_ = Episode(fitness=jnp.arange(count, dtype=jnp.float32), success=jnp.ones(count))
    made = jax.jit(averaged)(all_)
    assert float(made.success) == 1.0
    assert float(made.fitness) == pytest.approx((count - 1) / 2)
    if count > 1:
        one_fails = jax.jit(averaged)(Episode(fitness=all_.fitness, success=all_.success.at[0].set(0.0)))
        assert float(one_fails.success) == pytest.approx((count - 1) / count)
