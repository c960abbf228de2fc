"""How many boxes a robot can touch at a time: never too few, wherever it is and however it stretches."""

from __future__ import annotations

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from custom_robots import BASE, Texts
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from evoclaims.envs.ecorobot import deceptive, physics, stones
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.locomotion import Obstacles
from evoclaims.envs.ecorobot.pose import torso
from evoclaims.envs.ecorobot.robots import ANT, HALF_CHEETAH, ROBOTS, SIMPLE_ROB, Robot
from evoclaims.envs.ecorobot.scene import Scene, box_geoms, on_device, reach, touched_at_once

ALONE = Scene(SIMPLE_ROB).model


def test_a_box_is_as_far_as_its_nearest_side_or_corner() -> None:
    points = np.array([(2.0, 3.0), (5.0, 3.0), (2.0, 0.0), (6.0, 8.0), (2.9, 4.9)])
    np.testing.assert_allclose(Box((2.0, 3.0), (1.0, 2.0)).distance(points), [0.0, 2.0, 1.0, math.hypot(3.0, 3.0), 0.0])
    across = Box((2.0, 3.0), (2.0, 1.0), angle=90.0)
    np.testing.assert_allclose(across.distance(points), [0.0, 2.0, 1.0, math.hypot(3.0, 3.0), 0.0], atol=1e-12)
    assert sorted(map(tuple, across.corners.round(12).tolist())) == [(1.0, 1.0), (1.0, 5.0), (3.0, 1.0), (3.0, 5.0)]


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=lambda robot: robot.name)
def test_no_posture_reaches_further_than_the_bound(robot: Robot) -> None:
    model, random = Scene(robot).model, np.random.default_rng(0)
    data, bound = mujoco.MjData(model), reach(model)
    touching = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_contype & 1 > 0))
    furthest = 0.0
    for _ in range(2_000):
        data.qpos[:] = random.uniform(-math.pi, math.pi, model.nq)
        mujoco.mj_kinematics(model, data)
        apart = np.linalg.norm(data.geom_xpos[touching] - data.xpos[1], axis=1) + model.geom_rbound[touching]
        furthest = max(furthest, float(apart.max()))
    assert furthest <= bound + 1e-9
    assert furthest > 0.75 * bound  # which is not idle


def test_the_paper_s_worlds_need_few_of_their_boxes() -> None:
    near = {
        (robot.name, kind): touched_at_once(Scene(robot).model, boxes)
        for robot in (SIMPLE_ROB, ANT)
        for kind, boxes in (("stones", stones.WALLS), ("easy", deceptive.EASY.walls))
    }
    assert near == {("simple_rob", "stones"): 3, ("simple_rob", "easy"): 2, ("ant", "stones"): 4, ("ant", "easy"): 2}
    assert Obstacles().scene.near == 2


coordinates = st.floats(-5.0, 5.0)
worlds = st.lists(
    st.builds(
        Box,
        st.tuples(coordinates, coordinates),
        st.tuples(st.floats(0.05, 3.0), st.floats(0.05, 3.0)),
        angle=st.floats(-180.0, 180.0),
    ),
    min_size=1,
    max_size=6,
)


@given(worlds, st.integers(0, 2**32 - 1))
def test_nowhere_are_more_boxes_within_reach_than_are_simulated(boxes: list[Box], seed: int) -> None:
    random = np.random.default_rng(seed)
    # Points everywhere, and points just within reach of a corner, where boxes meet.
    corners = np.concatenate([box.corners for box in boxes])
    points = np.concatenate(
        [random.uniform(-9, 9, (500, 2)), corners + 0.19 * random.uniform(-0.7, 0.7, corners.shape)]
    )
    touched = np.sum([box.distance(points) <= reach(ALONE) for box in boxes], axis=0)
    assert np.max(touched) <= touched_at_once(ALONE, boxes) <= len(boxes)


