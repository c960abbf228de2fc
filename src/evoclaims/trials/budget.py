"""How long a trial trains.

This needs no jax, as little as a training loop that does not use it: each of its trials starts in a fifth of the time.
"""

from __future__ import annotations

from dataclasses import dataclass

from evoclaims.core.errors import UserError


@dataclass(frozen=True)
class Budget:
    """The training length of one trial, in the method's own unit: set `generations` or `environment_steps`.

    Attributes:
        generations: steps of the method, for evolution (one generation per step).
        environment_steps: interactions with the task, for reinforcement learning; rounded up to whole steps of
            the method.
        reports: points on the training curve.

    Raises:
        UserError: unless exactly one of the two lengths is given, and all numbers are whole and at least 1.
    """

    generations: int | None = None
    environment_steps: int | None = None
    reports: int = 50

    def __post_init__(self) -> None:
        """Reject budgets with no length, two lengths, or one below 1."""
        lengths = [x for x in (self.generations, self.environment_steps) if x is not None]
        whole = all(type(number) is int and number >= 1 for number in (*lengths, self.reports))
        if len(lengths) != 1 or not whole:  # 1e3 would be another trial than 1000
            raise UserError(
                "A budget names exactly one of generations and environment_steps, a whole number of at least 1, and at "
                f"least one report; this one has generations={self.generations}, "
                f"environment_steps={self.environment_steps}, reports={self.reports}."
            )

    def steps(self, cost: int) -> int:
        """Return the number of steps of a method that spends `cost` environment steps per step."""
        if self.generations is not None:
            return self.generations
        assert self.environment_steps is not None
        return -(-self.environment_steps // cost)

    def chunk(self, cost: int) -> int:
        """Return how many steps lie between two reports."""
        return -(-self.steps(cost) // self.reports)
