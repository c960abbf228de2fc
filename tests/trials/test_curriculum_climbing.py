"""Climbing: one rule that moves every method through the levels."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.trials.program import NEVER, Ascent, climb, start

below = float(np.nextafter(np.float32(1), np.float32(0)))
successes = st.lists(st.sampled_from([-1.0, 0.0, 0.5, below, 1.0, 1.0000001, 2.0, float("nan")]), max_size=12)
_climb = jax.jit(climb)


def _ascents(levels: int, progression: str, series: list[float]) -> list[Ascent]:
    """Return the ascent before the first and after every step."""
    ascents = [start(levels, progression)]
    for steps, success in enumerate(series, start=1):
        ascents.append(_climb(ascents[-1], jnp.float32(success), jnp.int32(steps)))
    return jax.device_get(ascents)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 4), st.sampled_from(["curriculum", "direct"]), successes)
def test_an_ascent_only_goes_up_and_finishes_when_the_last_level_was_solved(
    levels: int, progression: str, series: list[float]
) -> None:
    ascents = _ascents(levels, progression, series)
    for before, after, success, steps in zip(ascents, ascents[1:], series, range(1, 99), strict=False):
        assert before.level <= after.level <= before.level + 1
        assert after.level <= levels - 1
        assert (after.level > before.level) == (success == 1.0 and before.level < levels - 1)
        assert bool(after.finished) >= bool(before.finished)
        assert bool(after.finished) == bool(before.finished or (success == 1.0 and before.level == levels - 1))
        for level in range(levels):
            was, now = before.solved_at[level], after.solved_at[level]
            first = success == 1.0 and level == before.level and was == NEVER
            assert now == (steps if first else was)
        assert bool(after.finished) == (after.solved_at[levels - 1] != NEVER)
