"""Where a robot touches the world, and which contacts a step keeps: MJX's, in far fewer operations.

MJX has one algorithm for all convex shapes, makes a frame for every pair of geoms that could touch, sorts all of them
by depth, and allows for any two bodies in each that it keeps. Here spheres and capsules on boxes have formulas of
their own. Only contacts that are kept get frames. They are sorted only where more touch than are kept. Where each
limb has a place of its own among them, its body is known while tracing, and so are the zeros of its Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from numpy.typing import NDArray

from evoclaims.core.foreign import Later
from evoclaims.envs.ecorobot.capsule_box import capsule_on_box
from evoclaims.envs.ecorobot.constraints import Rows
from evoclaims.envs.ecorobot.robots import Robot
from evoclaims.envs.ecorobot.scene import mjx
from evoclaims.kernels import seldom

_driver = Later("mujoco.mjx._src.collision_driver")
_constraint = Later("mujoco.mjx._src.constraint")
_support = Later("mujoco.mjx._src.support")

TINY: Final = 1e-15
"""MuJoCo's smallest length (mjMINVAL)."""
STEEP: Final = 0.5
"""Sine of a capsule's angle to a plane's normal from which on MJX's friction pyramid lies along the capsule."""
PLANE, SPHERE, CAPSULE, BOX = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{k}")) for k in ("PLANE", "SPHERE", "CAPSULE", "BOX")
)
WITHOUT: Final = int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
"""The flags with which a custom robot touches nothing."""
FIELDS: Final = ("includemargin", "friction", "solref", "solimp")
"""What MJX's contacts have of surfaces and their solver."""


@dataclass(frozen=True)
class Pairs:
    """Contacts of pairs of geoms, whether or not they touch, as arrays [n, …].

    Attributes:
        distance: less than 0 where they touch, m.
        point: from which the contact is offset along the normal by `offset` and a `share` of the distance.
        offset: m.
        share: a half or nothing.
        towards: from the first geom to the second, of any length.
        axis: along which the friction pyramid lies; 0 where only the normal decides.
        geoms: MuJoCo's ids, known while tracing.
        kinds: the group of each, by the types of its two geoms.
        surfaces: each array of `FIELDS`.

    The last two are what MJX says of pairs; formulas for shapes leave them empty.
    """

    distance: Array
    point: Array
    offset: Array
    share: Array
    towards: Array
    axis: Array
    geoms: NDArray[np.int64]
    kinds: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    surfaces: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Kept:
    """Contacts that are kept, as arrays [places, …].

    Attributes:
        touches: whether there is one at this place; if not, the other numbers are those of any contact.
        distance: less than 0, m.
        place: between the surfaces, in the middle.
        frame: the normal and two tangents, as rows.
        bodies: MuJoCo's ids of both; the world comes first.
        surfaces: each array of `FIELDS`.
    """

    touches: Bool[Array, " places"]
    distance: Float[Array, " places"]
    place: Float[Array, "places 3"]
    frame: Float[Array, "places 3 3"]
    bodies: Int[Array, "places 2"]
    surfaces: dict[str, Array]


def constraints(robot: Robot, model: Any, data: Any) -> Rows:
    """Return what joints' limits and contacts ask for; contacts that touch, or the deepest if these are too many.

    Args:
        robot: says how many contacts are kept.
        model: MJX's.
        data: MJX's, with places, orientations and velocities.
    """
    contact = data._impl.contact.replace(dim=np.zeros(0, int))  # MJX makes the rows of limits alone
    limits = mjx.make_constraint(model, data.tree_replace({"_impl.contact": contact}))._impl
    parts = [Rows(jnp.eye(len(limits.efc_D)), limits.efc_J, limits.efc_aref, limits.efc_D)]
    found = {} if model.opt.disableflags & WITHOUT else _found(model, data)
    for dimension, pairs in sorted(found.items()):
        parts.append(_pyramids(dimension, _kept(robot, pairs, model), model, data))
    return Rows(
        jax.scipy.linalg.block_diag(*(part.mix for part in parts)),
        *(jnp.concatenate([getattr(p, name) for p in parts]) for name in ("directions", "reference", "stiffness")),
    )


