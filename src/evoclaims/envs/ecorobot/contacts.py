"""Where a robot touches the world, and which of these contacts a step keeps: MJX's, in a third of its operations.

MJX has one algorithm for all convex shapes, makes a frame for every pair of geoms that could touch, sorts all of them
by depth, and allows for any two bodies in each that it keeps. Here spheres and capsules on boxes have formulas of
their own, only contacts that are kept get frames, and they are sorted only where more touch than are kept. If each
limb has a place of its own among them, its body is known while tracing, and so are the zeros of its Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Bool, Float
from numpy.typing import NDArray

from evoclaims.core.foreign import Later
from evoclaims.envs.ecorobot.robots import Robot
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.kernels import seldom

_driver = Later("mujoco.mjx._src.collision_driver")

APART: Final = 1.0
"""Distance of contacts that do not touch, m."""
TINY: Final = 1e-15
"""MuJoCo's smallest length (mjMINVAL)."""
STEEP: Final = 0.5
"""Sine of a capsule's angle to a plane's normal from which on MJX's friction pyramid lies along the capsule."""
PLANE, SPHERE, CAPSULE, BOX = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{k}")) for k in ("PLANE", "SPHERE", "CAPSULE", "BOX")
)
FIELDS: Final = ("includemargin", "friction", "solref", "solreffriction", "solimp")
"""What MJX's contacts have of surfaces and their solver."""


@dataclass(frozen=True)
class Pairs:
    """Contacts of pairs of geoms, whether or not they touch, as arrays [n, …].

    Attributes:
        distance: less than 0 where they touch, m.
        place: between the surfaces, in the middle.
        normal: from the first geom to the second.
        axis: along which the friction pyramid lies; 0 where only the normal decides.
        geoms: MuJoCo's ids, known while tracing.
        surfaces: each array of `FIELDS`.
    """

    distance: Array
    place: Array
    normal: Array
    axis: Array
    geoms: NDArray[np.int64]
    surfaces: dict[str, Array]


def with_contacts(scene: Scene, model: Any, data: Any) -> Any:
    """Return MJX's data with the contacts that are kept: the deepest of those that touch, if these are too many.

    Places that no contact needs have a distance of `APART` and the numbers of any contact.

    Args:
        scene: where; only its robot and what is known while tracing.
        model: MJX's.
        data: MJX's, with places and orientations of all geoms.
    """
    found = _found(scene, model, data)
    if not found:
        return data
    kept = [_kept(scene, pairs) for _, pairs in sorted(found.items())]
    dimensions = np.concatenate(
        [[dimension] * len(one["dist"]) for dimension, one in zip(sorted(found), kept, strict=True)]
    )
    whole = {name: jnp.concatenate([one[name] for one in kept]) for name in kept[0]}
    contact = data._impl.contact.replace(**whole, dim=dimensions, geom1=whole["geom"][:, 0], geom2=whole["geom"][:, 1])
    return data.tree_replace({"_impl.contact": contact})


def _found(scene: Scene, model: Any, data: Any) -> dict[int, Pairs]:
    """Return the contacts of all pairs that could touch, by the dimension of their friction."""
    parts: dict[int, list[Pairs]] = {}
    known = _driver._geom_groups(scene.model)
    for (key, pairs), shared in zip(known.items(), _driver._contact_groups(model, data).values(), strict=True):
        ids = np.array(pairs)[:, :2]
        distance, place, normal = _touch(key, ids, model, data)
        each = len(distance) // len(ids)
        ids = np.repeat(ids, each, axis=0)
        axis = jnp.zeros_like(normal)
        if tuple(map(int, key.types)) == (PLANE, CAPSULE):
            axis = data.geom_xmat[ids[:, 1]][:, :, 2]
        ours, others = scene.model.geom_bodyid[ids.T] > 0
        turned = ours & ~others  # the world's comes first, so that limbs have their places
        parts.setdefault(key.condim, []).append(
            Pairs(
                distance,
                place,
                jnp.where(turned[:, None], -normal, normal),
                axis,
                np.where(turned[:, None], ids[:, ::-1], ids),
                {name: jnp.repeat(getattr(shared, name), each, axis=0) for name in FIELDS},
            )
        )
    return {dimension: _together(pairs) for dimension, pairs in parts.items()}


def _together(parts: list[Pairs]) -> Pairs:
    """Return all of them, in this order."""
    arrays = [jnp.concatenate([getattr(p, name) for p in parts]) for name in ("distance", "place", "normal", "axis")]
    surfaces = {name: jnp.concatenate([p.surfaces[name] for p in parts]) for name in FIELDS}
    return Pairs(*arrays, np.concatenate([p.geoms for p in parts]), surfaces)


def _touch(key: Any, ids: NDArray[np.int64], model: Any, data: Any) -> tuple[Array, Array, Array]:
    """Return distances, places and normals of pairs of the same two types, one or more for each pair in turn."""
    one, other = ids.T
    types = tuple(map(int, key.types))
    if types in {(SPHERE, BOX), (SPHERE, CAPSULE)}:
        nearest = _to_box if types[1] == BOX else _to_capsule
        centre, radius = data.geom_xpos[one], model.geom_size[one][:, 0]
        gap, normal = nearest(centre - data.geom_xpos[other], data.geom_xmat[other], model.geom_size[other])
        distance = gap - radius
        return distance, centre + normal * (radius + distance / 2)[:, None], normal
    distance, place, frame = _driver._COLLISION_FUNC[key.types](model, data, key, jnp.asarray(ids))
    return distance, place, frame[:, 0]


