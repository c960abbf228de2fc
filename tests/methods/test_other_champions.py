"""Champions of all training, shared starts, and PPO's environments that return to their first state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from plane import Plane

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Episode
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.neat.evolution import GenomeMethod
from evoclaims.methods.neat.settings import Mutation, Settings, Species
from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout
from evoclaims.trials.spec import Budget, Condition
from reproductions.nisioti2025 import ecorobot
from reproductions.nisioti2025.other_champions import BestEverNeat, OtherCmaEs, with_shared_starts
from reproductions.nisioti2025.other_ppo import OtherPpo
from reproductions.nisioti2025.other_stones import OtherStones
from reproductions.nisioti2025.stones_details import as_kind, best_ever

LEVEL = jnp.int32(0)
TASK = OtherStones(episode_steps=10, pays="once")


class Chancy(Plane):
    """A task whose episodes differ by chance, as the robots' do, and that compiles sooner than one with a robot."""

    def episode(self, policy: Any, key: jax.Array, level: Any) -> Episode:
        played = super().episode(policy, key, level)
        return replace(played, fitness=played.fitness + jax.random.normal(key))


@dataclass(frozen=True)
class ChancyParity(NParity):
    """The same for the engine, which asks more of a task than `Plane` has."""

    def episode(self, policy: Any, key: jax.Array, level: Any) -> Episode:
        played = super().episode(policy, key, level)
        return replace(played, fitness=played.fitness + jax.random.normal(key))


def test_neat_keeps_the_first_champion_until_an_episode_beats_it_and_evolves_as_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plain: Any = ecorobot.SMOKE["neat", "stones"]
    kept: Any = best_ever("neat", "stones", plain)
    task: Any = Chancy()
    step = jax.jit(partial(GenomeMethod.step, plain.method), static_argnums=1)
    monkeypatch.setattr(GenomeMethod, "step", lambda self, *arguments: step(*arguments))  # compiled once for both
    start = jax.jit(lambda key: plain.method.init(key, task))(jax.random.key(0))
    states = {"plain": start, "kept": start}
    best = -np.inf
    for generation in range(5):
        for name, one in (("plain", plain), ("kept", kept)):
            states[name], progress = one.method.step(jax.random.key(generation), task, LEVEL, states[name])
        new = float(states["plain"].episode.fitness)
        if new > best:
            best, genome = new, states["plain"].champion
        assert float(states["kept"].episode.fitness) == best
        assert float(progress.fitness) == new
        assert all(map(np.array_equal, jax.tree.leaves(states["kept"].champion), jax.tree.leaves(genome)))
    same = map(np.array_equal, jax.tree.leaves(states["kept"].population), jax.tree.leaves(states["plain"].population))
    assert all(same)


def test_side_by_side_neat_keeps_its_champion_too_in_arrays_of_several_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evoclaims.trials.lanes.layout_on", lambda platform: Layout.VECTOR)
    monkeypatch.setattr("evoclaims.methods.neat.capacity.SMALLER", ((5, 7), (6, 9)))
    settings = Settings(
        population=12,
        nodes=10,
        connections=24,
        mutation=Mutation(node_add=0.9, connection_add=0.9),
        species=Species(most=3, survival=0.4),
    )
    task = ChancyParity(3)
    condition = Condition(BestEverNeat(settings), task, "curriculum", Budget(generations=9))
    lanes, best, places = Lanes(condition, jax.devices("cpu")[:1]), np.full(2, -np.inf), set()
    with jax.debug_key_reuse(False):  # jax takes the keys of a condition under vmap for used
        state = lanes.start([0, 1], 2)
        for generation in range(1, 9):
            method = state[0].method
            places.add(int(jax.vmap(partial(condition.method.size_for, task))(method).max()))
            state, report = lanes.advance(state, generation, 2)
            best = np.maximum(best, report.fitness)
            np.testing.assert_array_equal(state[0].method.episode.fitness, best)
            assert report.level.tolist() == [0, 0]
    assert places == {0, 1, 2}


def test_shared_starts_give_every_key_the_mean_of_the_same_episodes() -> None:
    starts, task = jax.random.split(jax.random.key(3), 2), Chancy()
    together, usual = (
        jax.jit(lambda key, of=of: of.episode(jnp.tanh, key, LEVEL).fitness)
        for of in (with_shared_starts(task, starts), task)
    )
    with jax.debug_key_reuse(False):  # the starts are meant to be used again
        one, other = (float(together(jax.random.key(seed))) for seed in (0, 1))
    assert one == other == pytest.approx(np.mean([float(usual(start)) for start in starts]))
    assert float(usual(jax.random.key(0))) != one


def test_common_starts_cost_as_many_episodes() -> None:
    cma_es = OtherCmaEs(population=8, starts=2)
    assert cma_es.cost(TASK) == 8 * 2 * 10
    with pytest.raises(UserError, match="0 or more common starts"):
        OtherCmaEs(starts=-1)


@pytest.mark.parametrize("kept", [False, True])
def test_ended_episodes_return_to_their_first_state_with_or_without_their_counters(kept: bool) -> None:
    learner = as_kind(OtherPpo, ecorobot.SMOKE["ppo", "stones"].method, first_state=True, kept_counters=kept)
    begun = jax.jit(lambda key: learner.init(key, TASK))(jax.random.key(0)).interaction
    reached = replace(begun.states, truncated=jnp.arange(32) < 16)
    memory = replace(reached.inner.memory, crossed=jnp.full(32, 3).at[0].set(7), steps=jnp.full(32, 9))
    reached = replace(reached, inner=replace(reached.inner, memory=memory, time=jnp.full(32, 9)), reward=jnp.ones(32))
    after = begun.after(TASK, jax.random.key(1), reached).states
    assert np.array_equal(after.inner.time, [0] * 16 + [9] * 16)
    assert np.array_equal(after.observation, begun.states.observation)
    assert np.array_equal(after.inner.memory.crossed, [0] + [3 * kept] * 15 + [3] * 16)
    assert np.array_equal(after.inner.memory.steps, [0] + [9 * kept] * 15 + [9] * 16)


def test_counters_are_kept_only_with_first_states() -> None:
    with pytest.raises(UserError, match="first state"):
        OtherPpo(kept_counters=True)


def test_frozen_noise_is_one_draw_and_is_not_the_mean() -> None:
    plain = ecorobot.SMOKE["ppo", "stones"].method
    noisy = as_kind(OtherPpo, plain, frozen_noise=True)
    state = jax.jit(lambda key: plain.init(key, TASK))(jax.random.key(0))
    seen = state.interaction.states.observation[0]
    mean, one, other = (learner.best(TASK, state)(seen) for learner in (plain, noisy, noisy))
    assert np.array_equal(one, other)
    assert not np.allclose(one, mean, atol=0.01)
