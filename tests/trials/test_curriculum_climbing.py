"""Climbing: one rule that moves every method through the levels."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.trials.program import NEVER, Ascent, climb, start

successes = st.lists(st.sampled_from([0.0, 0.5, float(np.nextafter(np.float32(1), np.float32(0))), 1.0]), max_size=12)
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


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 4), successes)
def test_a_curriculum_solves_as_many_levels_as_there_were_full_successes(levels: int, series: list[float]) -> None:
    last = _ascents(levels, "curriculum", series)[-1]
    assert int((last.solved_at != NEVER).sum()) == min(levels, series.count(1.0))
    reached = last.solved_at[last.solved_at != NEVER]
    assert sorted(reached) == list(reached)


@pytest.mark.parametrize("success", [float("nan"), 1.0000001, 2.0, -1.0])
def test_only_a_success_of_exactly_one_solves(success: Any) -> None:
    _, ended = _ascents(2, "curriculum", [success])
    assert ended.level == 0
    assert (ended.solved_at == NEVER).all()
