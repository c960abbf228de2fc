"""What locomotion pays, with obstacles and without, worked out by hand; its numbers against Brax's own."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import pytest

from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.ecorobot.locomotion import FurthestRun, Locomotion, Obstacles
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robots import ANT, HOPPER, HUMANOID, ROBOTS, WALKER2D, Robot
from evoclaims.envs.foreign.brax_task import BraxTask

pytestmark = pytest.mark.newest

BRAX = ("ant", "half_cheetah", "hopper", "humanoid", "walker2d")


def _pose(x: float, z: float = 1.2, pitch: float = 0.0) -> Pose:
    """Return a torso whose x axis dips by `pitch`."""
    cosine, sine = math.cos(pitch), math.sin(pitch)
    rotation = jnp.asarray([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]], jnp.float32)
    return Pose(place=jnp.asarray([x, 0.0, z], jnp.float32), rotation=rotation)


@cache
def _brax(name: str) -> Any:
    """Return Brax's environment of a robot."""
    with implicit_promotions():
        return BraxTask(name.replace("_", ""), {"backend": "mjx"}).make()


@pytest.mark.filterwarnings("ignore:Brax System:UserWarning", "ignore:compiler attribute 'settotalmass':UserWarning")
@pytest.mark.parametrize("name", BRAX)
def test_a_robots_numbers_are_those_of_braxs_environment(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its warnings to
    robot, theirs = ROBOTS[name], vars(_brax(name))
    assert Locomotion(robot=robot).scene.seconds == pytest.approx(float(_brax(name).dt))
    assert robot.control_cost == theirs["_ctrl_cost_weight"]
    assert robot.forward_reward == theirs.get("_forward_reward_weight", 1.0)
    assert robot.healthy_reward == theirs.get("_healthy_reward", 0.0)
    assert robot.healthy_height == tuple(theirs.get("_healthy_z_range", (-math.inf, math.inf)))
    assert (-robot.healthy_pitch, robot.healthy_pitch) == theirs.get("_healthy_angle_range", (-math.inf, math.inf))
    assert robot.position_noise == robot.velocity_noise == theirs["_reset_noise_scale"]


@pytest.mark.parametrize("task", [Locomotion(), Obstacles()], ids=["free ground", "obstacles"])
def test_the_half_cheetah_earns_its_velocity_less_the_control_cost(task: Any) -> None:
    action = jnp.asarray([1.0, -0.5, 0.0, 0.5, 0.0, 0.0])
    ruling = task.rule(task.memory(_pose(0.0)), _pose(2.0), _pose(2.15, z=-5.0, pitch=3.0), action)
    # 0.15 m in 0.05 s, and 0.1 · (1 + 0.25 + 0.25); there is no health to lose.
    assert float(ruling.reward) == pytest.approx(3.0 - 0.15, abs=1e-4)
    assert not ruling.ended


@pytest.mark.parametrize(
    ("robot", "seconds", "motors"), [(ANT, 0.05, 8), (HOPPER, 0.008, 3), (WALKER2D, 0.008, 6), (HUMANOID, 0.015, 17)]
)
def test_the_others_earn_health_too(robot: Robot, seconds: float, motors: int) -> None:
    task = Locomotion(robot=robot)
    height = 0.5 if robot == ANT else 1.2
    ruling = task.rule((), _pose(1.0, height), _pose(1.03, height), jnp.full(motors, 0.5))
    expected = robot.forward_reward * 0.03 / seconds + robot.healthy_reward - robot.control_cost * motors * 0.25
    assert float(ruling.reward) == pytest.approx(expected, rel=1e-4)
    assert not ruling.ended
    assert task.action_size == motors


@pytest.mark.parametrize(
    ("robot", "height", "pitch", "ends"),
    [
        (ANT, 0.19, 0.0, True),
        (ANT, 0.21, 2.0, False),
        (ANT, 1.01, 0.0, True),
        (HOPPER, 0.69, 0.0, True),
        (HOPPER, 9.0, 0.19, False),
        (HOPPER, 1.2, -0.21, True),
        (WALKER2D, 0.79, 0.0, True),
        (WALKER2D, 1.9, -0.99, False),
        (WALKER2D, 2.01, 0.0, True),
        (WALKER2D, 1.2, 1.01, True),
        (HUMANOID, 0.99, 0.0, True),
        (HUMANOID, 1.9, 0.5, False),
        (HUMANOID, 2.01, 0.0, True),
    ],
)
def test_an_unhealthy_torso_ends_the_episode(robot: Robot, height: float, pitch: float, ends: bool) -> None:
    task = Locomotion(robot=robot)
    ruling = task.rule((), _pose(0.0), _pose(0.0, height, pitch), jnp.zeros(task.action_size))
    assert bool(ruling.ended) is ends


@pytest.mark.parametrize(
    ("furthest", "count"),
    [(0.0, 0), (9.19, 0), (9.21, 1), (17.19, 4), (17.21, 5), (31.21, 10), (43.0, 10), (51.19, 14), (51.21, 15)],
)
def test_an_obstacle_counts_once_the_torso_has_been_beyond_its_far_side(furthest: float, count: int) -> None:
    task = Obstacles()
    start = task.reset(jax.random.key(0), jnp.zeros((), jnp.int32)).inner
    measures = task.measures(replace(start, memory=FurthestRun(furthest=jnp.asarray(furthest, jnp.float32))))
    assert float(measures["obstacles"]) == count
    assert float(measures["furthest"]) == pytest.approx(furthest)


def test_the_furthest_place_is_kept_when_the_robot_turns_back() -> None:
    task = Obstacles()
    memory = task.memory(_pose(0.05))
    for before, after, furthest in ((0.05, 9.5, 9.5), (9.5, 8.0, 9.5), (8.0, 11.3, 11.3)):
        memory = task.rule(memory, _pose(before), _pose(after), jnp.zeros(6)).memory
        assert float(memory.furthest) == pytest.approx(furthest)


@pytest.mark.parametrize(
    ("heights", "tops"),
    [("hierarchical", [0.1] * 5 + [0.2] * 5 + [0.3] * 5), ("medium", [0.2] * 15), ("high", [0.3] * 15)],
)
def test_obstacles_stand_where_the_paper_puts_them_as_high_as_it_says(heights: Any, tops: list[float]) -> None:
    model = Obstacles(heights=heights).scene.whole
    ours = model.geom_group == 1
    place, size = model.geom_pos[ours], model.geom_size[ours]
    assert place[:, 0].tolist() == [9, 11, 13, 15, 17, 23, 25, 27, 29, 31, 43, 45, 47, 49, 51]
    assert (place[:, 2] + size[:, 2]).tolist() == pytest.approx(tops)
    assert (place[:, 2] - size[:, 2] < 0).all()
    assert (size[:, :2] == [0.2, 3.0]).all()
