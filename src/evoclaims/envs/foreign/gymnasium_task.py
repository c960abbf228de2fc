"""Environments of Gymnasium as tasks, for training loops, on the host; and tasks as environments of Gymnasium."""

from __future__ import annotations

import contextlib
import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from pathlib import PurePath
from typing import Any, ClassVar, Final, NoReturn

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError, require_at_least
from evoclaims.envs.base import Task
from evoclaims.envs.foreign.native_actions import native_action
from evoclaims.envs.foreign.scoring import ForeignTask, Scored, place_of

EXAMINED: Final = 0x6576_6F63
"""Key of the seeds of examined episodes: one that nobody else derives seeds by."""


@dataclass(frozen=True, kw_only=True)
class GymnasiumTask(ForeignTask):
    """An environment of Gymnasium, such as `GymnasiumTask("CartPole-v1", solved_at=475)`, with one level.

    Training loops train on what `make` returns. Built-in methods are compiled with their task; this one cannot be.

    Attributes:
        environment_id: as `gymnasium.make` takes it; "module:Name-v0" imports the module that registers it.
        settings: its further arguments.
        episode_steps: environment steps after which an episode is truncated; None for its own limit.
        providers: distributions other than Gymnasium that compute the environment, such as ("ale-py",).
    """

    revision: ClassVar[int] = 2

    settings: Mapping[str, Any] = field(default_factory=dict, hash=False, kw_only=False)
    episode_steps: int | None = None
    providers: tuple[str, ...] = field(default=(), metadata={"canonical": False})

    def __post_init__(self) -> None:
        """Check the counts."""
        super().__post_init__()
        if self.episode_steps is not None:  # Gymnasium takes -1 for none
            require_at_least(1, f"{self.name}'s", episode_steps=self.episode_steps)
        if not isinstance(self.providers, tuple):  # a word would be as many packages as it has letters
            raise UserError(f'{self.name} has providers={self.providers!r}. Write a tuple, such as ("ale-py",).')

    @property
    def given(self) -> Mapping[str, Any]:
        """The settings."""
        return self.settings

    @property
    def packages(self) -> tuple[str, ...]:
        """The distributions that compute it."""
        return ("gymnasium", *self.providers)

    @property
    def place(self) -> str:
        """Where the environment's class is, as it was registered."""
        try:
            if module := self.environment_id.rpartition(":")[0]:
                importlib.import_module(module)
            return place_of(gymnasium.spec(self.name).entry_point)
        except Exception:  # `make` says what is wrong
            return ""

    @property
    def registered(self) -> Mapping[str, Any]:
        """The arguments, limit and wrappers that the environment is registered with; none where `make` says why."""
        if not self.place:
            return {}
        spec = gymnasium.spec(self.name)
        wrappers = [[one.entry_point, _plain(one.kwargs or {})] for one in spec.additional_wrappers]
        return {"kwargs": _plain(spec.kwargs), "max_episode_steps": spec.max_episode_steps, "wrappers": wrappers}

    def make(self) -> Any:
        """Return a new environment; seed it by its `reset(seed=...)`.

        Raises:
            UserError: when Gymnasium does not make the environment.
        """
        with self.making("Gymnasium"):
            return gymnasium.make(self.environment_id, max_episode_steps=self.episode_steps, **self.settings)

    @cached_property
    def observation_size(self) -> int:
        """How many numbers an observation has."""
        return _size(self._spaces[0])

    @cached_property
    def action_size(self) -> int:
        """How many numbers choose an action."""
        space = self._spaces[1]
        return int(space.n) if space.shape == () and hasattr(space, "n") else _size(space)

    @cached_property
    def horizon(self) -> int:
        """Environment steps of the longest episode.

        Raises:
            UserError: when nothing limits it.
        """
        limit = self.episode_steps or self._spaces[2]
        if limit is None:
            raise UserError(f"Episodes of {self.name} may never end. Write episode_steps=..., the longest episode.")
        return int(limit)

    @cached_property
    def _spaces(self) -> tuple[Any, Any, int | None]:
        """The spaces of observations and actions, and the limit of steps if there is one."""
        with contextlib.closing(self.make()) as environment:
            return environment.observation_space, environment.action_space, environment.spec.max_episode_steps

    def examine_natively(self, policy: Callable[[Any], Any], seed: int) -> Scored:
        """Run `examined_episodes` from different starts and average; success is the share that is solved."""
        # Training with the seeds 0, 1, 2, …, or with those that `SeedSequence(seed).spawn` makes, has other starts.
        seeds = np.random.SeedSequence(seed, spawn_key=(EXAMINED,)).generate_state(self.examined_episodes)
        with contextlib.closing(self.make()) as environment:

            def played(start: Any) -> tuple[float, int, bool]:
                observation, _ = environment.reset(seed=int(start))
                rewards: list[float] = []
                ended = False
                while not ended and len(rewards) < self.horizon:
                    action = native_action(environment.action_space, policy(observation), self.name)
                    observation, reward, terminated, truncated, _ = environment.step(action)
                    rewards.append(float(reward))
                    ended = terminated or truncated
                total = sum(rewards)  # of eight times 0.1 less than 0.8, before Python 3.12
                return math.fsum(rewards) if math.isfinite(total) else total, len(rewards), True

            return self.scores(map(played, seeds))

    def reset(self, *_: Any, **__: Any) -> NoReturn:
        """Raise a `UserError`: this runs on the host, and not in a compiled program."""
        raise UserError(
            f"{self.name} is an environment of Gymnasium, which runs on the host and not in compiled programs. Train "
            "on it with a TrainingLoop, or take the same environment from gymnax or Brax (GymnaxTask, BraxTask), on "
            "which every method trains."
        )

    step = episode = examine = reset