def test_what_touches_before_it_meets_reaches_as_far() -> None:
    torso = '<body pos="0 0 1"><freejoint/><geom size="0.1"/><body pos="0.4 0 0"><joint/><geom size="0.1" {}/></body>'
    plain, wide = (
        mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{torso.format(margin)}</body></worldbody></mujoco>")
        for margin in ("", 'margin="0.6"')
    )
    assert reach(wide) == pytest.approx(reach(plain) + 0.6)


@pytest.mark.parametrize("default", ["", '<default><geom margin="0.3" gap="0.1"/></default>'])
def test_a_task_s_boxes_take_nothing_from_a_robot_s_file(default: str, texts: Texts) -> None:
    text = BASE.replace("<option", f"{default}<option").replace('type="capsule"', 'type="capsule" contype="0"')
    model = Scene(
        texts.robot(text.replace('size="0.05"', 'size="0.05" conaffinity="0"')), (Box((2.0, 0.0), (0.1, 0.1)),)
    ).whole
    assert model.geom_margin[box_geoms(model)].tolist() == model.geom_gap[box_geoms(model)].tolist() == [0.0]


@pytest.mark.parametrize(
    "more",
    [
        '<body><joint type="slide" axis="1 0 0"/><geom size="0.1"/></body></body>',
        '</body><body pos="1 0 1"><freejoint/><geom size="0.1"/></body>',
    ],
    ids=["a limb on a slide", "a body apart"],
)
def test_what_has_no_bound_may_touch_all(more: str) -> None:
    torso = '<body pos="0 0 1"><freejoint/><geom size="0.1"/>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{torso}{more}</worldbody></mujoco>")
    assert reach(model) == math.inf
    assert touched_at_once(model, stones.WALLS) == len(stones.WALLS)


@pytest.mark.parametrize("robot", [SIMPLE_ROB, ANT])
def test_all_boxes_are_simulated_where_all_can_be_touched(robot: Robot) -> None:
    corner = (Box((0.0, 0.0), (1.0, 0.1)), Box((0.0, 0.0), (1.0, 0.1), angle=90.0))
    assert Scene(robot, corner).near == 2
    assert Scene(robot, corner).model.ngeom == Scene(robot, corner).whole.ngeom
    assert Scene(robot).turns == {}


def test_all_boxes_are_simulated_for_a_single_sphere() -> None:
    far = tuple(Box((4.0 * i, 0.0), (0.1, 0.1)) for i in range(3))
    assert (Scene(SIMPLE_ROB, far).near, Scene(ANT, far).near) == (3, 1)


def test_boxes_that_are_alike_differ_in_their_place_alone() -> None:
    apart = [Box((3.0 * i, 0.0), (0.2, 3.0)) for i in range(4)]
    assert list(Scene(HALF_CHEETAH, tuple(apart)).turns) == ["geom_pos"]
    apart[3] = replace(apart[3], angle=20.0)
    assert set(Scene(HALF_CHEETAH, tuple(apart)).turns) == {"geom_pos", "geom_quat"}


def test_the_boxes_that_are_simulated_are_those_nearest_to_the_torso() -> None:
    """Among the walls of the stones' maze, five of which are turned; distances by `Box`."""
    task = stones.SteppingStones(robot=ANT)
    scene, random = task.scene, np.random.default_rng(1)
    places = np.concatenate([random.uniform(low, high, (400, 1)) for low, high in task.area], axis=1)
    starts = np.tile(scene.start, (400, 1))
    starts[:, :2] += places - np.asarray(jax.vmap(lambda q: torso(scene, q).place[:2])(jnp.asarray(starts)))

    def nearest(position: Array) -> Array:
        body = physics.resting(position, jnp.zeros(scene.model.nv))
        return physics._nearest(scene, on_device(scene.mjx), body, scene.turns)

    found = np.asarray(jax.jit(jax.vmap(nearest))(jnp.asarray(starts)))
    distances = np.stack([box.distance(places) for box in task.boxes], axis=1)
    chosen = np.take_along_axis(distances, found, axis=1)
    np.testing.assert_allclose(chosen, np.sort(distances, axis=1)[:, : scene.near], atol=1e-4)
