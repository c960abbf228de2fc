"""Three kinds of contacts as MuJoCo in C computes them, where MJX computes others: custom robots' feet and walls."""

from __future__ import annotations

from typing import Any, Final

import jax.numpy as jnp
import mujoco
from jaxtyping import Array, Float

TINY: Final = 1e-15
"""MuJoCo's smallest length (mjMINVAL)."""


def as_in_c(types: Array, model: Any, data: Any) -> Any:
    """Return MJX's data with other contacts of capsules on planes, and of spheres on boxes and capsules.

    A steep capsule's friction acts along and across the capsule in C, and along the world's axes in MJX, which differ as
    pyramids. A sphere's contacts are off by about 1e-6 in MJX.

    Args:
        types: MuJoCo's types of all geoms.
        model, data: MJX's, with contacts.
    """
    contact = data._impl.contact
    if not contact.dist.shape[0]:
        return data
    one, other = contact.geom.T
    kinds = mujoco.mjtGeom
    turned = (types[one] == int(kinds.mjGEOM_PLANE)) & (types[other] == int(kinds.mjGEOM_CAPSULE))
    frame = jnp.where(turned[:, None, None], _along(contact.frame, data.geom_xmat[other][:, :, 2]), contact.frame)
    round_ = types[one] == int(kinds.mjGEOM_SPHERE)
    boxed = round_ & (types[other] == int(kinds.mjGEOM_BOX))
    rolled = round_ & (types[other] == int(kinds.mjGEOM_CAPSULE))
    where = data.geom_xpos[one] - data.geom_xpos[other], data.geom_xmat[other], model.geom_size[other]
    (box_gap, box_way), (capsule_gap, capsule_way) = _to_box(*where), _to_capsule(*where)
    gap, normal = jnp.where(boxed, box_gap, capsule_gap), jnp.where(boxed[:, None], box_way, capsule_way)
    radius = model.geom_size[one][:, 0]
    distance = gap - radius
    place = data.geom_xpos[one] + normal * (radius + distance / 2)[:, None]
    met = boxed | rolled
    side, up = jnp.array([0.0, 1.0, 0.0]), jnp.array([0.0, 0.0, 1.0])
    tangent = jnp.where(jnp.abs(normal[:, 1:2]) < 0.5, side[None], up[None])
    square = _along(jnp.stack([normal, tangent, tangent], axis=1), tangent)
    return data.tree_replace(
        {
            "_impl.contact.frame": jnp.where(met[:, None, None], square, frame),
            "_impl.contact.dist": jnp.where(met, distance, contact.dist),
            "_impl.contact.pos": jnp.where(met[:, None], place, contact.pos),
        }
    )


def _along(frame: Float[Array, "contacts 3 3"], axis: Float[Array, "contacts 3"]) -> Float[Array, "contacts 3 3"]:
    """Return frames with the same normals (their first rows) and tangents along an axis, unless that is the normal."""
    normal = frame[:, 0]
    tangent = axis - normal * jnp.sum(normal * axis, axis=1, keepdims=True)
    length = jnp.sqrt(jnp.sum(tangent**2, axis=1, keepdims=True))
    tangent = tangent / jnp.maximum(length, TINY)
    made = jnp.stack([normal, tangent, jnp.cross(normal, tangent)], axis=1)
    return jnp.where((length > TINY)[:, :, None], made, frame)


def _to_capsule(
    apart: Float[Array, "contacts 3"], turn: Float[Array, "contacts 3 3"], size: Float[Array, "contacts 3"]
) -> tuple[Float[Array, " contacts"], Float[Array, "contacts 3"]]:
    """Return how far a sphere's centre is from a capsule, and the direction to its axis; arguments as for a box."""
    axis = turn[:, :, 2]
    along = jnp.clip(jnp.sum(apart * axis, axis=1), -size[:, 1], size[:, 1])
    to = along[:, None] * axis - apart
    length = jnp.sqrt(jnp.sum(to**2, axis=1))
    way = jnp.where((length > TINY)[:, None], to / jnp.maximum(length, TINY)[:, None], jnp.array([1.0, 0.0, 0.0])[None])
    return length - size[:, 0], way


def _to_box(
    apart: Float[Array, "contacts 3"], turn: Float[Array, "contacts 3 3"], size: Float[Array, "contacts 3"]
) -> tuple[Float[Array, " contacts"], Float[Array, "contacts 3"]]:
    """Return how far a sphere's centre is from a box, less than 0 inside, and the direction from it to the box.

    Args:
        apart: from the box's centre to the sphere's.
        turn: the box's axes as columns.
        size: half-sizes.
    """
    local = jnp.sum(turn * apart[:, :, None], axis=1)
    to = jnp.clip(local, -size, size) - local
    outside = jnp.sqrt(jnp.sum(to**2, axis=1))
    within = outside <= TINY
    # Inside, it is pushed out of the nearest side; the first of equals, as in C: -x, +x, -y, …
    depths = jnp.stack([local + size, size - local], axis=2).reshape(-1, 6)
    depth = jnp.min(depths, axis=1)
    nearest = jnp.argmin(depths, axis=1)
    out = jnp.stack([(nearest == 2 * axis) * 1.0 - (nearest == 2 * axis + 1) * 1.0 for axis in range(3)], axis=1)
    way = jnp.where(within[:, None], out, to / jnp.maximum(outside, TINY)[:, None])
    return jnp.where(within, -depth, outside), jnp.sum(turn * way[:, None, :], axis=2)
