"""The probes' answers are known, so they are written out here."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import pytest
from probes import DELAYED, PROBES, SELECTION, SURVIVAL, Probe

from evoclaims.envs.base import Episode, PolicyFn

pytestmark = pytest.mark.newest

YES: PolicyFn = lambda observation: jnp.ones(1)  # noqa: E731
REPEAT: PolicyFn = lambda observation: observation[:1]  # noqa: E731
EXCLUSIVE_OR: PolicyFn = lambda observation: -jnp.prod(observation, keepdims=True)  # noqa: E731
MIDDLE: PolicyFn = lambda observation: observation[3:9].sum(keepdims=True) - 0.5  # noqa: E731

ANSWERS: dict[str, tuple[PolicyFn, float]] = {
    "probe_constant": (YES, 1.0),
    "probe_copy": (REPEAT, 1.0),
    "probe_delayed": (REPEAT, 1.0),
    "probe_survival": (REPEAT, 2.0),
    "probe_curriculum": (EXCLUSIVE_OR, 1.0),
    "probe_selection": (MIDDLE, 2.0),
}
"""The right policy of each probe, and its fitness."""


def _examine(probe: Probe, policy: PolicyFn, level: int = 0) -> Episode:
    return jax.jit(lambda level: probe.examine(policy, jax.random.key(0), level))(jnp.asarray(level, jnp.int32))


def _play(probe: Probe, observation: tuple[float, ...], actions: list[float]) -> list[tuple[Any, ...]]:
    """Start where `observation` is shown; return observation, reward, terminated and truncated after each action."""
    level = jnp.asarray(probe.levels - 1, jnp.int32)
    starts = (probe.reset(key, level) for key in jax.random.split(jax.random.key(0), 64))
    state = next(state for state in starts if tuple(map(float, state.observation)) == observation)
    seen = []
    for action in actions:
        state = probe.step(state, jnp.array([action]))
        flags = bool(state.terminated), bool(state.truncated)
        seen.append((tuple(map(float, state.observation)), float(state.reward), *flags))
    return seen


@pytest.mark.parametrize("name", PROBES)
def test_the_right_policy_succeeds_exactly_with_the_best_fitness_and_the_wrong_one_fails_exactly(name: str) -> None:
    probe, (right, best) = PROBES[name], ANSWERS[name]
    assert (probe.name, probe.best_fitness) == (name, best)
    for level in range(probe.levels):
        for policy, success, fitness in ((right, 1.0, best), (lambda observation: -right(observation), 0.0, -1.0)):
            episode = _examine(probe, policy, level)
            assert (float(episode.success), float(episode.fitness)) == (success, fitness)


@pytest.mark.parametrize("bit", [-1.0, 1.0])
@pytest.mark.parametrize("second", [-1.0, 1.0])
def test_the_delayed_reward_is_paid_by_the_second_step_for_the_first_answer(bit: float, second: float) -> None:
    waiting = (0.0, 1.0)
    assert _play(DELAYED, (bit, 0.0), [bit, second]) == [(waiting, 0.0, False, False), (waiting, 1.0, True, False)]
    assert _play(DELAYED, (bit, 0.0), [-bit, second])[1] == (waiting, -1.0, True, False)


@pytest.mark.parametrize("bit", [-1.0, 1.0])
def test_survival_terminates_on_an_error_and_truncates_at_the_horizon(bit: float) -> None:
    assert _play(SURVIVAL, (bit,), [bit, -bit]) == [((-bit,), 1.0, False, False), ((-bit,), 1.0, False, True)]
    assert _play(SURVIVAL, (bit,), [-bit])[0] == ((-bit,), -1.0, True, False)
    assert _play(SURVIVAL, (bit,), [bit, bit])[1] == ((-bit,), -1.0, True, False)


def test_survival_forfeits_what_an_ended_episode_does_not_reach() -> None:
    episode = _examine(SURVIVAL, YES)  # right, then wrong; or wrong at once
    assert float(episode.success) == 0.25
    assert float(episode.fitness) == (0.0 - 1.0) / 2


def test_selection_pays_nothing_for_right_answers_behind_a_wrong_one() -> None:
    wrong_at_the_gate: PolicyFn = lambda observation: MIDDLE(observation) * (1 - 2 * observation[5])  # noqa: E731
    for policy in (wrong_at_the_gate, lambda observation: -jnp.ones(1)):
        assert float(_examine(SELECTION, policy).fitness) == -1.0
        assert float(_examine(SELECTION, policy).success) == 0.0
    assert float(_examine(SELECTION, YES).fitness) == pytest.approx((5 * 2 + 10 * 0) / 15)
