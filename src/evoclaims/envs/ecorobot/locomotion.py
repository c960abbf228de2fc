"""Locomotion over free ground, with the reward of Brax's robots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.outing import Ruling
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robot_task import ROBOT_PACKAGES, RobotTask
from evoclaims.envs.ecorobot.robots import HALF_CHEETAH, Robot


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
