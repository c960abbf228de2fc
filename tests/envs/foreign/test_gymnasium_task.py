"""Gymnasium's environments as tasks, and tasks as environments of Gymnasium."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

import gymnasium
import jax
import numpy as np
from gymnasium.utils.env_checker import check_env

from evoclaims.core.errors import UserError
from evoclaims.core.source_code import code_of
from evoclaims.envs.foreign.gymnasium_task import GymnasiumEnv, GymnasiumTask
from evoclaims.envs.foreign.scoring import ForeignTask
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.random_search import RandomSearch
from evoclaims.methods.training_loop import TrainingLoop
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store
from evoclaims.verdicts import other_code

CART = GymnasiumTask("CartPole-v1", solved_at=100, examined_episodes=4)


@pytest.fixture(autouse=True)
def as_it_is() -> Iterator[None]:
    """Gymnasium's own warnings about its environments are not ours to mend."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="gymnasium")
        yield


def leaning(observation: Any) -> int:
    """Push the cart to where the pole falls: balances it for a few hundred steps."""
    return int(observation[2] + observation[3] > 0)


def test_a_policy_is_examined_on_the_host_from_its_own_starts() -> None:
    assert isinstance(CART, ForeignTask)
    fitness, success, metrics = CART.examine_natively(leaning, 0)
    assert fitness == metrics["episode_steps"] > 100
    assert 0 < success <= 1
    assert CART.examine_natively(leaning, 0) == (fitness, success, metrics)
    assert CART.examine_natively(lambda observation: 0, 0)[0] < 20
    starts = [list[tuple[float, ...]](), list[tuple[float, ...]]()]
    for seed, seen in enumerate(starts):
        CART.examine_natively(lambda observation, seen=seen: seen.append(tuple(observation)) or 0, seed)
    assert set(starts[0]).isdisjoint(starts[1])


