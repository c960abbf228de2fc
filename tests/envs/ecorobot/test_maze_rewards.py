"""What the mazes pay, worked out by hand for torsos put here and there."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.envs.ecorobot.deceptive import DIFFICULT, EASY, DeceptiveMaze
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robot_task import Ruling
from evoclaims.envs.ecorobot.stones import STONES, SteppingStones, StonesCrossed

TASK = SteppingStones()
NO_ACTION = jnp.zeros(4)


def _at(x: float, y: float) -> Pose:
    return Pose(place=jnp.asarray([x, y, 0.2], jnp.float32), rotation=jnp.eye(3))


def _crossed(count: int) -> StonesCrossed:
    return StonesCrossed(crossed=jnp.asarray(count, jnp.int32))


def _stones_rule(count: int, x: float, y: float, task: SteppingStones = TASK) -> Ruling:
    """Judge a step to (x, y) after which `count` stones had been crossed before."""
    return task.rule(_crossed(count), _at(*TASK.start), _at(x, y), NO_ACTION)


@pytest.mark.parametrize("count", range(7))
def test_only_the_next_stone_counts(count: int) -> None:
    for index, stone in enumerate(STONES):
        assert int(_stones_rule(count, *stone).memory.crossed) == count + (index == count)


def test_a_stone_is_crossed_within_a_tenth_of_a_metre() -> None:
    x, y = STONES[0]
    assert int(_stones_rule(0, x + 0.0999, y).memory.crossed) == 1
    assert int(_stones_rule(0, x, y - 0.1001).memory.crossed) == 0
    assert int(_stones_rule(0, x, y - 0.1001, SteppingStones(within=0.2)).memory.crossed) == 1


def test_a_step_pays_the_stones_so_far_and_nearness_to_the_next() -> None:
    # From (0, 0.5): (3.2, 2.5), the third, is √(3.2² + 2²) away; the arena's diagonal is 8√2.
    ruling = _stones_rule(2, 0.0, 0.5)
    assert float(ruling.reward) == pytest.approx(2 + 1 - math.hypot(3.2, 2.0) / (8 * math.sqrt(2)))
    assert not ruling.ended


def test_the_target_pays_a_thousand_once_all_other_stones_are_crossed() -> None:
    x, y = STONES[-1]
    last = _stones_rule(6, x, y)
    assert (float(last.reward), bool(last.ended)) == (7.0 + 1.0 + 1000.0, True)
    for count in range(6):
        early = _stones_rule(count, x, y)
        assert not early.ended
        assert float(early.reward) < 8.0


def test_going_from_stone_to_stone_adds_up() -> None:
    memory, total = TASK.memory(_at(*TASK.start)), 0.0
    for stone in STONES:
        ruling = TASK.rule(memory, _at(0.0, 0.0), _at(*stone), NO_ACTION)
        memory, total = ruling.memory, total + float(ruling.reward)
    gaps = sum(math.dist(one, other) for one, other in pairwise(STONES)) / (8 * math.sqrt(2))
    assert total == pytest.approx(sum(range(1, 8)) + 7 - gaps + 1000)


def test_the_goal_shown_is_the_next_stone() -> None:
    task = SteppingStones(shows_goal=True)
    start = task.reset(jax.random.key(0), jnp.zeros((), jnp.int32))
    np.testing.assert_allclose(start.observation[-2:], STONES[0])
    for count, stone in enumerate((*STONES, STONES[-1])):
        shown = task.shown(replace(start.inner, memory=_crossed(count)))
        np.testing.assert_allclose(shown, stone)
    assert start.observation.shape == (3 + 2 + 5 + 2,)
    assert TASK.observation_size == 3 + 2 + 5


def _maze_run(task: DeceptiveMaze, way: list[tuple[float, float]]) -> tuple[list[float], Any]:
    """Return the rewards of going from place to place, and the last ruling."""
    memory, here, rewards, ruling = task.memory(_at(*task.start)), _at(*task.start), [], None
    for place in way:
        ruling = task.rule(memory, here, _at(*place), NO_ACTION)
        memory, here = ruling.memory, _at(*place)
        rewards.append(float(ruling.reward))
    return rewards, ruling


@given(way=st.lists(st.tuples(st.floats(-5.5, 5.5), st.floats(0.5, 7.0)), max_size=6), angle=st.floats(0.0, 6.28))
@settings(max_examples=15, deadline=None)
@pytest.mark.parametrize("difficulty", ["easy", "difficult"])
def test_rewards_on_any_way_to_the_target_sum_to_1(difficulty: Any, way: Any, angle: float) -> None:
    task = DeceptiveMaze(difficulty=difficulty)
    inside = 0.5 * task.plan.within
    end = (task.target[0] + inside * math.cos(angle), task.target[1] + inside * math.sin(angle))
    way = [place for place in way if math.dist(place, task.target) > task.plan.within + 0.01]
    rewards, last = _maze_run(task, [*way, end])
    assert last.ended
    assert last.memory.done
    assert sum(rewards) == pytest.approx(1.0, abs=1e-5)


def test_a_step_away_from_the_target_costs_what_the_step_back_pays() -> None:
    # From (-3, 1) the target's circle is √(1 + 64) - 1.1 away, from (-3, 0.5) √(1 + 72.25) - 1.1.
    task = DeceptiveMaze()
    back = (math.sqrt(73.25) - math.sqrt(65.0)) / (math.sqrt(65.0) - 1.1)
    rewards, last = _maze_run(task, [(-3.0, 0.5), (-3.0, 1.0)])
    assert rewards == pytest.approx([-back, back], abs=1e-6)
    assert not last.ended


def test_the_easy_maze_ends_within_1_1_m_of_its_target_and_the_difficult_one_within_0_1_m() -> None:
    for plan, difficulty, target, within in (
        (EASY, "easy", (-4.0, 9.0), 1.1),
        (DIFFICULT, "difficult", (-3.0, 6.0), 0.1),
    ):
        task = DeceptiveMaze(difficulty=difficulty)  # type: ignore[arg-type]
        assert plan.target == target
        assert _maze_run(task, [(target[0], target[1] - within + 1e-4)])[1].ended
        assert not _maze_run(task, [(target[0], target[1] - within - 1e-4)])[1].ended


def test_the_difficult_maze_has_the_walls_start_and_target_of_the_stones() -> None:
    difficult = DeceptiveMaze(difficulty="difficult")
    assert (difficult.boxes, difficult.start, difficult.target) == (TASK.boxes, TASK.start, TASK.target)
