"""Conditions that differ in a task's numbers alone share their compiled programs."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.keys import trial_key
from evoclaims.envs.ecorobot.locomotion import Heights, Obstacles
from evoclaims.envs.ecorobot.stones import SteppingStones
from evoclaims.methods.random_policy import RandomPolicy
from evoclaims.networks.mlp import Mlp
from evoclaims.trials.program import Program, TrialState
from evoclaims.trials.spec import Budget, Condition

pytestmark = pytest.mark.slow

HEIGHTS: tuple[Heights, ...] = ("hierarchical", "high")
METHOD = RandomPolicy(Mlp((4,)))
SEED, NOT_IDLE, ONE = jnp.zeros((), jnp.int32), jnp.zeros((), bool), jnp.ones((), jnp.int32)


def _program(task: Obstacles | SteppingStones) -> Program:
    """Return the functions of a condition that looks once."""
    return Program(Condition(METHOD, task, "whole_budget", Budget(generations=1, reports=1)))


def _texts(task: Obstacles) -> list[str]:
    """Return what the compiler is given: to start, to train, and to judge."""
    program = _program(task)
    trial = jax.eval_shape(program.start, SEED, NOT_IDLE)
    programs = (program.start, (SEED, NOT_IDLE)), (program.advance, (trial, ONE)), (program.examine, (trial,))
    return [jax.jit(function).lower(*arguments).as_text() for function, arguments in programs]


def test_obstacles_of_all_heights_are_one_program() -> None:
    starts, trainings, judgements = zip(*(_texts(Obstacles(heights=heights)) for heights in HEIGHTS), strict=True)
    assert len(set(starts)) == 2
    assert len(set(trainings)) == len(set(judgements)) == 1


def test_a_trial_carries_the_heights_of_its_obstacles() -> None:
    heights = [
        np.asarray(_program(Obstacles(heights=h)).start(SEED, NOT_IDLE).numbers["geom_pos"])[:, 2] + 0.5
        for h in HEIGHTS
    ]
    np.testing.assert_allclose(heights[0], np.repeat([0.1, 0.2, 0.3], 5), atol=1e-6)
    np.testing.assert_allclose(heights[1], [0.3] * 15, atol=1e-6)


def test_walls_taken_as_data_are_those_of_the_task() -> None:
    """The same episode, whether walls are embedded or carried by the trial; another one where they are elsewhere."""
    task = SteppingStones(episode_steps=40, examined_episodes=2)
    program = _program(task)
    trial: TrialState = program.start(SEED, NOT_IDLE)
    policy, key = METHOD.best(task, trial.method), trial_key(SEED, "evaluation")
    level = jnp.zeros((), jnp.int32)

    carried = jax.jit(lambda numbers: task.with_numbers(numbers).examine(policy, key, level).fitness)
    embedded = jax.jit(lambda: task.examine(policy, key, level).fitness)()
    np.testing.assert_allclose(carried(trial.numbers), embedded, rtol=1e-5)
    # All walls where the robot stands.
    moved = {**trial.numbers, "geom_pos": jnp.zeros((9, 3)).at[:, :2].set(jnp.asarray(task.start))}
    assert abs(carried(moved) - embedded) > 0.1
    assert task.places is None
