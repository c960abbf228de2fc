"""PPO's training step, and the test that moves it up a level."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from probes import CONSTANT, Probe
from workbench import Workbench, leaves

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.ppo import LevelTest, Ppo

pytestmark = pytest.mark.newest

SMALL = Ppo(policy_layers=(3,), value_layers=(3,), environments=4, batch_size=4, minibatches=1, updates_per_batch=1)
ALWAYS_RIGHT = Probe("always_right", cases=((((0.0,), None),),), cases_at_level=(1,))


def test_one_step_changes_every_layer_of_both_networks(benches: dict[str, Workbench]) -> None:
    bench = benches["ppo"]
    before = bench.init()
    after, _ = bench.run(1, state=before)
    for network in ("policy", "value"):
        pairs = zip(leaves(getattr(before.networks, network)), leaves(getattr(after.networks, network)), strict=True)
        assert all(np.abs(one - other).max() > 0 for one, other in pairs)
    assert int(after.steps) == 1


def test_the_observations_statistics_are_those_of_what_was_collected(benches: dict[str, Workbench]) -> None:
    bench = benches["ppo"]
    state, _ = bench.run(3, level=1)
    count = float(state.statistics.count.lo) if hasattr(state.statistics.count, "lo") else float(state.statistics.count)
    assert count == 3 * bench.method.cost(bench.task)
    assert np.all(np.asarray(state.statistics.mean) > 0.2)
    assert np.all(np.asarray(state.statistics.mean) < 0.8)


def test_a_step_at_another_level_trains_on_episodes_of_that_level(benches: dict[str, Workbench]) -> None:
    bench = benches["ppo"]
    low, _ = bench.run(4, level=0)
    assert set(np.asarray(low.interaction.states.observation)[:, 0].tolist()) == {0.0}
    high, _ = bench.run(1, level=1, state=low)
    assert int(high.interaction.level) == 1
    assert set(np.asarray(high.interaction.states.inner.level).tolist()) == {1}
    assert set(np.asarray(high.interaction.states.observation)[:, 0].tolist()) == {0.0, 1.0}


def test_success_is_told_only_by_the_steps_that_test_for_it_and_is_exactly_1_without_an_error() -> None:
    """41 · float32(1 / 41), as XLA divides by a constant, would be 0.99999994: a test that nobody passes."""
    bench = Workbench(replace(SMALL, level_test=LevelTest(every=3, sampled_episodes=41)), ALWAYS_RIGHT)
    _, reports = bench.run(7)
    assert [float(progress.success) for progress in reports] == [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]
    assert {float(progress.fitness) for progress in reports} == {0.0}


def test_without_tests_no_success_is_told_and_the_fitness_is_what_training_paid() -> None:
    paying = Probe("always_paid", cases=((((0.0,), None),),), cases_at_level=(1,))
    bench = Workbench(replace(SMALL, level_test=LevelTest(every=0)), paying)
    _, reports = bench.run(3)
    assert [float(progress.success) for progress in reports] == [0.0, 0.0, 0.0]
    paid = [float(progress.metrics["training_reward"]) * paying.horizon for progress in reports]
    assert [float(progress.fitness) for progress in reports] == pytest.approx(paid)


def test_the_published_test_asks_the_stochastic_policy_and_forgives_no_error() -> None:
    sampled = Workbench(replace(SMALL, level_test=LevelTest(sampled_episodes=128)), CONSTANT)
    told = [float(progress.success) for progress in sampled.run(5)[1]]
    assert all(success * 128 == int(success * 128) for success in told)
    assert all(0.0 < success < 1.0 for success in told)  # an untrained policy errs now and then
    assert len(set(told)) > 1


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"environments": 0}, "PPO's environments must be at least 1, not 0"),
        ({"unroll_length": 0}, "PPO's unroll_length must be at least 1"),
        ({"batch_size": 0}, "PPO's batch_size must be at least 1"),
        ({"minibatches": -1}, "PPO's minibatches must be at least 1, not -1"),
        ({"updates_per_batch": 0}, "PPO's updates_per_batch must be at least 1"),
        ({"environments": 3}, r"batch_size=4, minibatches=1 and environments=3. Write numbers"),
        ({"environments": 8}, "is a multiple of environments"),
        ({"policy_layers": (4, 0)}, "Write at least 1 neuron for each layer"),
        ({"value_layers": (-1,)}, "Write at least 1 neuron for each layer"),
    ],
)
def test_impossible_sizes_are_one_sentence(wrong: dict[str, Any], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        replace(SMALL, **wrong)


@pytest.mark.parametrize("wrong", [{"every": -1}, {"sampled_episodes": -1}])
def test_an_impossible_level_test_is_one_sentence(wrong: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="The level test's [a-z_]+ must be at least 0, not -1"):
        LevelTest(**wrong)


def test_sampled_episodes_of_more_than_one_step_are_one_sentence() -> None:
    """On a whole table every one of them would ask the first row."""
    sampled = replace(SMALL, level_test=LevelTest(sampled_episodes=8))
    with pytest.raises(UserError, match=r"plays one step of each, but an episode of n_parity has up to 8.*sampling="):
        sampled.init(jax.random.key(0), NParity(3, sampling="exhaustive"))
    sampled.init(jax.random.key(0), NParity(3, sampling="sampled"))
    SMALL.init(jax.random.key(0), NParity(3, sampling="exhaustive"))


class _Silent(Probe):
    errors_cost: ClassVar[bool] = False


def test_sampled_episodes_whose_errors_need_not_cost_are_one_sentence() -> None:
    """Of any other reward each that is not below 0 would count as success."""
    sampled = replace(SMALL, level_test=LevelTest(sampled_episodes=8))
    with pytest.raises(UserError, match=r"nothing says that silent pays so\. Write `errors_cost:"):
        sampled.init(jax.random.key(0), _Silent("silent", cases=((((0.0,), None),),), cases_at_level=(1,)))


def test_a_no_is_learnt_where_a_no_is_paid() -> None:
    """The gradient's sign; that a yes is learnt where a yes is paid, a probe shows."""
    no = Probe("constant_no", cases=((((0.0,), 0),), (((1.0,), 0),)), cases_at_level=(2,))
    learner = replace(SMALL, environments=32, batch_size=32, updates_per_batch=8, learning_rate=3e-2)
    bench = Workbench(learner, no)
    policy = bench.method.best(no, bench.run(10)[0])
    assert [float(policy(jnp.array([bit]))[0]) < 0 for bit in (0.0, 1.0)] == [True, True]