def _pyramids(dimension: int, kept: Kept, model: Any, data: Any) -> Rows:
    """Return the edges of contacts' friction pyramids; of a contact without friction, its normal.

    MuJoCo's documentation, "Computation": "Constraint model", "Friction cones".
    """
    jacobians: Any = jax.vmap(jax.vmap(lambda place, body: _support.jac(model, data, place, body), (None, 0)))
    moves, turns = (one[:, 1] - one[:, 0] for one in jacobians(kept.place, kept.bodies))
    both = [jnp.einsum("cij,cvj->civ", kept.frame, one) for one in (moves, turns)]
    directions = jnp.concatenate(both, axis=1)[:, :dimension]
    # The normal with each other direction, this way and that way; as much of it as the friction allows.
    tangents = range(1, dimension)
    signs = np.array(
        [[1.0, *(sign * (own == other) for other in tangents)] for own in tangents for sign in (1, -1)] or [[1.0]]
    )
    friction = kept.surfaces["friction"]
    shares = jnp.concatenate([jnp.ones_like(friction[:, :1]), friction[:, : dimension - 1]], axis=1)
    mix = shares[:, None, :] * jnp.asarray(signs, shares.dtype)

    resistance = jnp.sum(model.body_invweight0[:, 0][kept.bodies], axis=1)
    if dimension > 1:
        square = friction[:, 0] ** 2
        resistance = resistance * (1 + square) * 2 * square / model.opt.impratio
    gap = kept.distance - kept.surfaces["includemargin"]
    solver = kept.surfaces["solref"], kept.surfaces["solimp"], gap
    spring, damping, impedance = jax.vmap(lambda *given: _constraint._kbi(model, *given))(*solver)
    softness = jnp.maximum(resistance * (1 - impedance) / impedance, TINY)
    velocity = jnp.einsum("ced,cd->ce", mix, directions @ data.qvel)
    reference = -damping[:, None] * velocity - (spring * impedance * gap)[:, None]
    return Rows(
        jax.scipy.linalg.block_diag(*mix),
        directions.reshape(-1, directions.shape[2]),
        reference.reshape(-1),
        jnp.repeat(jnp.where(kept.touches, 1 / softness, 0.0), len(signs)),
    )


def _found(model: Any, data: Any) -> dict[int, Pairs]:
    """Return the contacts of all pairs that could touch, by the dimension of their friction."""
    parts: dict[int, list[Pairs]] = {}
    geoms, surfaces = _driver._geom_groups(model), _driver._contact_groups(model, data)
    for kind, key in enumerate(geoms):
        ids = np.array(geoms[key])[:, :2]
        pairs = _of_spheres(key, ids, model, data) or _by_mjx(key, ids, model, data)
        each = len(pairs.geoms) // len(ids)
        theirs = {name: jnp.repeat(getattr(surfaces[key], name), each, axis=0) for name in FIELDS}
        pairs = replace(pairs, kinds=np.full(len(pairs.geoms), kind), surfaces=theirs)
        parts.setdefault(key.condim, []).append(_from_the_world(model, pairs))
    return {dimension: _together(pairs) for dimension, pairs in parts.items()}


def _of_spheres(key: Any, geoms: NDArray[np.int64], model: Any, data: Any) -> Pairs | None:
    """Return the contacts of spheres with planes, boxes or capsules, as C computes them; None for other types."""
    types = int(key.types[0]), int(key.types[1])
    nearest = {(PLANE, SPHERE): _to_plane, (SPHERE, BOX): _to_box, (SPHERE, CAPSULE): _to_capsule}.get(types)
    if nearest is None:
        return None
    geoms = geoms if types[0] == SPHERE else geoms[:, ::-1]
    sphere, other = geoms.T
    centre, radius = data.geom_xpos[sphere], model.geom_size[sphere][:, 0]
    gap, towards = nearest(centre - data.geom_xpos[other], data.geom_xmat[other], model.geom_size[other])
    half, none = jnp.full_like(radius, 0.5), jnp.zeros_like(centre)
    return Pairs(gap - radius, centre, radius, half, towards, none, geoms)


