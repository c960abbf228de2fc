"""How episodes of another library's environment are scored: by their return, and by the return that solves them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import fmean

from evoclaims.core.errors import UserError


@dataclass(frozen=True, kw_only=True)
class Examination:
    """What an examination asks for.

    Attributes:
        examined_episodes: episodes, from different starts, over which it averages.
        solved_at: return from which an episode counts as solved; None: no episode does.
    """

    examined_episodes: int = 10
    solved_at: float | None = None

    def __post_init__(self) -> None:
        """Check the count."""
        if self.examined_episodes < 1:
            raise UserError(f"An examination has at least 1 episode, not {self.examined_episodes}.")

    @property
    def threshold(self) -> float:
        """The return that solves an episode; infinity where none does."""
        return math.inf if self.solved_at is None else self.solved_at

    def scores(self, played: Iterable[tuple[float, int]]) -> tuple[float, float, Mapping[str, float]]:
        """Return the mean return of episodes, the share that is solved, and their mean length, from (return, steps)."""
        returns, lengths = zip(*played, strict=True)
        solved = sum(total >= self.threshold for total in returns) / len(returns)
        return fmean(returns), solved, {"episode_steps": fmean(lengths)}
