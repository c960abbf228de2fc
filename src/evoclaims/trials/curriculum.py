"""Moving up levels on the device: one rule for every method."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.pytree import pytree

NEVER = -1


@pytree
class Ascent:
    """A trial's position in its task's levels.

    Attributes:
        level: the current training level.
        solved_at: for each level, the number of method steps when it was first solved, or `NEVER`.
        finished: whether the last level is solved.
    """

    level: Int[Array, ""]
    solved_at: Int[Array, " levels"]
    finished: Bool[Array, ""]


def start(levels: int, progression: Any) -> Ascent:
    """Begin at level 0 ("curriculum") or at the last ("direct", "whole_budget")."""
    first = {"curriculum": 0, "direct": levels - 1, "whole_budget": levels - 1}[progression]
    return Ascent(
        level=jnp.array(first, jnp.int32),
        solved_at=jnp.full((levels,), NEVER, jnp.int32),
        finished=jnp.zeros((), bool),
    )


def climb(ascent: Ascent, success: Float[Array, ""], steps: Int[Array, ""]) -> Ascent:
    """Move up one level when `success` is exactly 1 after `steps` steps; finish when the last is solved."""
    last = ascent.solved_at.shape[0] - 1
    solved = success == 1.0
    before = ascent.solved_at[ascent.level]
    return Ascent(
        level=jnp.minimum(ascent.level + solved.astype(jnp.int32), last),
        solved_at=ascent.solved_at.at[ascent.level].set(jnp.where(solved & (before == NEVER), steps, before)),
        finished=ascent.finished | (solved & (ascent.level == last)),
    )
