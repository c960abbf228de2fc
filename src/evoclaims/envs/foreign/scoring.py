"""What all tasks of other libraries' environments share: a name, and how episodes are scored, by their return.

This needs no jax: a training loop that does not use it starts in a third of the time.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from statistics import fmean
from typing import Any, ClassVar

from evoclaims.core.errors import require_at_least

Scored = tuple[float, float, Mapping[str, float]]
"""Fitness, success and metrics of a policy, as a task's `examine` has them."""


@dataclass(frozen=True, kw_only=True)
class ForeignTask(ABC):
    """An environment of another library as a task with one level; training loops act in its own terms.

    Attributes:
        environment_id: as the library takes it.
        examined_episodes: episodes, from different starts, over which an examination averages.
        solved_at: return from which an episode counts as solved; None: no episode does.
    """

    levels: ClassVar[int] = 1

    environment_id: str = field(kw_only=False)
    examined_episodes: int = 10
    solved_at: float | None = None

    def __post_init__(self) -> None:
        """Check the count."""
        require_at_least(1, f"{self.name}'s", examined_episodes=self.examined_episodes)

    @property
    def name(self) -> str:
        """The environment's name, without the module that registers it."""
        return self.environment_id.rpartition(":")[2]

    @abstractmethod
    def examine_natively(self, policy: Callable[[Any], Any], seed: int) -> Scored:
        """Return what a policy of the environment's own observations and actions scores on the host."""

    @property
    def threshold(self) -> float:
        """The return that solves an episode; infinity where none does."""
        return math.inf if self.solved_at is None else self.solved_at

    def scores(self, played: Iterable[tuple[float, int]]) -> Scored:
        """Return the mean return of episodes, the share that is solved, and their mean length, from (return, steps)."""
        returns, lengths = zip(*played, strict=True)
        solved = sum(total >= self.threshold for total in returns) / len(returns)
        return fmean(returns), solved, {"episode_steps": fmean(lengths)}