def _kept(scene: Scene, pairs: Pairs) -> dict[str, Array]:
    """Return the contacts that are kept, as MJX's arrays by name."""
    bodies = scene.model.geom_bodyid[pairs.geoms]
    # A contact's geoms are asked for their bodies alone, so the first geom of a body stands for all.
    geoms = scene.model.body_geomadr[bodies]
    touching = pairs.distance < pairs.surfaces["includemargin"]
    chosen, last = _places(scene.robot, bodies, pairs.distance, touching)
    choosing = chosen & (last[:, None] != np.arange(len(bodies)))

    def of(values: Array) -> Array:
        picked = values[last]
        for candidate in range(len(bodies)):
            picked = jnp.where(choosing[:, candidate, None], values[candidate], picked)
        return picked

    numbers = [pairs.distance[:, None], pairs.place, pairs.normal, pairs.axis]
    numbers += [array.reshape(len(bodies), -1) for array in pairs.surfaces.values()]
    ends = np.cumsum([array.shape[1] for array in numbers])
    distance, place, normal, axis, *surfaces = jnp.split(of(jnp.concatenate(numbers, axis=1)), ends[:-1], axis=1)
    made = dict(zip(FIELDS, surfaces, strict=True))
    made["includemargin"] = margin = made["includemargin"][:, 0]
    made["dist"] = jnp.where(jnp.any(chosen, axis=1), distance[:, 0], margin + APART)
    made["frame"] = _frames(normal, axis, STEEP if scene.robot.is_built_in else TINY)
    return made | {"pos": place, "geom": of(jnp.asarray(geoms))}


def _places(
    robot: Robot, bodies: NDArray[np.int64], distance: Float[Array, " n"], touching: Bool[Array, " n"]
) -> tuple[Bool[Array, "places n"], NDArray[np.int64]]:
    """Return which contact is at which place, at most one at each; and the last that can be there.

    How many touch in most steps decides where a step is `seldom`, but not the order of places.
    """
    n, most, usual = len(bodies), robot.contacts, min(robot.touching, robot.contacts)
    unusual = seldom if usual < most else jnp.asarray
    if n <= most:
        touching = jnp.concatenate([touching[:usual], seldom(touching[usual:])])
        return np.eye(n, dtype=bool) & touching, np.arange(n)
    deep = distance <= -jax.lax.top_k(-distance, most)[0][-1]
    kept = touching & (deep | ~unusual(jnp.sum(touching) > most))
    limbs = np.unique(bodies[:, 1])
    earlier = np.tri(n, k=-1, dtype=bool)
    if np.any(bodies[:, 0]) or len(limbs) > most // 2:
        at = jnp.sum(kept & earlier, axis=1) == np.arange(most)[:, None]
        allowed = jnp.concatenate([jnp.full(usual, True), jnp.full(most - usual, unusual(jnp.sum(kept) > usual))])
        return kept & at & allowed[:, None], np.full(most, n - 1)
    theirs = bodies[:, 1] == limbs[:, None]
    second = kept & jnp.any(kept & earlier & (bodies[:, 1] == bodies[:, 1:]), axis=1)
    second &= unusual(jnp.any(second))
    at = jnp.sum(second & earlier, axis=1) == np.arange(_seconds(theirs.sum(axis=1), most))[:, None]
    last = [*(int(np.flatnonzero(own)[-1]) for own in theirs), *[n - 1] * len(at)]
    return jnp.concatenate([theirs & kept & ~second, second & at]), np.array(last)


def _seconds(sizes: NDArray[np.int64], most: int) -> int:
    """Return how many of the contacts that are kept are not the first of their limb, at most."""
    seconds = 0
    for size in sorted(sizes, reverse=True):
        seconds += max(0, min(size, most) - 1)
        most -= min(size, most)
    return seconds


def _frames(normal: Float[Array, "n 3"], axis: Float[Array, "n 3"], least: float) -> Float[Array, "n 3 3"]:
    """Return the axes of friction pyramids as rows, the normals first.

    The second is the part of `axis` across the normal, if that is at least so long; else of y, or of z where the
    normal is near y.
    """

    def across(vector: Array) -> Array:
        return vector - normal * jnp.sum(normal * vector, axis=1, keepdims=True)

    y, z = jnp.array([0.0, 1.0, 0.0]), jnp.array([0.0, 0.0, 1.0])
    side, along = across(jnp.where(jnp.abs(normal[:, 1:2]) < 0.5, y, z)), across(axis)
    tangent = jnp.where(jnp.sum(along**2, axis=1, keepdims=True) >= least**2, along, side)
    tangent = tangent / jnp.sqrt(jnp.sum(tangent**2, axis=1, keepdims=True))
    return jnp.stack([normal, tangent, jnp.cross(normal, tangent)], axis=1)


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
