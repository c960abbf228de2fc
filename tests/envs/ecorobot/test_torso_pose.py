"""Where the torso is, against MuJoCo's own kinematics."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from plain_mujoco import random_positions

from evoclaims.envs.ecorobot.pose import Pose, torso
from evoclaims.envs.ecorobot.robots import ROBOTS, Robot
from evoclaims.envs.ecorobot.scene import Scene, scene


def _turned(w: float, x: float, y: float, z: float) -> Pose:
    """Return the pose of a torso at the origin with MuJoCo's matrix of a quaternion."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array([w, x, y, z]) / np.linalg.norm([w, x, y, z]))
    return Pose(place=jnp.zeros(3), rotation=jnp.asarray(matrix.reshape(3, 3), jnp.float32))


def _compare_with_mujoco(world: Scene) -> None:
    """Assert that random configurations put the torso where MuJoCo's kinematics puts it."""
    positions = random_positions(world.whole, 50)
    pose = jax.jit(jax.vmap(lambda position: torso(world, position)))(jnp.asarray(positions, jnp.float32))
    data = mujoco.MjData(world.whole)
    for i, position in enumerate(positions):
        data.qpos[:] = position
        mujoco.mj_kinematics(world.whole, data)
        np.testing.assert_allclose(pose.place[i], data.xpos[1], atol=4e-6)
        np.testing.assert_allclose(pose.rotation[i], data.xmat[1].reshape(3, 3), atol=2e-6)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_torso_is_where_mujoco_puts_it(name: str) -> None:
    _compare_with_mujoco(scene(ROBOTS[name]))


def test_heading_and_pitch_are_angles_of_the_torsos_own_x_axis() -> None:
    left = _turned(np.cos(0.4), 0.0, 0.0, np.sin(0.4))
    nose_down = _turned(np.cos(0.3), 0.0, np.sin(0.3), 0.0)
    np.testing.assert_allclose([left.heading, left.pitch], [0.8, 0.0], atol=1e-6)
    np.testing.assert_allclose([nose_down.heading, nose_down.pitch], [0.0, 0.6], atol=1e-6)


def test_upside_down_begins_beyond_a_quarter_turn() -> None:
    for angle, over in ((1.5, False), (1.6, True), (np.pi, True)):
        assert bool(_turned(np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0).upside_down) is over


def test_any_joints_of_a_torso_are_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """None of the robots above turns about two axes, about an axis beside its centre, or stands askew."""
    (tmp_path / "askew_robots").mkdir()
    (tmp_path / "askew_robots/__init__.py").touch()
    (tmp_path / "askew_robots/askew.xml").write_text(
        """
        <mujoco><worldbody><body pos="1 2 3" quat="0.9 0.1 -0.3 0.2">
          <joint type="hinge" axis="0 0 1" pos="0.3 -0.2 0.1"/> <joint type="slide" axis="1 2 0" ref="0.5"/>
          <joint type="hinge" axis="1 0 1" pos="-0.1 0.4 0.2"/> <geom size="0.1"/>
        </body></worldbody></mujoco>
        """
    )
    monkeypatch.syspath_prepend(tmp_path)
    _compare_with_mujoco(Scene(Robot("askew", "askew_robots:askew.xml")))
