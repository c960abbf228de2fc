"""Custom robots that cannot be simulated as they are written: a sentence when they, or their tasks, are made."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from custom_robots import BASE, Texts

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.locomotion import Locomotion, Obstacles
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robots import ANT, IN_A_MAZE, ROBOTS, Robot
from evoclaims.envs.ecorobot.scene import Scene, box_geoms
from evoclaims.envs.ecorobot.sensors import distances
from evoclaims.envs.ecorobot.stones import SteppingStones

SLED = """
<mujoco>
  <option timestep="0.01"/>
  <worldbody>
    <geom type="plane" size="9 9 1"/>
    <body name="sled" pos="0 0 0.3">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
      <geom name="hull" type="sphere" size="0.2"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="x" gear="10"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize(
    "numbers",
    [
        *({"frames": wrong} for wrong in (0, -1, 2.5, True, "5", None)),
        *({"contacts": wrong} for wrong in (0, -3, 1.5)),
        *({"touching": wrong} for wrong in (-1, 0.5)),
        *({"free_coordinates": wrong} for wrong in (-1, 3, 1.0)),
        *({"seen_velocities": wrong} for wrong in (-1, 3, 1.0)),
        *({"torso_radius": wrong} for wrong in (-0.1, math.nan, math.inf, "wide", None)),
        *({"position_noise": wrong} for wrong in (-0.1, math.nan, math.inf)),
        *({"velocity_noise": wrong} for wrong in (-0.1, math.nan, math.inf)),
        *({"forward_reward": wrong} for wrong in (math.nan, math.inf, None)),
        *({"control_cost": wrong} for wrong in (math.nan, -math.inf)),
        {"healthy_reward": math.nan},
        *({"healthy_height": wrong} for wrong in ((1.0, 0.2), (0.5, 0.5), (math.nan, 1.0), (0.2,), 0.2, [0.2, 1.0])),
        *({"healthy_pitch": wrong} for wrong in (0.0, -1.0, math.nan)),
        *({"velocity_limit": wrong} for wrong in (0.0, -1.0, math.nan)),
        *(
            {"start": wrong}
            for wrong in ((0.0,), (0.0, math.nan), (0.0, math.inf), (0.0, 0.0, 0.0), (), [0.0, 0.0], "00")
        ),
        {"normal_velocity": "no"},
        {"scales_actions": True},
        {"scales_actions": 1},
    ],
    ids=str,
)
def test_numbers_that_do_not_fit_are_refused(numbers: dict[str, Any], texts: Texts) -> None:
    texts.robot(SLED)
    with pytest.raises(UserError, match=r"The robot rover (has|starts)") as error:
        texts.robot(SLED, **numbers)
    assert "Write" in str(error.value)


@pytest.mark.parametrize("name", ["", None, 3])
def test_a_robot_has_a_name(name: Any) -> None:
    with pytest.raises(UserError, match="A robot has name=.* Write text that is not empty"):
        Robot(name, "x:y.xml")


def test_a_start_without_an_orientation_is_refused(texts: Texts) -> None:
    with pytest.raises(UserError, match="the orientation 0 0 0 0"):
        texts.robot(BASE, start=(0.0,) * 8)


