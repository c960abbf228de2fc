"""The probes' answers are known, so they are written out here."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from probes import CONSTANT, COPY, CURRICULUM, DELAYED, PROBES, SELECTION, SURVIVAL, Probe

from evoclaims.envs.base import Episode, PolicyFn

pytestmark = pytest.mark.newest

YES: PolicyFn = lambda observation: jnp.ones(1)  # noqa: E731
REPEAT: PolicyFn = lambda observation: observation[:1]  # noqa: E731
EXCLUSIVE_OR: PolicyFn = lambda observation: -jnp.prod(observation, keepdims=True)  # noqa: E731
MIDDLE: PolicyFn = lambda observation: observation[3:9].sum(keepdims=True) - 0.5  # noqa: E731
SECOND_BIT: PolicyFn = lambda observation: observation[1:]  # noqa: E731
RIGHT = {
    "probe_constant": YES,
    "probe_copy": REPEAT,
    "probe_delayed": REPEAT,
    "probe_survival": REPEAT,
    "probe_curriculum": EXCLUSIVE_OR,
    "probe_selection": MIDDLE,
}
BEST = {
    "probe_constant": 1.0,
    "probe_copy": 1.0,
    "probe_delayed": 1.0,
    "probe_survival": 2.0,
    "probe_curriculum": 1.0,
    "probe_selection": 2.0,
}


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


def test_the_probes_are_the_six_with_known_answers() -> None:
    assert list(PROBES) == list(RIGHT) == list(BEST)
    for name, probe in PROBES.items():
        assert probe.name == name
        assert probe.best_fitness == BEST[name]


@pytest.mark.parametrize("name", RIGHT)
def test_the_right_policy_succeeds_exactly_with_the_best_fitness_at_every_level(name: str) -> None:
    for level in range(PROBES[name].levels):
        episode = _examine(PROBES[name], RIGHT[name], level)
        assert float(episode.success) == 1.0
        assert float(episode.fitness) == BEST[name]


@pytest.mark.parametrize("name", RIGHT)
def test_the_wrong_policy_fails_exactly(name: str) -> None:
    for level in range(PROBES[name].levels):
        episode = _examine(PROBES[name], lambda observation: -RIGHT[name](observation), level)
        assert float(episode.success) == 0.0
        assert float(episode.fitness) == -1.0


def test_the_constant_asks_for_yes_whatever_is_shown() -> None:
    assert float(_examine(CONSTANT, REPEAT).success) == 0.5
    assert float(_examine(CONSTANT, REPEAT).fitness) == 0.0
    assert _play(CONSTANT, (0.0,), [1.0]) == [((0.0,), 1.0, True, False)]
    assert _play(CONSTANT, (1.0,), [-1.0]) == [((1.0,), -1.0, True, False)]


def test_an_answer_of_0_is_the_bit_0() -> None:
    assert _play(COPY, (-1.0,), [0.0]) == [((-1.0,), 1.0, True, False)]
    assert _play(COPY, (1.0,), [0.0]) == [((1.0,), -1.0, True, False)]


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


def test_the_curriculums_first_level_is_solved_by_what_its_second_is_not() -> None:
    assert float(_examine(CURRICULUM, SECOND_BIT, 0).success) == 1.0
    assert float(_examine(CURRICULUM, SECOND_BIT, 1).success) == 0.5


@pytest.mark.parametrize("name", RIGHT)
def test_episodes_start_on_every_case_of_the_level_alike_and_on_no_other(name: str) -> None:
    probe = PROBES[name]
    for level, cases in enumerate(probe.cases_at_level):
        keys = jax.random.split(jax.random.key(level), 200 * cases)
        states = jax.vmap(probe.reset, in_axes=(0, None))(keys, jnp.asarray(level, jnp.int32))
        counts = np.bincount(np.asarray(states.inner.case))
        assert len(counts) == cases
        assert counts.min() > 0.7 * 200


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.parametrize("policy", [YES, REPEAT, lambda observation: -jnp.ones(1)], ids=["yes", "repeat", "no"])
def test_the_examination_is_what_episodes_pay_on_average(name: str, policy: PolicyFn) -> None:
    probe = PROBES[name]
    level = jnp.asarray(probe.levels - 1, jnp.int32)
    step = jax.jit(lambda state: probe.step(state, policy(state.observation)))
    returns: dict[int, float] = {}
    for key in jax.random.split(jax.random.key(0), 16 * probe.cases_at_level[-1]):
        state = probe.reset(key, level)
        case, total = int(state.inner.case), 0.0
        if case in returns:
            continue
        while not (state.terminated or state.truncated):
            state = step(state)
            total += float(state.reward)
        returns[case] = total
    assert len(returns) == probe.cases_at_level[-1]
    assert float(_examine(probe, policy, probe.levels - 1).fitness) == pytest.approx(np.mean(list(returns.values())))
    trained = probe.episode(policy, jax.random.key(1), level)
    assert float(trained.fitness) == float(_examine(probe, policy, probe.levels - 1).fitness)
