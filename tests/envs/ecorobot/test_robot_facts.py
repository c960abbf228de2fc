"""What our scenes take over from the robots' own files, what can touch a wall, and how much is simulated in a step."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from plain_mujoco import alone

from evoclaims.envs.ecorobot import stones
from evoclaims.envs.ecorobot.locomotion import Locomotion
from evoclaims.envs.ecorobot.robots import ROBOTS
from evoclaims.envs.ecorobot.scene import WORLD_GROUP, scene

TOUCHING = {
    "simple_rob": {"torso"},
    "ant": {"left_foot_geom", "right_foot_geom", "third_foot_geom", "fourth_foot_geom"},
    "half_cheetah": {"head", "bthigh", "bfoot", "fthigh", "ffoot"},
    "hopper": {"foot_geom"},
    "humanoid": {"right_foot", "left_foot"},
    "walker2d": {"torso_geom", "foot_geom", "foot_left_geom"},
}
"""A torso that is not among them passes through walls, as in Brax's models."""

TAKEN_OVER = (
    # Of the ant's bodies those without joints are parts of others here; inertia as its joints feel it stays.
    *("dof_M0", "dof_invweight0", "qpos0", "jnt_range", "jnt_stiffness", "dof_armature", "dof_damping"),
    *("actuator_gear", "actuator_ctrlrange", "actuator_forcerange"),
)


def test_every_robot_has_its_facts_here() -> None:
    assert set(TOUCHING) == set(ROBOTS)


@pytest.mark.parametrize("name", ROBOTS)
def test_only_some_geoms_of_a_robot_touch_walls(name: str) -> None:
    model = scene(ROBOTS[name], stones.WALLS).whole
    ours = np.flatnonzero((model.geom_group == WORLD_GROUP) & (model.geom_bodyid == 0))
    assert len(ours) == len(stones.WALLS)
    robots = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] > 0]
    touching = {
        model.geom(one).name
        for one in robots
        for wall in ours
        if (model.geom_contype[one] & model.geom_conaffinity[wall])
        or (model.geom_contype[wall] & model.geom_conaffinity[one])
    }
    assert touching == TOUCHING[name]


# The half-cheetah's file asks for a total mass in a way that MuJoCo warns about since 3.17.
@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass':UserWarning")
@pytest.mark.parametrize("name", ROBOTS)
def test_walls_change_neither_masses_nor_joints_nor_motors(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its warnings to
    ours, theirs = scene(ROBOTS[name], stones.WALLS).whole, alone(name)
    for numbers in TAKEN_OVER:
        np.testing.assert_allclose(getattr(ours, numbers), getattr(theirs, numbers), rtol=1e-12, err_msg=numbers)
    assert ours.opt.timestep == theirs.opt.timestep
    assert np.sum(ours.body_mass) == pytest.approx(np.sum(theirs.body_mass), rel=1e-12)


def test_the_half_cheetah_weighs_14_kg_and_the_simplest_robot_what_its_density_says() -> None:
    assert np.sum(scene(ROBOTS["half_cheetah"]).model.body_mass) == pytest.approx(14.0)
    sphere = 4 / 3 * math.pi * 0.2**3
    assert np.sum(scene(ROBOTS["simple_rob"]).model.body_mass) == pytest.approx(5 * sphere)


@pytest.mark.parametrize(
    ("name", "positions", "velocities", "motors", "shown", "seconds"),
    [
        ("simple_rob", 3, 3, 4, 1 + 2, 0.05),
        ("ant", 15, 14, 8, 13 + 14, 0.05),
        ("half_cheetah", 9, 9, 6, 8 + 9, 0.05),
        ("hopper", 6, 6, 3, 5 + 6, 0.008),
        ("humanoid", 24, 23, 17, 22 + 23, 0.015),
        ("walker2d", 9, 9, 6, 8 + 9, 0.008),
    ],
)
def test_sizes_and_the_time_of_a_step(
    name: str, positions: int, velocities: int, motors: int, shown: int, seconds: float
) -> None:
    task = Locomotion(robot=ROBOTS[name])
    assert (task.scene.model.nq, task.scene.model.nv) == (positions, velocities)
    assert (task.action_size, task.observation_size, task.horizon) == (motors, shown, 1000)
    assert task.scene.seconds == pytest.approx(seconds)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_solver_is_set_as_the_paper_sets_it(name: str) -> None:
    option = scene(ROBOTS[name]).model.opt
    assert option.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert (option.iterations, option.ls_iterations) == (1, 4)
    assert option.disableflags & mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    assert option.integrator == mujoco.mjtIntegrator.mjINT_EULER