def test_a_built_in_robot_s_start_is_checked_with_its_task() -> None:
    with pytest.raises(UserError, match="The robot ant has a start of 2 positions, but its model has 15"):
        Locomotion(robot=Robot("ant", ANT.xml, start=(0.0, 0.0)))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("<mujoco>", "<mujoco"), "cannot be read: .*"),
        (('type="slide"', 'type="sleigh"'), "cannot be read: .*sleigh"),
        (('joint="x"', 'joint="z"'), "cannot be compiled: .*"),
        (('axis="1 0 0"', 'axis="1 0 0" limited="true" range="2 1"'), "cannot be compiled: .*"),
        (('gear="10"', 'gear="10" ctrllimited="true" ctrlrange="1 -1"'), "cannot be compiled: .*"),
        (('axis="1 0 0"', 'axis="1 0 0" range="2 1"'), r"a reversed range in jnt_range \(2 1\)"),
        (('gear="10"', 'gear="10" ctrlrange="1 -1"'), r"a reversed range in actuator_ctrlrange \(1 -1\)"),
        (('gear="10"', 'gear="10" forcerange="1 -1"'), r"a reversed range in actuator_forcerange \(1 -1\)"),
        (('timestep="0.01"', 'timestep="0"'), "has timestep=0, so its time"),
        (('timestep="0.01"', 'timestep="-0.01"'), "has timestep=-0.01, so its time"),
        (('timestep="0.01"', 'timestep="inf"'), "has timestep=inf, which is not finite"),
        (('timestep="0.01"', 'timestep="0.01" wind="0 inf 0"'), "has wind=.*inf.*, which is not finite"),
        (("<worldbody>", '<include file="no.xml"/><worldbody>'), "cannot be read: .*no.xml"),
        (('type="sphere" size="0.2"', 'type="mesh" mesh="m"'), "cannot be compiled: .*"),
        (
            ("<body", '<body pos="0 0 3"><geom size="0.1"/></body><body'),
            r"no torso: its first body \(without a name\) has no",
        ),
        (
            ("<body", '<body name="lamp"><geom size="0.1"/></body><body'),
            r"has no torso: its first body \(lamp\) has no joint",
        ),
        (
            ("<body", '<body mocap="true"><geom size="0.1"/></body><body'),
            "has motion-capture bodies, which is not simulated",
        ),
        (("<option", '<option integrator="implicit"'), "another integrator than Euler or RK4, which is not"),
        (("<option", '<option cone="elliptic"'), "elliptic friction cones, which is not"),
        (("<option", '<option solver="CG"'), "has another solver than Newton's, which is not"),
        (("<option", '<option noslip_iterations="3"'), "has noslip_iterations=3, which is not"),
        (
            ('timestep="0.01"/>', 'timestep="0.01"><flag spring="disable"/></option>'),
            "has the flag spring=disable, which",
        ),
        (
            ('timestep="0.01"/>', 'timestep="0.01"><flag override="enable"/></option>'),
            "has the flag override=enable, which",
        ),
        (('type="sphere" size', 'type="sphere" fluidshape="ellipsoid" size'), "ellipsoids in a fluid"),
        (("motor name", 'general dyntype="filter" name'), "actuators with a state, which"),
        (("</mujoco>", '<equality><joint joint1="x" joint2="y"/></equality></mujoco>'), "equality constraints, which"),
        (("</mujoco>", '<tendon><fixed><joint joint="x" coef="1"/></fixed></tendon></mujoco>'), "tendons, which"),
        (('axis="0 1 0"', 'axis="0 1 0" frictionloss="0.1"'), "friction loss in joints, which"),
        (('gear="10"', 'gear="10" delay="0.1" nsample="20"'), "has actuators with a delay, which"),
        (('name="y" type="slide"', 'name="y" type="slide" damping="0.1 0.5"'), "has damping that is not linear, which"),
        (
            ('name="y" type="slide"', 'name="y" type="slide" stiffness="0.1 0.5"'),
            "has springs that are not linear, which",
        ),
    ],
    ids=lambda part: part[1] if isinstance(part, tuple) else "",
)
def test_a_model_that_cannot_be_simulated_is_refused(change: tuple[str, str], sentence: str, texts: Texts) -> None:
    with pytest.raises(UserError, match=f"The model of the robot rover .*{sentence}") as error:
        texts.robot(SLED.replace(change[0], change[1], 1))
    assert "\n" not in str(error.value)


def test_a_model_without_a_body_is_refused(texts: Texts) -> None:
    with pytest.raises(UserError, match="has no torso: it has no body"):
        texts.robot('<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>')


def test_a_floor_that_would_count_as_a_box_is_refused(texts: Texts) -> None:
    robot = texts.robot(SLED.replace('size="9 9 1"', 'size="9 9 1" group="1"'))
    with pytest.raises(UserError, match="has a geom of the world in group 1, which is the group of a task's boxes"):
        _ = Scene(robot).model


