"""Stepping stones with other details, against the protocol's and against rewards computed by hand."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs import ANT, SteppingStones
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.sensors import ARENA
from reproductions.nisioti2025.other_stones import BIG_STONES, MetreRanges, OtherStones, Walk

OURS, OTHER = SteppingStones(), OtherStones()
ACTION = jnp.zeros(4)


def _at(x: float, y: float) -> Pose:
    return Pose(place=jnp.array([x, y, 0.2]), rotation=jnp.eye(3))


def _walk(crossed: int, steps: int = 0) -> Walk:
    return Walk(crossed=jnp.int32(crossed), steps=jnp.int32(steps))


def test_with_the_values_of_the_protocol_a_walk_is_ruled_as_by_the_protocol() -> None:
    ours, other = OURS.memory(_at(0, 0)), OTHER.memory(_at(0, 0))
    places = np.random.default_rng(0).uniform((-4, 0), (4, 7), (40, 2)).tolist()
    for place in [spot for stone, far in zip(OURS.stones * 6, places, strict=False) for spot in (far, stone)][:14]:
        one, two = (
            task.rule(memory, _at(0, 0), _at(*place), ACTION) for task, memory in ((OURS, ours), (OTHER, other))
        )
        assert (float(one.reward), bool(one.ended)) == (float(two.reward), bool(two.ended))
        assert int(one.memory.crossed) == int(two.memory.crossed)
        ours, other = one.memory, two.memory
    assert int(ours.crossed) == 7


@pytest.mark.parametrize(
    ("toward", "rewards"),
    [("next", (0.78, 1.61, 2.87, 3.67, 4.84, 5.74, 6.91)), ("after_next", (0.45, 1.63, 2.58, 3.63, 4.78, 5.65, 6.91))],
)
def test_at_rest_at_a_stone_a_step_pays_the_stones_and_the_way(toward: str, rewards: tuple[float, ...]) -> None:
    task = replace(OTHER, toward=toward)
    for crossed, (place, reward) in enumerate(zip(((-3.0, 1.0), *task.stones), rewards, strict=False)):
        ruling = task.rule(_walk(crossed), _at(*place), _at(*place), ACTION)
        assert float(ruling.reward) == pytest.approx(reward, abs=0.006)


def test_stones_pay_once_in_the_last_step_but_one_and_the_last_stone_as_before() -> None:
    task = replace(OTHER, pays="once", episode_steps=10)
    paid = [float(task.rule(_walk(2, steps), _at(0, 0), _at(3.2, 1.0), ACTION).reward) for steps in range(10)]
    assert [reward > 0 for reward in paid] == [steps == 8 for steps in range(10)]
    assert paid[8] == float(replace(task, pays="each").rule(_walk(2), _at(0, 0), _at(3.2, 1.0), ACTION).reward)
    through = task.rule(_walk(6), _at(0, 0), _at(*task.target), ACTION)
    assert (float(through.reward), bool(through.ended)) == (1000.0, True)


@pytest.mark.parametrize("crossed", [0, 6])
def test_near_the_target_an_episode_ends_without_a_bonus(crossed: int) -> None:
    task = replace(OTHER, ends="near_target")
    x, y = task.target
    near, far = (task.rule(_walk(crossed), _at(0, 0), _at(x + away, y), ACTION) for away in (1.09, 1.11))
    assert (bool(near.ended), bool(far.ended)) == (True, False)
    assert float(near.reward) < 8


def test_wider_walls_leave_the_stones_the_clearance_that_the_authors_maze_has() -> None:
    for stone, thin, thick in ((3, 0.52, 0.32), (2, 0.51, 0.39)):
        for task, clear in ((OTHER, thin), (replace(OTHER, walls=0.3), thick)):
            free = min(float(box.distance(np.array(task.stones[stone]))) for box in task.boxes)
            assert free == pytest.approx(clear, abs=0.006)
            assert task.reachable().any()


def test_ranges_in_metres_are_the_protocols_times_its_diagonal() -> None:
    start = jax.jit(OTHER.reset)(jax.random.key(0), jnp.int32(0)).inner.pose
    plain, metres = (sensor.read(OTHER.scene, start) for sensor in (OTHER.sensor, MetreRanges()))
    assert np.allclose(np.asarray(plain) * ARENA, metres, rtol=1e-5)
    empty = replace(OTHER.scene, boxes=())
    assert np.array_equal(MetreRanges().read(empty, start), np.ones(5))


def test_the_ant_in_the_larger_maze_sees_ten_numbers() -> None:
    ant = OtherStones(robot=replace(ANT, seen_velocities=2), world="big", seen_positions=3)
    assert ant.observation_size == 10
    assert ant.stones == BIG_STONES
    assert all(min(float(box.distance(np.array(stone))) for box in ant.boxes) > 0.1 for stone in ant.stones)


@pytest.mark.parametrize("wrong", [{"pays": "twice"}, {"toward": "last"}, {"ends": "never"}, {"world": "huge"}])
def test_unknown_details_are_refused(wrong: dict[str, str]) -> None:
    with pytest.raises(UserError, match="Known"):
        OtherStones(**wrong)  # type: ignore[arg-type]
