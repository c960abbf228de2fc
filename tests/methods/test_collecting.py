"""Experience is laid out as Brax's loss wants it, compared with a loop over environments."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from probes import CURRICULUM, DELAYED, SURVIVAL

from evoclaims.core.keys import streams
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.collect import Interaction, collect

pytestmark = pytest.mark.newest

ENVIRONMENTS, ROUNDS, UNROLL = 3, 4, 2
LEVEL = jnp.zeros((), jnp.int32)


def _act(observation: jax.Array, key: jax.Array) -> tuple[jax.Array, dict[str, jax.Array]]:
    """Act at random, leaning towards the shown bit so that some episodes live and some die."""
    action = jax.random.normal(key, (observation.shape[0], 1)) + observation[:, :1]
    return action, {"log_prob": 10.0 * action[:, 0]}


def _by_hand(task: Any, key: jax.Array, interaction: Interaction) -> tuple[list[Any], dict[tuple[int, int], Any]]:
    """Return the states at the end, and what each (environment, step) met, one environment after the other."""
    states = [jax.tree.map(lambda leaf, e=e: leaf[e], interaction.states) for e in range(ENVIRONMENTS)]
    met, step, reset = {}, jax.jit(task.step), jax.jit(task.reset)
    for time, step_key in enumerate(jax.random.split(key, ROUNDS * UNROLL)):
        act_key, reset_key = streams(step_key, "act", "reset")
        actions, extras = _act(jnp.stack([state.observation for state in states]), act_key)
        for environment, fresh_key in enumerate(jax.random.split(reset_key, ENVIRONMENTS)):
            before = states[environment]
            after = step(before, actions[environment])
            met[environment, time] = {
                "observation": before.observation,
                "action": actions[environment],
                "reward": after.reward,
                "discount": 0.0 if after.terminated else 1.0,
                "truncation": 1.0 if after.truncated else 0.0,
                "next_observation": after.observation,
                "log_prob": extras["log_prob"][environment],
            }
            ended = after.terminated or after.truncated
            states[environment] = reset(fresh_key, interaction.level) if ended else after
    return states, met


@pytest.mark.parametrize("task", [SURVIVAL, DELAYED], ids=lambda task: task.name)
def test_trajectories_are_those_of_a_loop_over_environments(task: Any) -> None:
    start = Interaction.start(task, jax.random.key(0), LEVEL, ENVIRONMENTS)
    states, met = _by_hand(task, jax.random.key(1), start)
    if task == SURVIVAL:  # every way of ending is met
        assert {(one["discount"], one["truncation"]) for one in met.values()} == {(1.0, 0.0), (0.0, 0.0), (1.0, 1.0)}
    end, data = jax.jit(lambda key, start: collect(task, _act, key, start, ROUNDS, UNROLL))(jax.random.key(1), start)
    rows = {
        "observation": data.observation,
        "action": data.action,
        "reward": data.reward,
        "discount": data.discount,
        "truncation": data.extras["state_extras"]["truncation"],
        "next_observation": data.next_observation,
        "log_prob": data.extras["policy_extras"]["log_prob"],
    }
    for name, leaf in rows.items():
        assert leaf.shape[:2] == (ROUNDS * ENVIRONMENTS, UNROLL)
        assert leaf.dtype == jnp.float32
        for (environment, time), wanted in met.items():
            row = time // UNROLL * ENVIRONMENTS + environment
            np.testing.assert_allclose(leaf[row, time % UNROLL], wanted[name], atol=1e-6, err_msg=name)
    for environment, state in enumerate(states):
        jax.tree.map(lambda one, other, e=environment: np.testing.assert_array_equal(one, other[e]), state, end.states)


def test_episodes_go_on_while_the_level_stays_and_start_afresh_when_it_moves() -> None:
    task = NParity(4)
    begun = Interaction.start(task, jax.random.key(0), LEVEL, 5)
    under_way = Interaction(states=jax.vmap(task.step)(begun.states, jnp.ones((5, 1))), level=begun.level)
    at_level = jax.jit(lambda interaction, key, level: interaction.at_level(task, key, level))
    stayed = at_level(under_way, jax.random.key(1), LEVEL)
    jax.tree.map(np.testing.assert_array_equal, stayed, under_way)
    moved = at_level(under_way, jax.random.key(1), jnp.int32(2))
    assert int(moved.level) == 2
    assert moved.states.inner.level.tolist() == [2] * 5
    assert under_way.states.inner.index.tolist() == [1] * 5
    assert moved.states.inner.index.tolist() == [0] * 5
    back = at_level(moved, jax.random.key(2), LEVEL)
    assert back.states.inner.level.tolist() == [0] * 5


def test_restarted_episodes_are_of_the_level_under_way() -> None:
    for level, cases in ((0, {0, 1}), (1, {0, 1, 2, 3})):
        start = Interaction.start(CURRICULUM, jax.random.key(0), jnp.int32(level), 16)
        end, data = jax.jit(lambda start: collect(CURRICULUM, _act, jax.random.key(1), start, 3, 1))(start)
        assert set(end.states.inner.case.tolist()) == cases
        assert len(np.unique(np.asarray(data.observation).reshape(-1, 2), axis=0)) == len(cases)