@pytest.mark.parametrize("kind", ["capsule", "cylinder", "ellipsoid", "box"])
def test_geoms_whose_contacts_with_boxes_differ_are_refused_with_their_task(kind: str, texts: Texts) -> None:
    robot = texts.robot(SLED.replace('type="sphere" size="0.2"', f'type="{kind}" size="0.2 0.1 0.1"'))
    Locomotion(robot=robot)
    with pytest.raises(
        UserError, match=rf"The robot rover has a {kind} \(.*\) and a box \(.*\) that can touch\. For this pair MJX"
    ):
        Obstacles(robot=robot)


@pytest.mark.parametrize("bits", [(1, 1), (2, 2), (2, 0), (0, 4), (0, 1), (1, 0)], ids=str)
def test_boxes_collide_with_whatever_collides(bits: tuple[int, int], texts: Texts) -> None:
    text = SLED.replace('name="hull"', f'name="hull" contype="{bits[0]}" conaffinity="{bits[1]}"')
    model = Scene(texts.robot(text), (Box((3.0, 0.0), (0.1, 2.0)),)).model
    hull, box = model.geom("hull").id, box_geoms(model)[0]
    both = (model.geom_contype[hull] & model.geom_conaffinity[box]) | (
        model.geom_contype[box] & model.geom_conaffinity[hull]
    )
    assert both


def test_a_geom_that_touches_nothing_may_have_any_type(texts: Texts) -> None:
    text = PLANAR.replace('type="sphere" size="0.2"', 'type="cylinder" size="0.2 0.1" contype="0" conaffinity="0"')
    assert Obstacles(robot=texts.robot(text)).action_size == 1


def test_a_task_needs_motors_a_robot_and_a_sensor(texts: Texts) -> None:
    still = texts.robot(SLED.replace('<motor name="push" joint="x" gear="10"/>', ""))
    with pytest.raises(UserError, match="The model of the robot rover has no actuators"):
        Locomotion(robot=still)
    wrong: Any = "rover"
    with pytest.raises(UserError, match="locomotion has robot=.* Write a Robot"):
        Locomotion(robot=wrong)
    with pytest.raises(UserError, match="locomotion has sensor="):
        Locomotion(sensor=wrong)


@pytest.mark.parametrize(
    ("change", "there"),
    [
        (("", ""), True),
        (('pos="0 0 0.3"', 'pos="0.5 0 0.3"'), False),
        (('axis="0 1 0"', 'axis="0 0 1"'), False),
        (('axis="1 0 0"', 'axis="-1 0 0"'), False),
    ],
    ids=["x and y", "beside the origin", "x and z", "backwards"],
)
def test_a_maze_starts_its_robot_where_it_says(change: tuple[str, str], there: bool, texts: Texts) -> None:
    robot = texts.robot(SLED.replace(*change, 1))
    if there:
        SteppingStones(robot=robot)
    else:
        with pytest.raises(
            UserError,
            match=r"stepping_stones starts its robots at x -3 and y 1, but with these as the first two positions",
        ):
            SteppingStones(robot=robot)


@pytest.mark.parametrize(
    ("floor", "found"),
    [
        ('<geom type="plane" size="9 9 1" pos="0 0 -1"/>', "a floor that is not level at z = 0"),
        ('<geom type="plane" size="9 9 1" euler="10 0 0"/>', "a floor that is not level at z = 0"),
        ("", "no floor"),
    ],
)
def test_rangefinders_need_the_floor_that_they_measure_to(floor: str, found: str, texts: Texts) -> None:
    robot = texts.robot(SLED.replace('<geom type="plane" size="9 9 1"/>', floor))
    with pytest.raises(UserError, match=f"rover has {found}, and rangefinders measure to one there"):
        distances(Scene(robot), Pose(jnp.zeros(3), jnp.eye(3)), np.zeros(1))


class _Named(SteppingStones):
    def measures(self, outing: Any) -> dict[str, Any]:
        return {"reached": jnp.ones(()), "x": jnp.ones(()), "mine": jnp.ones(())}


