"""Sensors: rays from a robot that end at the scene's boxes or at the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real
from typing import Final, Protocol

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Float

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.scene import Scene

ARENA: Final = math.hypot(8.0, 8.0)
"""The diagonal of the paper's arena, m."""


UNEVEN: Final = 1e-6
"""A floor is level up to this height, m, and up to this difference of its normal from the vertical."""


class Sensor(Protocol):
    """How a robot senses the world, as part of its observation."""

    def read(self, scene: Scene, pose: Pose) -> Float[Array, " size"]:
        """Return the readings, each in [0, 1]."""


@dataclass(frozen=True)
class Rangefinders:
    """Distances to the nearest box or the floor, from the front half of the torso's surface outwards.

    Attributes:
        count: rays, spread evenly from the right (-90°) over the front, the torso's x axis, to the left (90°).
        reach: the distance that reads 1, m; a ray reads 1 if and only if it meets nothing nearer.
    """

    count: int = 5
    reach: float = ARENA

    def __post_init__(self) -> None:
        """Check the numbers."""
        numbers = isinstance(self.count, int | np.integer) and isinstance(self.reach, Real)
        if not numbers or self.count < 1 or not 0 < self.reach < math.inf:
            raise UserError(
                f"A sensor has count={self.count!r} and reach={self.reach!r}. Write at least 1 ray, and a finite reach "
                "above 0, in m."
            )

    def read(self, scene: Scene, pose: Pose) -> Float[Array, " size"]:
        """Return distance / reach of each ray, 1 for nothing."""
        angles = np.linspace(-90.0, 90.0, self.count) if self.count > 1 else np.zeros(1)
        return jnp.minimum(distances(scene, pose, angles) / self.reach, 1.0)


def distances(scene: Scene, pose: Pose, angles: np.ndarray) -> Float[Array, " rays"]:
    """Return how far each ray goes from the torso's surface, m; infinity where it meets nothing, 0 inside a box.

    Args:
        scene: whose boxes stop the rays.
        pose: of the torso.
        angles: of the rays in the torso's plane, counterclockwise from its front, degrees.
    """
    turned = np.radians(np.asarray(angles))
    ahead = np.stack([np.cos(turned), np.sin(turned), np.zeros_like(turned)], axis=1)
    directions = jnp.asarray(ahead, jnp.float32) @ pose.rotation.T
    origins = pose.place[None] + scene.robot.torso_radius * directions
    _require_level_floor(scene)
    # The floor: hit from above, by rays that point down.
    down = jnp.minimum(directions[:, 2], 0.0)
    nearest = jnp.where(down < 0, jnp.maximum(origins[:, 2], 0.0) / jnp.maximum(-down, 1e-9), jnp.inf)
    if not scene.boxes:
        return nearest
    axes = jnp.asarray(np.stack([box.rotation for box in scene.boxes]), jnp.float32)
    centres = jnp.asarray(np.array([box.place for box in scene.boxes], np.float32))
    sizes = jnp.asarray(np.stack([box.size for box in scene.boxes]), jnp.float32)
    # In each box's own frame (slab method, Kay and Kajiya 1986): rays × boxes × axes.
    local_origins = jnp.einsum("rbi,bij->rbj", origins[:, None] - centres[None], axes)
    local_directions = jnp.einsum("ri,bij->rbj", directions, axes)
    steep = jnp.where(jnp.abs(local_directions) < 1e-9, 1e-9, local_directions)
    one, other = (-sizes[None] - local_origins) / steep, (sizes[None] - local_origins) / steep
    enters = jnp.max(jnp.minimum(one, other), axis=-1)
    leaves = jnp.min(jnp.maximum(one, other), axis=-1)
    hits = jnp.where((enters <= leaves) & (leaves >= 0), jnp.maximum(enters, 0.0), jnp.inf)
    return jnp.minimum(nearest, jnp.min(hits, axis=1))


@lru_cache(maxsize=64)
def _require_level_floor(scene: Scene) -> None:
    """Check that rays which point down meet the floor at z = 0, where `distances` has it.

    Raises:
        UserError: where the robot's file has it elsewhere, tilted, or not at all, although its torso may tilt.
    """
    model = scene.whole
    planes = np.flatnonzero((model.geom_bodyid == 0) & (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE))
    normals = np.zeros((len(planes), 3))
    for normal, plane in zip(normals, planes, strict=True):
        mujoco.mju_rotVecQuat(normal, np.array([0.0, 0.0, 1.0]), model.geom_quat[plane])
    level = (np.abs(model.geom_pos[planes, 2]) < UNEVEN) & (normals[:, 2] > 1.0 - UNEVEN)
    if len(planes) and level.all():
        return
    found = "no floor" if not len(planes) else "a floor that is not level at z = 0"
    raise UserError(
        f"The robot {scene.robot.name} has {found}, and rangefinders measure to one there. Write a plane at z = 0 into "
        "its file, or give the task no sensor."
    )