def _plain(value: Any) -> Any:
    """Return arguments that can be hashed: of functions and other objects where they, or their classes, are."""
    if isinstance(value, Mapping):
        return {str(word): _plain(one) for word, one in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if isinstance(value, set | frozenset):
        return sorted(repr(_plain(one)) for one in value)
    if isinstance(value, np.generic):  # releases of NumPy write it in several ways
        value = value.item()
    if isinstance(value, Enum):
        return f"{place_of(type(value))}.{value.name}"
    if value is None or isinstance(value, bool | int | float | str | np.ndarray):
        return value
    return str(value) if isinstance(value, PurePath) else place_of(value if callable(value) else type(value))


def _size(space: Any) -> int:
    """Return how many numbers an element of a space has, flattened where it consists of others."""
    return int(gymnasium.spaces.flatdim(space) if space.shape is None else np.prod(space.shape))


class GymnasiumEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A task in Gymnasium's API: one environment, at one level.

    Actions are in [-1, 1]. `reset(seed=...)` makes all later episodes repeatable.
    """

    def __init__(self, task: Task, level: int | None = None) -> None:
        """Wrap a task, at its last level unless another is named.

        Raises:
            UserError: when the task has no such level.
        """
        if level is not None and not 0 <= level < task.levels:
            raise UserError(f"{task.name} has no level {level}. Use one from 0 to {task.levels - 1}.")
        self.task = task
        self.level = task.levels - 1 if level is None else level
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (task.observation_size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (task.action_size,), np.float32)
        self._reset, self._step = jax.jit(task.reset), jax.jit(task.step)
        self._state: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        key = jax.random.key(int(self.np_random.integers(2**31)))
        self._state = self._reset(key, jnp.int32(self.level))
        return np.asarray(self._state.observation), {}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Act once."""
        self._state = state = self._step(self._state, jnp.asarray(action, jnp.float32))
        return np.asarray(state.observation), float(state.reward), bool(state.terminated), bool(state.truncated), {}
