"""How an action of our methods, a vector of numbers, chooses one of another library's environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from evoclaims.core.errors import UserError


@dataclass(frozen=True)
class Choice:
    """One of `size` actions: that of the largest number."""

    size: int

    def chosen(self, numbers: Float[Array, " action"]) -> Int[Array, ""]:
        """Return the action's index."""
        return jnp.argmax(numbers).astype(jnp.int32)


@dataclass(frozen=True)
class Range:
    """An array of numbers, each in a range: -1 is the lowest, 1 the highest, and beyond these is clipped.

    A number without bounds is taken as it is.

    Attributes:
        low, high: bounds of each number.
        shape: of the array.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return len(self.low)

    def chosen(self, numbers: Float[Array, " action"]) -> Float[Array, ...]:
        """Return the array."""
        low, high = np.asarray(self.low, np.float32), np.asarray(self.high, np.float32)
        bounded = np.isfinite(low) & np.isfinite(high)
        base, width = np.where(bounded, low, 0.0), np.where(bounded, high - low, 0.0)
        scaled = base + (jnp.clip(numbers, -1.0, 1.0) + 1.0) * width / 2.0
        return jnp.where(bounded, scaled, numbers).astype(jnp.float32).reshape(self.shape)


def actions_of(space: Any, what: str) -> Choice | Range:
    """Return how actions of a space, Gymnasium's or gymnax's, are chosen.

    Raises:
        UserError: for spaces that are neither a choice nor an array.
    """
    if hasattr(space, "n") and space.shape == () and getattr(space, "start", 0) == 0:
        return Choice(int(space.n))
    if hasattr(space, "low") and hasattr(space, "high"):
        low, high = (np.broadcast_to(np.asarray(x, np.float64), space.shape) for x in (space.low, space.high))
        return Range(tuple(map(float, low.ravel())), tuple(map(float, high.ravel())), tuple(space.shape))
    raise UserError(f"The actions of {what} are a {type(space).__name__}; only Discrete and Box ones can be chosen.")
