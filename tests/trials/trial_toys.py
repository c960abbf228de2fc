"""A method that compiles in no time and whose end depends on its seed: what the tests of the engine run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from evoclaims.core.keys import streams
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.base import Policy, Progress
from evoclaims.trials.progress import RunProgress
from evoclaims.trials.spec import Budget, Condition


@dataclass(frozen=True)
class Walker:
    """A random walk whose every step leaves its mark on the champion.

    Attributes:
        chance: probability that a step solves its level.
        hazard: probability that a step gives NaN.
        unhealthy: whether a hazard is told by `healthy` rather than by a NaN fitness.
    """

    name: ClassVar[str] = "walker"
    revision: ClassVar[int] = 1

    chance: float = 0.0
    hazard: float = 0.0
    unhealthy: bool = False

    def init(self, key: jax.Array, task: Any) -> jax.Array:
        return jax.random.normal(key, (4,))

    def step(self, key: jax.Array, task: Any, level: jax.Array, state: jax.Array) -> tuple[jax.Array, Progress]:
        move_key, solve_key, hazard_key = streams(key, "move", "solve", "hazard")
        state = 0.9 * state + jax.random.normal(move_key, (4,))
        hit = jax.random.uniform(hazard_key) < self.hazard
        return state, Progress(
            fitness=jnp.where(hit & (not self.unhealthy), jnp.nan, jnp.sum(jnp.tanh(state))),
            success=(hit | (jax.random.uniform(solve_key) < self.chance)).astype(jnp.float32),
            healthy=~(hit & self.unhealthy),
            metrics={"first": state[0]},
        )

    def best(self, task: Any, state: jax.Array) -> Policy:
        return Policy(parameters=state, function=lambda p, bits: jnp.tanh(p[:1] + p[1] * jnp.sum(jnp.sin(bits * p[2]))))

    def cost(self, task: Any) -> int:
        return 10


def walk(
    chance: float = 0.0, hazard: float = 0.0, unhealthy: bool = False, steps: int = 12, reports: int = 6, bits: int = 4
) -> Condition:
    """Return a condition of walkers on the curriculum of N-parity."""
    budget = Budget(generations=steps, reports=reports)
    return Condition(Walker(chance, hazard, unhealthy), NParity(bits), "curriculum", budget)


class StoppedError(Exception):
    """Stands for whatever ends a process between two reports."""


def stopping(at: int) -> Callable[[RunProgress], None]:
    """Return a watcher that raises at the `at`-th report of training, counted from 1."""
    left = at

    def watch(progress: RunProgress) -> None:
        nonlocal left
        left -= progress.phase == "training"
        if left == 0:
            raise StoppedError

    return watch
