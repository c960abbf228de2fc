"""Rays against MuJoCo's own, and readings worked out by hand."""

from __future__ import annotations

import copy
import math

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from evoclaims.envs.ecorobot import deceptive, stones
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robots import ANT, SIMPLE_ROB, Robot
from evoclaims.envs.ecorobot.scene import WORLD_GROUP, Scene, scene
from evoclaims.envs.ecorobot.sensors import ARENA, Rangefinders, distances

pytestmark = pytest.mark.newest

ANGLES = np.linspace(-180.0, 150.0, 12)
FREE = scene(SIMPLE_ROB)


def _pose(x: float = 0.0, y: float = 0.0, heading: float = 0.0, z: float = 0.2) -> Pose:
    cosine, sine = math.cos(heading), math.sin(heading)
    rotation = jnp.asarray([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]], jnp.float32)
    return Pose(place=jnp.asarray([x, y, z], jnp.float32), rotation=rotation)


def _tilted(count: int, tilt: float, height: tuple[float, float]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return random places in the maze and rotations that tilt any axis by up to `tilt`, rad."""
    random, poses = np.random.default_rng(0), []
    for _ in range(count):
        turn, tip, matrix = np.zeros(4), np.zeros(4), np.zeros(9)
        mujoco.mju_axisAngle2Quat(turn, np.array([0.0, 0.0, 1.0]), random.uniform(-np.pi, np.pi))
        way = random.uniform(-np.pi, np.pi)
        mujoco.mju_axisAngle2Quat(tip, np.array([np.cos(way), np.sin(way), 0.0]), random.uniform(-tilt, tilt))
        both = np.zeros(4)
        mujoco.mju_mulQuat(both, tip, turn)
        mujoco.mju_quat2Mat(matrix, both)
        place = np.array([random.uniform(-3.8, 3.8), random.uniform(0.2, 6.8), random.uniform(*height)])
        poses.append((place, matrix.reshape(3, 3)))
    return poses


def _in_a_box(world: Scene, point: np.ndarray) -> bool:
    return any(np.all(np.abs((point - box.place) @ box.rotation) <= box.size) for box in world.boxes)


@pytest.mark.parametrize(
    ("robot", "walls", "tilt", "height"),
    [
        (SIMPLE_ROB, stones.WALLS, 0.0, (0.2, 0.2)),
        (SIMPLE_ROB, deceptive.EASY.walls, 0.0, (0.2, 0.2)),
        (ANT, stones.WALLS, 0.9, (0.3, 0.9)),
    ],
    ids=["stones' maze", "easy maze", "a tilted ant"],
)
def test_rays_are_as_long_as_mujocos(
    robot: Robot, walls: tuple[Box, ...], tilt: float, height: tuple[float, float]
) -> None:
    world, poses = scene(robot, walls), _tilted(60, tilt, height)
    model = copy.copy(world.whole)
    model.geom_group[model.geom("floor").id] = WORLD_GROUP
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    groups = np.zeros(6, np.uint8)
    groups[WORLD_GROUP] = 1
    expected, turned = np.full((60, 12), np.nan), np.radians(ANGLES)
    for i, (place, rotation) in enumerate(poses):
        for j, angle in enumerate(turned):
            way = rotation @ np.array([np.cos(angle), np.sin(angle), 0.0])
            origin = place + robot.torso_radius * way
            # From within a wall MuJoCo's ray would end where it leaves the wall; from below the floor, nowhere.
            if not _in_a_box(world, origin) and origin[2] > 0:
                hit = mujoco.mj_ray(model, data, origin, way, groups, True, -1, None)
                expected[i, j] = min(hit, ARENA) if hit >= 0 else ARENA
    pose = Pose(*(jnp.asarray(np.stack(part), jnp.float32) for part in zip(*poses, strict=True)))
    ours = np.asarray(jax.jit(jax.vmap(lambda one: distances(world, one, ANGLES)))(pose))
    compared = ~np.isnan(expected)
    assert compared.mean() > 0.8
    assert np.mean(expected[compared] < ARENA) > 0.5
    np.testing.assert_allclose(np.minimum(ours, ARENA)[compared], expected[compared], atol=1e-4)


def test_a_ray_from_within_a_wall_or_from_below_the_floor_has_no_length() -> None:
    world = Scene(SIMPLE_ROB, (Box((1.0, 0.0), (0.5, 0.5)),))
    assert float(distances(world, _pose(x=0.8), np.zeros(1))[0]) == 0.0
    down = Pose(place=jnp.asarray([0.0, 0.0, 0.1]), rotation=jnp.asarray([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]))
    assert float(distances(FREE, down, np.zeros(1))[0]) == 0.0


def test_nothing_within_reach_reads_exactly_1() -> None:
    np.testing.assert_array_equal(Rangefinders(7).read(FREE, _pose()), np.ones(7))
    far = Scene(SIMPLE_ROB, (Box((20.0, 0.0), (0.5, 30.0)),))
    np.testing.assert_array_equal(Rangefinders(5).read(far, _pose()), np.ones(5))


def test_rangefinders_go_from_right_to_left_and_reach_normalizes() -> None:
    right, left = Box((0.0, -3.0), (1.0, 0.5)), Box((0.0, 4.0), (1.0, 0.5))
    world = Scene(SIMPLE_ROB, (right, left))
    # From the surface, 0.2 m out: 2.3 m to the right, 3.3 m to the left, of 4.6 m.
    np.testing.assert_allclose(Rangefinders(3, reach=4.6).read(world, _pose()), [0.5, 1.0, 3.3 / 4.6], atol=1e-6)
    # With its back to the right-hand box, only the left-hand one is ahead.
    ahead = Rangefinders(3, reach=4.6).read(world, _pose(heading=math.pi / 2))
    np.testing.assert_allclose(ahead, [1.0, 3.3 / 4.6, 1.0], atol=1e-6)
    np.testing.assert_allclose(Rangefinders(1, reach=4.6).read(world, _pose(heading=-math.pi / 2)), [0.5], atol=1e-6)