def test_examined_starts_are_none_that_seeds_derived_as_numpy_says_have(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    reset = gymnasium.wrappers.TimeLimit.reset

    def watched(self: Any, *, seed: int, **more: Any) -> Any:
        seen.append(seed)
        return reset(self, seed=seed, **more)

    monkeypatch.setattr(gymnasium.wrappers.TimeLimit, "reset", watched)
    CART.examine_natively(lambda observation: 0, 7)
    root = np.random.SeedSequence(7)
    derived = {int(one) for source in (root, *root.spawn(100)) for one in source.generate_state(100)}
    assert len(set(seen)) == 4
    assert derived.isdisjoint(seen)


def test_it_has_the_environment_s_sizes_and_limit() -> None:
    assert (CART.observation_size, CART.action_size, CART.horizon) == (4, 2, 500)
    short = GymnasiumTask("Pendulum-v1", {"g": 9.81}, episode_steps=30, examined_episodes=1)
    assert (short.observation_size, short.action_size, short.horizon) == (3, 1, 30)
    assert short.examine_natively(lambda observation: np.zeros(1, np.float32), 3)[2] == {"episode_steps": 30.0}
    assert short.make().unwrapped.g == 9.81
    several = GymnasiumTask("Blackjack-v1")  # a tuple of choices of 32, 11 and 2
    assert (several.observation_size, several.action_size) == (45, 2)


@pytest.mark.parametrize("wrong", [0, -1])
def test_an_episode_has_a_step(wrong: int) -> None:
    with pytest.raises(UserError, match=f"CartPole-v1's episode_steps must be at least 1, not {wrong}"):
        GymnasiumTask("CartPole-v1", episode_steps=wrong)
    with pytest.raises(UserError, match="CartPole-v1's episode_steps must be a whole number, not 2.5"):
        GymnasiumTask("CartPole-v1", episode_steps=2.5)  # type: ignore[arg-type]


def trains(task: Any, seed: int, budget: Any) -> Any:
    raise AssertionError("no training begins")


def test_an_environment_whose_episodes_may_never_end_is_refused_before_training(store_of: Store) -> None:
    endless = Condition(
        TrainingLoop(trains, packages=()), GymnasiumTask("Blackjack-v1"), "whole_budget", Budget(environment_steps=1)
    )
    with pytest.raises(UserError, match="Episodes of Blackjack-v1 may never end. Write episode_steps="):
        run(endless, [0], store_of, jax.devices("cpu"))


def test_an_unknown_environment_or_setting_is_a_sentence() -> None:
    with pytest.raises(UserError, match=r"Gymnasium cannot make 'CartPole-v9' with {}"):
        GymnasiumTask("CartPole-v9").make()
    with pytest.raises(UserError, match="Gymnasium cannot make 'CartPole-v1' with {'wheels': 4}"):
        GymnasiumTask("CartPole-v1", {"wheels": 4}).make()
    with pytest.raises(UserError, match="Gymnasium cannot make 'FrozenLake-v1' with .*: KeyError 'bad'. Check"):
        GymnasiumTask("FrozenLake-v1", {"map_name": "bad"}).make()
    with pytest.raises(UserError, match=r"CartPole-v1 has providers='ale-py'\. Write a tuple, such as"):
        GymnasiumTask("CartPole-v1", providers="ale-py")  # type: ignore[arg-type]


class Own(gymnasium.Env[Any, Any]):
    pass


class Tenths(gymnasium.Env[Any, Any]):
    """Pays 0.1 a step, whatever is done."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, **_: Any) -> Any:
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> Any:
        return np.zeros(1, np.float32), 0.1, False, False, {}


def test_a_return_is_the_sum_without_errors_on_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    maker: Any = Tenths
    spec = gymnasium.envs.registration.EnvSpec("Tenths-v0", entry_point=maker)
    monkeypatch.setitem(gymnasium.registry, "Tenths-v0", spec)
    task = GymnasiumTask("Tenths-v0", solved_at=0.8, episode_steps=8, examined_episodes=1)
    assert task.examine_natively(lambda observation: 0, 0)[:2] == (0.8, 1.0)


@pytest.mark.parametrize("maker", [Own, f"{__name__}:Own"])
def test_the_class_of_a_user_s_own_environment_is_looked_at(maker: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = gymnasium.envs.registration.EnvSpec("Own-v0", entry_point=maker)
    monkeypatch.setitem(gymnasium.registry, "Own-v0", spec)
    for name in ("Own-v0", f"{__name__}:Own-v0"):
        assert [*code_of(GymnasiumTask(name))] == [f"{__name__}.Own", "the registration of Own-v0"]
    assert [*code_of(CART)] == ["the registration of CartPole-v1"]
    assert code_of(GymnasiumTask("CartPole-v9")) == {}


def test_what_an_environment_is_registered_with_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    def code_with(wrappers: Any = (), **registered: Any) -> Any:
        maker: Any = Own
        spec = gymnasium.envs.registration.EnvSpec("Own-v0", maker, additional_wrappers=wrappers, **registered)
        monkeypatch.setitem(gymnasium.registry, "Own-v0", spec)
        return code_of(GymnasiumTask("Own-v0"))

    wrapper = gymnasium.envs.registration.WrapperSpec("Clipped", "some.module:Clipped", {"most": 1})
    seen = [
        code_with(kwargs=arguments, **limits)
        for arguments in (
            {},
            {"goal": 1.0},
            {"goal": np.ones(2)},
            {"goal": 1.0, "pay": max},
            {"goal": Own()},
            {"goal": {"at": [max, 1]}},
            {"goal": {"at": [max, 2]}},
            {"goal": {1, 2}},
            {"goal": np.float32(0.5)},
            {"goal": Path("a")},
        )
        for limits in ({}, {"max_episode_steps": 9}, {"wrappers": (wrapper,)})
    ]
    assert len({code["the registration of Own-v0"] for code in seen}) == len(seen)
    assert code_with(kwargs={"goal": np.ones(2)}) == seen[6]


def test_a_registration_that_an_older_record_lacks_was_not_edited() -> None:
    condition = Condition(TrainingLoop(gymnasium.make, packages=()), CART, "whole_budget", Budget(environment_steps=9))
    told = [
        condition.edited_since([cast(Any, SimpleNamespace(provenance={"code_hashes": code}))])
        for code in ({}, dict(condition.code), dict.fromkeys(condition.code, "e" * 16))
    ]
    assert told == [(), (), ("the registration of CartPole-v1",)]
    assert "register it under a new name" in other_code.summary("the registration of CartPole-v1")


def test_a_method_that_is_compiled_says_what_to_do_instead(store_of: Store) -> None:
    search = RandomSearch(population=2, network=Mlp((2,)))
    condition = Condition(search, CART, "direct", Budget(generations=1))
    with pytest.raises(
        UserError, match="which runs on the host and not in compiled programs. Train on it with a TrainingLoop"
    ):
        run(condition, [0], store_of, jax.devices("cpu"))


@pytest.fixture
def store_of(tmp_path: Any) -> Store:
    return Store(tmp_path / "store")


def test_a_task_of_ours_is_an_environment_that_gymnasium_accepts() -> None:
    environment = GymnasiumEnv(NParity(3))
    check_env(environment, skip_render_check=True)
    rewards = []
    bits, _ = environment.reset(seed=1)
    for _ in range(8):
        bits, reward, terminated, truncated, _ = environment.step(np.where(bits.sum(keepdims=True) % 2, 1.0, -1.0))
        rewards.append(reward)
    assert (rewards, terminated, truncated) == ([0.0] * 8, True, False)
    assert isinstance(environment.action_space, gymnasium.spaces.Box)


@pytest.mark.parametrize("level", [-1, 2])
def test_a_task_as_an_environment_of_gymnasium_has_the_levels_that_it_has(level: int) -> None:
    with pytest.raises(UserError, match=f"n_parity has no level {level}. Use one from 0 to 1"):
        GymnasiumEnv(NParity(3), level=level)