def test_a_task_s_measures_have_names_of_their_own() -> None:
    """One called "reached" was the trial's success."""
    task = _Named(episode_steps=1)
    with pytest.raises(UserError, match=r"have reached, x\. Rename these measures of 'stepping_stones'\."):
        jax.eval_shape(lambda key: task.episode(lambda seen: jnp.zeros(task.action_size), key, 0), jax.random.key(0))


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_built_in_robots_that_move_in_a_plane_are_refused_in_a_maze(robot: Robot) -> None:
    if robot in IN_A_MAZE:
        assert SteppingStones(robot=robot).start == (-3.0, 1.0)
    else:
        with pytest.raises(UserError, match="starts its robots at x -3 and y 1, but with these as the first two"):
            SteppingStones(robot=robot)


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_robots_that_could_walk_around_obstacles_are_refused_there(robot: Robot) -> None:
    if robot in IN_A_MAZE:
        with pytest.raises(
            UserError, match=f"no walls at the ends of its obstacles, and the robot {robot.name} could walk"
        ):
            Obstacles(robot=robot)
    else:
        moved = replace(robot, start=(8.0, *[0.0] * (Scene(robot).model.nq - 1)))  # no longer as it is built in
        assert [Obstacles(robot=one).robot for one in (robot, moved)] == [robot, moved]
        with pytest.raises(UserError, match=f"{robot.name} starts at x 9 and y 0, but the first obstacle .* at x 8.8"):
            Obstacles(robot=replace(moved, start=(9.0, *moved.start[1:])))


PLANAR = SLED.replace('<joint name="y" type="slide" axis="0 1 0"/>', '<joint name="y" type="hinge" axis="0 -2 0"/>')


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("", ""), ""),
        (('axis="1 0 0"', 'axis="1 0.1 0"'), "could walk around them"),
        (('axis="0 -2 0"', 'axis="0 0 1"'), "could walk around them"),
        (('type="hinge"', 'type="ball"'), "could walk around them"),
        (('pos="0 0 0.3"', 'pos="0 3.5 0.3"'), "starts at x 0 and y 3.5"),
        (('pos="0 0 0.3"', 'pos="0 0 0.3" euler="0 0 90"'), "could walk around them"),
    ],
    ids=["in the plane", "askew", "about z", "any way", "beside", "turned"],
)
def test_a_custom_robot_meets_every_obstacle(change: tuple[str, str], sentence: str, texts: Texts) -> None:
    robot = texts.robot(PLANAR.replace(*change, 1))
    Locomotion(robot=robot)
    if not sentence:
        assert Obstacles(robot=robot).robot is robot
    else:
        with pytest.raises(UserError, match=sentence):
            Obstacles(robot=robot)


ASSETS = sorted((Path(gymnasium.__file__).parent / "envs/mujoco/assets").glob("*.xml"))


REFUSED = {
    "hopper": r"a capsule \(torso_geom\) and a capsule \(leg_geom\) that can touch",
    "humanoid": "another solver than Newton's, tendons, which is not simulated",
    "humanoidstandup": "another solver than Newton's, tendons, which is not simulated",
    "pusher": "a capsule .* and a cylinder .* that can touch",
    "pusher_v5": "a capsule .* and a cylinder .* that can touch",
}


@pytest.mark.parametrize("file", ASSETS, ids=lambda file: file.stem)
def test_gymnasium_s_robots_are_simulated_or_refused_for_what_they_have(file: Path) -> None:
    make = partial(Robot, file.stem, f"gymnasium:envs/mujoco/assets/{file.name}", contacts=12)
    if file.stem in REFUSED:
        with pytest.raises(UserError, match=f"robot {file.stem} has .*{REFUSED[file.stem]}"):
            _ = Scene(make()).model
    else:
        scene = Scene(make())
        assert scene.integrates_by_rk4 != scene.damps_implicitly
        assert scene.integrates_by_rk4 == (file.stem != "half_cheetah")