def _by_mjx(key: Any, geoms: NDArray[np.int64], model: Any, data: Any) -> Pairs:
    """Return the contacts as MJX computes them, one or more for each pair in turn."""
    types = tuple(map(int, key.types))
    if types == (CAPSULE, BOX):
        capsule, box = geoms.T
        length_and_radius = model.geom_size[capsule][:, 1], model.geom_size[capsule][:, 0]
        bodies = data.geom_xpos[capsule], data.geom_xmat[capsule][:, :, 2], *length_and_radius
        boxes = data.geom_xpos[box], data.geom_xmat[box], model.geom_size[box]
        distance, place, normal = map(jnp.concatenate, jax.vmap(capsule_on_box)(*bodies, *boxes))
    else:
        distance, place, frame = _driver._COLLISION_FUNC[key.types](model, data, key, jnp.asarray(geoms))
        normal = frame[:, 0]
    geoms = np.repeat(geoms, len(distance) // len(geoms), axis=0)
    lies = types == (PLANE, CAPSULE)
    none, axis = jnp.zeros_like(distance), data.geom_xmat[geoms[:, 1]][:, :, 2] if lies else jnp.zeros_like(place)
    return Pairs(distance, place, none, none, normal, axis, geoms)


def _from_the_world(model: Any, pairs: Pairs) -> Pairs:
    """Return the same contacts, a geom of the world first in each that has one."""
    one, other = model.geom_bodyid[pairs.geoms.T]
    turned = (other == 0) & (one > 0)
    sign = jnp.where(turned, -1.0, 1.0).astype(pairs.distance.dtype)
    return replace(
        pairs,
        offset=sign * pairs.offset,
        share=sign * pairs.share,
        towards=sign[:, None] * pairs.towards,
        geoms=np.where(turned[:, None], pairs.geoms[:, ::-1], pairs.geoms),
    )


def _together(parts: list[Pairs]) -> Pairs:
    """Return all of them, in this order."""
    names = ("distance", "point", "offset", "share", "towards", "axis")
    arrays: dict[str, Any] = {name: jnp.concatenate([getattr(p, name) for p in parts]) for name in names}
    surfaces = {name: jnp.concatenate([p.surfaces[name] for p in parts]) for name in FIELDS}
    geoms, kinds = (np.concatenate(known) for known in zip(*((p.geoms, p.kinds) for p in parts), strict=True))
    return Pairs(**arrays, geoms=geoms, kinds=kinds, surfaces=surfaces)


def _kept(robot: Robot, pairs: Pairs, model: Any) -> Kept:
    """Return the contacts that are kept."""
    bodies = model.geom_bodyid[pairs.geoms]
    touching = pairs.distance < pairs.surfaces["includemargin"]
    chosen, last = _places(robot, bodies, pairs.kinds, pairs.distance, touching)
    choosing = chosen & (last[:, None] != np.arange(len(bodies)))

    def of(values: Array) -> Array:
        picked = values[last]
        for candidate in range(len(bodies)):
            picked = jnp.where(choosing[:, candidate, None], values[candidate], picked)
        return picked

    numbers = [
        pairs.distance,
        pairs.point,
        pairs.offset,
        pairs.share,
        pairs.towards,
        pairs.axis,
        *pairs.surfaces.values(),
    ]
    numbers = [array.reshape(len(bodies), -1) for array in numbers]
    ends = np.cumsum([array.shape[1] for array in numbers])
    distance, point, offset, share, towards, axis, *rest = jnp.split(
        of(jnp.concatenate(numbers, axis=1)), ends[:-1], axis=1
    )
    surfaces = dict(zip(FIELDS, rest, strict=True))
    surfaces["includemargin"] = surfaces["includemargin"][:, 0]
    normal = _of_length_1(towards)
    return Kept(
        touches=jnp.any(chosen, axis=1),
        distance=distance[:, 0],
        place=point + (offset + share * distance) * normal,
        frame=_frames(normal, axis, STEEP if robot.is_built_in else TINY),
        bodies=of(jnp.asarray(bodies)),
        surfaces=surfaces,
    )


def _places(
    robot: Robot,
    bodies: NDArray[np.int64],
    kinds: NDArray[np.int64],
    distance: Float[Array, " n"],
    touching: Bool[Array, " n"],
) -> tuple[Bool[Array, "places n"], NDArray[np.int64]]:
    """Return which contact is at which place, at most one at each; and the last that can be there.

    How many touch in most steps decides where a step is `seldom`, but not the order of places.
    """
    n, most, usual = len(bodies), robot.contacts, min(robot.touching, robot.contacts)
    unusual = seldom if usual < most else jnp.asarray
    if n <= most:
        touching = jnp.concatenate([touching[:usual], seldom(touching[usual:])])
        return jnp.asarray(np.eye(n, dtype=bool)) & touching, np.arange(n)
    earlier = np.tri(n, k=-1, dtype=bool)
    limit = -jax.lax.top_k(-distance, most)[0][-1]
    deeper, level = distance < limit, distance == limit
    deep = deeper | level & (jnp.sum(level & earlier, axis=1) < most - jnp.sum(deeper))  # of equals the first, as MJX
    kept = touching & (deep | ~unusual(jnp.sum(touching) > most))
    _, limbs = np.unique(np.stack([bodies[:, 1], kinds]), axis=1, return_inverse=True)
    if np.any(bodies[:, 0]) or max(limbs) >= most:
        at = jnp.sum(kept & earlier, axis=1) == np.arange(most)[:, None]
        allowed = jnp.concatenate([jnp.full(usual, True), jnp.full(most - usual, unusual(jnp.sum(kept) > usual))])
        return kept & at & allowed[:, None], np.full(most, n - 1)
    theirs = limbs == np.arange(max(limbs) + 1)[:, None]
    second = kept & jnp.any(kept & earlier & (limbs == limbs[:, None]), axis=1)
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
    tangent = _of_length_1(tangent)
    return jnp.stack([normal, tangent, jnp.cross(normal, tangent)], axis=1)


def _of_length_1(vectors: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    """Return vectors of the same directions. One quotient for all three numbers: a GPU needs twenty instructions."""
    return vectors * (1.0 / jnp.sqrt(jnp.sum(vectors**2, axis=1, keepdims=True)))


def _to_plane(
    apart: Float[Array, "n 3"], turn: Float[Array, "n 3 3"], size: Float[Array, "n 3"]
) -> tuple[Float[Array, " n"], Float[Array, "n 3"]]:
    """Return how far spheres' centres are from planes, and the direction to them; arguments as for boxes."""
    up = turn[:, :, 2]
    return jnp.sum(apart * up, axis=1), -up


def _to_capsule(
    apart: Float[Array, "n 3"], turn: Float[Array, "n 3 3"], size: Float[Array, "n 3"]
) -> tuple[Float[Array, " n"], Float[Array, "n 3"]]:
    """Return how far spheres' centres are from capsules, and the direction to their axes; arguments as for boxes."""
    axis = turn[:, :, 2]
    along = jnp.clip(jnp.sum(apart * axis, axis=1), -size[:, 1], size[:, 1])
    to = along[:, None] * axis - apart
    length = jnp.sqrt(jnp.sum(to**2, axis=1))
    return length - size[:, 0], jnp.where((length > TINY)[:, None], to, jnp.array([1.0, 0.0, 0.0]))


def _to_box(
    apart: Float[Array, "n 3"], turn: Float[Array, "n 3 3"], size: Float[Array, "n 3"]
) -> tuple[Float[Array, " n"], Float[Array, "n 3"]]:
    """Return how far spheres' centres are from boxes, less than 0 inside, and the direction to them, of any length.

    Args:
        apart: from the boxes' centres to the spheres'.
        turn: the boxes' axes as columns.
        size: half-sizes.
    """
    local = jnp.sum(turn * apart[:, :, None], axis=1)
    to = jnp.clip(local, -size, size) - local
    outside = jnp.sqrt(jnp.sum(to**2, axis=1))
    # Inside, a sphere is pushed out of the nearest side; the first of equals, as in C: -x, +x, -y, …
    x, y, z = (size - jnp.abs(local)).T
    leaves = jnp.stack([(x <= y) & (x <= z), (x > y) & (y <= z), (z < x) & (z < y)], axis=1)
    back = jnp.where(leaves, jnp.where(local <= 0.0, 1.0, -1.0), 0.0)
    within = seldom(outside <= TINY)
    towards = jnp.where(within[:, None], back, to)
    depth = jnp.minimum(jnp.minimum(x, y), z)
    return jnp.where(within, -depth, outside), jnp.sum(turn * towards[:, None, :], axis=2)
