"""The programs of a condition: a trial that has ended stands still, and an idle lane never starts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from trial_toys import walk

from evoclaims.trials.lanes import Lanes
from evoclaims.trials.layout import Layout
from evoclaims.trials.program import Program, TrialState

SEEDS = np.arange(8, dtype=np.int32)
IDLE = np.arange(8) == 6


def _advanced(layout: Layout, chunks: list[int], **toy: Any) -> list[TrialState]:
    """Return the state after each chunk, on the host."""
    program = Program(walk(**toy))
    start, advance = jax.jit(layout.over_trials(program.start)), jax.jit(layout.advance(program))
    width = 1 if layout.alone else len(SEEDS)
    shares, states = [start(SEEDS[i : i + width], IDLE[i : i + width]) for i in range(0, len(SEEDS), width)], []
    for until in chunks:
        shares = [advance(share, jnp.full(width, until, jnp.int32))[0] for share in shares]
        states.append(Lanes.gather(shares))
    return states


def _leaves(state: TrialState, lane: int) -> list[bytes]:
    return [np.asarray(leaf)[lane].tobytes() for leaf in jax.tree.leaves(state)]


def test_alone_a_trial_that_has_ended_no_longer_changes_and_an_idle_lane_takes_no_step() -> None:
    half, whole = _advanced(Layout.ALONE, [6, 12], chance=0.4, hazard=0.05)
    ended = np.asarray(half.ascent.finished | half.diverged)
    assert 0 < ended.sum() < len(SEEDS) - 1
    for lane in range(len(SEEDS)):
        same = _leaves(half, lane) == _leaves(whole, lane)
        assert same == (bool(ended[lane]) or bool(IDLE[lane]))
    assert whole.steps[6] == 0
    assert np.asarray(whole.steps)[~IDLE].min() > 0


def test_side_by_side_trials_stop_where_one_ends_and_go_on_when_it_is_idle() -> None:
    """Each is then, where it ends, the trial alone."""
    program = Program(walk(chance=0.4, hazard=0.05))
    (alone,) = _advanced(Layout.ALONE, [12], chance=0.4, hazard=0.05)
    start, advance = jax.jit(jax.vmap(program.start)), jax.jit(program.advance_together)
    state, idle, until = start(SEEDS, IDLE), IDLE.copy(), jnp.full(len(SEEDS), 12, jnp.int32)
    stops = []
    while not idle.all():
        state, report = advance(state, until)
        here, ended = Lanes.gather([state]), np.asarray(report.ended) & ~idle
        assert ended.any()
        assert len(set(here.steps[~idle])) == 1
        again, _ = advance(state, until)  # nobody has taken note of the end: nothing moves
        assert [leaf.tobytes() for leaf in jax.tree.leaves(Lanes.gather([again]))] == [
            leaf.tobytes() for leaf in jax.tree.leaves(here)
        ]
        for lane in np.flatnonzero(ended):
            assert _leaves(here, lane) == _leaves(alone, lane)
        idle |= ended
        state = replace(state, idle=jnp.asarray(idle))
        stops.append(int(here.steps.max()))
    assert stops == sorted(set(stops))
    assert len(stops) > 2
    last = Lanes.gather([state])
    assert [last.steps[lane] for lane in range(len(SEEDS))] == alone.steps.tolist()
    assert last.diverged.tolist() == alone.diverged.tolist()


def test_chunks_of_any_length_lead_to_the_same_bits() -> None:
    whole = _advanced(Layout.ALONE, [12], chance=0.1, hazard=0.02)[-1]
    parts = _advanced(Layout.ALONE, [1, 2, 7, 12], chance=0.1, hazard=0.02)[-1]
    assert [leaf.tobytes() for leaf in jax.tree.leaves(whole)] == [leaf.tobytes() for leaf in jax.tree.leaves(parts)]


def test_no_trial_goes_beyond_its_budget() -> None:
    (state,) = _advanced(Layout.ALONE, [1000], steps=5)
    assert np.asarray(state.steps)[~IDLE].tolist() == [5] * 7
