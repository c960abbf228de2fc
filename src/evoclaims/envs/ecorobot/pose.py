"""The torso's pose, computed only from a robot's generalized positions."""

from __future__ import annotations

import jax.numpy as jnp
import mujoco
from jaxtyping import Array, Float

from evoclaims.core.pytree import pytree
from evoclaims.envs.ecorobot.scene import Scene


@pytree
class Pose:
    """The torso in the world.

    Attributes:
        place: its centre, m.
        rotation: its axes as columns.
    """

    place: Float[Array, 3]
    rotation: Float[Array, "3 3"]

    @property
    def heading(self) -> Float[Array, ""]:
        """The direction of its x axis, seen from above, rad."""
        return jnp.arctan2(self.rotation[1, 0], self.rotation[0, 0])

    @property
    def pitch(self) -> Float[Array, ""]:
        """How far its x axis dips below the horizon, rad."""
        return jnp.arctan2(-self.rotation[2, 0], jnp.hypot(self.rotation[0, 0], self.rotation[1, 0]))

    @property
    def upside_down(self) -> Array:
        """Whether its z axis points down."""
        return self.rotation[2, 2] < 0


def torso(scene: Scene, position: Float[Array, " nq"]) -> Pose:
    """Return the pose of the first body: its joints applied in order."""
    model = scene.model
    place = jnp.asarray(model.body_pos[1], position.dtype)
    rotation = _of_quaternion(jnp.asarray(model.body_quat[1], position.dtype))
    first = int(model.body_jntadr[1])
    for joint in range(first, first + int(model.body_jntnum[1])):
        at = int(model.jnt_qposadr[joint])
        kind, axis = model.jnt_type[joint], jnp.asarray(model.jnt_axis[joint], position.dtype)
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            quaternion = position[at + 3 : at + 7]
            place, rotation = position[at : at + 3], _of_quaternion(quaternion / jnp.linalg.norm(quaternion))
        elif kind == mujoco.mjtJoint.mjJNT_BALL:
            quaternion = position[at : at + 4]
            turn = _of_quaternion(quaternion / jnp.linalg.norm(quaternion))
            place, rotation = _turned(place, rotation, turn, jnp.asarray(model.jnt_pos[joint], position.dtype))
        else:
            moved = position[at] - jnp.asarray(model.qpos0[at], position.dtype)
            if kind == mujoco.mjtJoint.mjJNT_SLIDE:
                place = place + moved * (rotation @ axis)
            else:
                half = moved / 2
                turn = _of_quaternion(jnp.concatenate([jnp.cos(half)[None], jnp.sin(half) * axis]))
                place, rotation = _turned(place, rotation, turn, jnp.asarray(model.jnt_pos[joint], position.dtype))
    return Pose(place=place, rotation=rotation)


def _turned(place: Array, rotation: Array, turn: Array, anchor: Array) -> tuple[Array, Array]:
    """Return place and rotation after a turn about a point of the torso."""
    return place + rotation @ (anchor - turn @ anchor), rotation @ turn


def _of_quaternion(quaternion: Float[Array, 4]) -> Float[Array, "3 3"]:
    """Return the rotation matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return jnp.stack(
        [
            jnp.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)]),
            jnp.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)]),
            jnp.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]),
        ]
    )
