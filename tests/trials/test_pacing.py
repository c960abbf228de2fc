"""How far one call of a device goes, and when a checkpoint is due."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.trials.runner import AFFORDED, CALL_SECONDS, Rhythm, Strides


@given(st.floats(1e-6, 1e4), st.integers(1, 10**6))
def test_calls_lead_to_the_end_each_about_as_long_as_it_may_be(per_step: float, steps: int) -> None:
    strides, reached, calls = Strides(), 0, 0
    assert strides.seconds_for(steps) is None
    while reached < steps and calls < 50:
        until = strides.after(reached, steps)
        assert reached < until <= steps
        took = until - reached
        assert took == 1 or (calls and took * per_step <= CALL_SECONDS * 1.001)  # nothing is known of the first
        if calls > 0 and until < steps:
            assert (took + 1) * per_step > CALL_SECONDS * 0.999
        strides.took(took, took * per_step)
        assert strides.seconds_for(10) == pytest.approx(10 * per_step)
        reached, calls = until, calls + 1


def test_a_call_that_took_no_time_to_speak_of_is_followed_by_the_rest() -> None:
    strides = Strides()
    strides.took(1, 0.0)
    assert strides.after(1, 1000) == 1000


class Clock:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr("evoclaims.trials.runner.time.monotonic", lambda: self.now)

    def passes(self, seconds: float) -> None:
        self.now += seconds


@pytest.mark.parametrize(
    ("cost", "interval"), [(0.0, 2.0), (AFFORDED, 2.0), (10 * AFFORDED, 20.0), (100.0, 200 / AFFORDED)]
)
def test_a_checkpoint_is_due_after_its_time_and_later_where_it_is_dear(
    cost: float, interval: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock(monkeypatch)
    rhythm = Rhythm(2.0)
    clock.passes(1.9)
    assert not rhythm.due
    clock.passes(0.2)
    assert rhythm.due
    with rhythm.saving():
        clock.passes(cost)
    clock.passes(0.9 * interval)
    assert not rhythm.due
    clock.passes(0.2 * interval)
    assert rhythm.due
    at_once = Rhythm(0.0)
    with at_once.saving():
        clock.passes(cost)
    assert at_once.due
