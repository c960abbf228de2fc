"""Tasks as environments of Gymnasium, for training loops that expect those."""

from __future__ import annotations

from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Task


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
