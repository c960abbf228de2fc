"""Holm's correction."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.judging.exact import holm, smallest


@pytest.fixture(scope="module")
def _little_garbage() -> Iterator[None]:
    """Keep garbage collection, which statsmodels asks for at every call, from going through all programs of a run."""
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("_little_garbage")
@given(st.lists(st.floats(0, 1), max_size=6))
@settings(deadline=None, max_examples=30)
def test_holm_steps_down_from_the_smallest_p(ps: list[float]) -> None:
    order = sorted(range(len(ps)), key=ps.__getitem__)
    expected, running = [0.0] * len(ps), 0.0
    for step, index in enumerate(order):
        running = max(running, min(1.0, (len(ps) - step) * ps[index]))
        expected[index] = running
    assert holm(ps) == pytest.approx(tuple(expected))


@pytest.mark.usefixtures("_little_garbage")
@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
@settings(deadline=None, max_examples=30)
def test_the_smallest_is_that_of_all(ps: list[float]) -> None:
    assert smallest(ps) == min(holm(ps))
