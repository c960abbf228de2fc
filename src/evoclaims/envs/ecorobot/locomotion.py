"""Running: over free ground, with the reward of Brax's robots, and over obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, get_args

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Bool, Float

from evoclaims.core.errors import UserError, require_known
from evoclaims.core.pytree import pytree
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robot_task import ROBOT_PACKAGES, Outing, RobotTask, Ruling
from evoclaims.envs.ecorobot.robots import HALF_CHEETAH, Robot, is_built_in_and_planar


def forward(
    robot: Robot, seconds: float, before: Pose, after: Pose, action: Float[Array, " action"]
) -> tuple[Float[Array, ""], Bool[Array, ""]]:
    """Return Brax's reward of a step (forward velocity, health, minus control cost), and whether health is lost.

    Brax measures the humanoid's velocity at its centre of mass; here it is the torso's, as for all others.
    """
    velocity = (after.place[0] - before.place[0]) / seconds
    low, high = robot.healthy_height
    height = after.place[2]
    healthy = (low <= height) & (height <= high) & (jnp.abs(after.pitch) <= robot.healthy_pitch)
    reward = robot.forward_reward * velocity + robot.healthy_reward - robot.control_cost * jnp.sum(action**2)
    return reward, ~healthy


@dataclass(frozen=True)
class Locomotion(RobotTask):
    """Run forward, along x; the policy does not see where it is."""

    name: ClassVar[str] = "locomotion"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ROBOT_PACKAGES
    shows_place: ClassVar[bool] = False

    robot: Robot = HALF_CHEETAH

    @property
    def boxes(self) -> tuple[Box, ...]:
        """None."""
        return ()

    def rule(self, memory: Any, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:
        """Reward forward motion; end when the robot is no longer healthy."""
        reward, lost = forward(self.robot, self.scene.seconds, before, after, action)
        return Ruling(memory=memory, reward=reward, ended=lost)


Heights = Literal["hierarchical", "medium", "high"]

PLACES: Final = (9.0, 11.0, 13.0, 15.0, 17.0, 23.0, 25.0, 27.0, 29.0, 31.0, 43.0, 45.0, 47.0, 49.0, 51.0)
"""x of the obstacles, m."""
HALF_THICKNESS: Final = 0.2
DEPTH: Final = 1.0
"""How far obstacles reach below their top, m: one size for all, so that they differ only in place."""

_TINY: Final = 1e-6


@pytree
class FurthestRun:
    """The furthest x that the torso has reached, m."""

    furthest: Float[Array, ""]


@dataclass(frozen=True)
class Obstacles(RobotTask):
    """Run forward through a corridor with fifteen obstacles across it.

    Attributes:
        heights: of their tops: "hierarchical" (five of 0.1 m, five of 0.2 m, five of 0.3 m), "medium" (all 0.2 m) or
            "high" (all 0.3 m).

    The corridor's walls at y = ±3 are left out: the half-cheetah moves in the plane y = 0. Other robots have to, too.
    """

    name: ClassVar[str] = "obstacles"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ROBOT_PACKAGES

    robot: Robot = HALF_CHEETAH
    heights: Heights = "hierarchical"

    def __post_init__(self) -> None:
        """Check the name of the heights, and that the robot cannot walk around the obstacles."""
        super().__post_init__()
        require_known("profile of heights", self.heights, get_args(Heights))
        if not is_built_in_and_planar(self.robot):  # those need not be compiled
            self._require_plane()

    def _require_plane(self) -> None:
        """Check that the robot starts before the obstacles, and that its torso stays in the plane y = 0."""
        model, name = self.scene.whole, self.robot.name
        data = mujoco.MjData(model)
        data.qpos[:] = self.scene.start
        mujoco.mj_kinematics(model, data)
        joints = np.flatnonzero(model.jnt_bodyid == 1)
        along, across = np.abs(data.xaxis[joints, 1]), np.hypot(data.xaxis[joints, 0], data.xaxis[joints, 2])
        kinds = model.jnt_type[joints]
        stays = np.where(kinds == mujoco.mjtJoint.mjJNT_SLIDE, along, across) < _TINY
        if not np.all(stays & np.isin(kinds, (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE))):
            raise UserError(
                f"{self.name} has no walls at the ends of its obstacles, and the robot {name} could walk around them. "
                "Use a robot whose torso slides only along x and z and turns only about y, such as HALF_CHEETAH."
            )
        x, y, _ = data.xpos[1]
        first = min(self.obstacle_places) - HALF_THICKNESS
        if x >= first or abs(y) >= _TINY:
            raise UserError(
                f"The robot {name} starts at x {x:g} and y {y:g}, but the first obstacle of {self.name} begins at "
                f"x {first:g} and all are in the middle at y 0. Place its torso before it, at y 0."
            )

    @property
    def obstacle_places(self) -> tuple[float, ...]:
        """The obstacles' x, m."""
        return PLACES

    @property
    def tops(self) -> tuple[float, ...]:
        """Height of each obstacle, m."""
        profiles = {"hierarchical": (0.1,) * 5 + (0.2,) * 5 + (0.3,) * 5, "medium": (0.2,) * 15, "high": (0.3,) * 15}
        return profiles[self.heights]

    @property
    def boxes(self) -> tuple[Box, ...]:
        """The obstacles."""
        return tuple(
            Box((x, 0.0), (HALF_THICKNESS, 3.0), bottom=top - DEPTH, top=top)
            for x, top in zip(self.obstacle_places, self.tops, strict=True)
        )

    def memory(self, pose: Pose) -> FurthestRun:
        """Start where the torso is."""
        return FurthestRun(furthest=pose.place[0])

    def rule(self, memory: FurthestRun, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:
        """Reward as in plain locomotion."""
        reward, lost = forward(self.robot, self.scene.seconds, before, after, action)
        return Ruling(
            memory=FurthestRun(furthest=jnp.maximum(memory.furthest, after.place[0])), reward=reward, ended=lost
        )

    def measures(self, outing: Outing) -> dict[str, Array]:
        """Return the number of obstacles passed, and the furthest x, m."""
        furthest = outing.memory.furthest
        behind = jnp.asarray(np.array(self.obstacle_places) + HALF_THICKNESS, jnp.float32)
        return {"obstacles": jnp.sum(furthest > behind).astype(jnp.float32), "furthest": furthest}
