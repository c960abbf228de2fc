"""What all tasks of other libraries' environments share: a name, and how episodes are scored, by their return.

This needs no jax: a training loop that does not use it starts in a third of the time.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import fmean
from typing import Any, ClassVar

from evoclaims.core.errors import UserError, require_at_least, require_finite

Scored = tuple[float, float, Mapping[str, float]]
"""Fitness, success and metrics of a policy, as a task's `examine` has them."""


def place_of(maker: Any) -> str:
    """Return where the class or function is that makes an environment, "module:name"."""
    return maker if isinstance(maker, str) else f"{maker.__module__}:{getattr(maker, '__qualname__', '')}"


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
        """Check the names and numbers."""
        if not isinstance(self.environment_id, str) or not isinstance(self.given, Mapping):
            raise UserError(
                f"{type(self).__name__}({self.environment_id!r}, {self.given!r}) does not name an environment and its "
                'settings. Write a name and a table, such as ("CartPole-v1", {"sutton_barto_reward": True}).'
            )
        require_at_least(1, f"{self.name}'s", examined_episodes=self.examined_episodes)
        if self.solved_at is not None:
            require_finite(f"{self.name}'s", solved_at=self.solved_at)

    @property
    def given(self) -> Mapping[str, Any]:
        """What the library makes it with, besides the name."""
        return {}

    @contextmanager
    def making(self, library: str) -> Iterator[None]:
        """Turn what a library raises while it makes the environment into a `UserError`."""
        try:
            yield
        except UserError:
            raise
        except Exception as error:  # each environment has its own way to refuse a setting
            text = str(error).removesuffix(".")
            said = f"{type(error).__name__} {text}".rstrip() if isinstance(error, LookupError) or not text else text
            raise UserError(
                f"{library} cannot make {self.environment_id!r} with {dict(self.given)}: {said}. Check the name and "
                "the settings."
            ) from error

    @property
    def name(self) -> str:
        """The environment's name, without the module that registers it."""
        return self.environment_id.rpartition(":")[2]

    @property
    def place(self) -> str:
        """Where the environment's class is, "module:name", whose edits trials tell; empty where that is not known."""
        return ""

    @abstractmethod
    def examine_natively(self, policy: Callable[[Any], Any], seed: int) -> Scored:
        """Return what a policy of the environment's own observations and actions scores on the host."""

    @property
    def threshold(self) -> float:
        """The return that solves an episode; infinity where none does."""
        return math.inf if self.solved_at is None else self.solved_at

    def scores(self, played: Iterable[tuple[float, int, bool]]) -> Scored:
        """Return the mean return of episodes, the share that is solved, and their mean length.

        Args:
            played: of each episode the return, the steps, and whether all its numbers were finite.
        """
        returns, lengths, sound = zip(*played, strict=True)
        solved = sum(fine and total >= self.threshold for total, fine in zip(returns, sound, strict=True)) / len(
            returns
        )
        return fmean(returns), solved, {"episode_steps": fmean(lengths)}
