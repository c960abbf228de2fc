"""A capsule's contacts with a box, against MJX's own function for capsules and convex bodies."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mujoco.mjx._src import collision_convex, mesh
from mujoco.mjx._src.collision_types import GeomInfo
from numpy.typing import NDArray

from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.ecorobot.capsule_box import capsule_on_box
from evoclaims.kernels import one_kernel

Numbers = NDArray[Any]
Poses = tuple[Numbers, ...]
Contacts = tuple[Numbers, ...]
MANY = 20_000
TOLERANCE = 1e-4
# How many may be off by more: a rounding error decides whether MJX takes the face, or which one.
SELDOM = 1 / 2_000
MARGIN = 0.02
"""Contacts with a smaller distance are compared, m: those that touch, and those that a margin would let act."""
ALONG = 0.04
"""How far the place on an edge that is parallel to the axis may be off along it, m: MJX divides rounding by 1e-6."""
# How many of three coordinates of the capsule's nearest point are beyond the box.
NEAR = {"face": 1, "edge": 2, "corner": 3, "inside": 0}
BOXES = {"": (0.1, 0.6), "small": (0.02, 0.06), "large": (1.0, 4.0)}


def _mjx(centre: Any, axis: Any, half_length: Any, radius: Any, place: Any, turn: Any, size: Any) -> Any:
    box = mesh.box(GeomInfo(place[None], turn[None], size[None]))
    box = box.replace(pos=place, mat=turn, size=size, face=box.face[0], vert=box.vert[0])
    capsule = GeomInfo(centre, jnp.stack([axis, axis, axis], axis=1), jnp.stack([radius, half_length]))
    return collision_convex._capsule_convex(capsule, box)


@jax.jit
def _all_mjx(*poses: Any) -> Any:
    with implicit_promotions():
        return jax.vmap(_mjx)(*poses)


@jax.jit
def _all_ours(*poses: Any) -> Any:
    return jax.vmap(capsule_on_box)(*poses)


def _both(poses: Poses) -> tuple[Contacts, Contacts]:
    return tuple(map(np.asarray, _all_mjx(*poses))), tuple(map(np.asarray, _all_ours(*poses)))


def _unit(vectors: Numbers) -> Numbers:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _turns(random: np.random.Generator) -> Numbers:
    turns = np.linalg.qr(random.normal(size=(MANY, 3, 3)))[0]
    return turns * np.linalg.det(turns)[:, None, None]


def _poses(
    random: np.random.Generator,
    near: str,
    box: str = "",
    axis: Numbers | None = None,
    turn: Numbers | None = None,
    planar: bool = False,
) -> Poses:
    """Return random poses near a box's faces, edges or corners; `axis` is seen from the box."""
    size = random.uniform(*BOXES[box], (MANY, 3))
    half_length, radius = random.uniform(0.03, 0.4, MANY), random.uniform(0.03, 0.12, MANY)
    axis = _unit(random.normal(size=(MANY, 3))) if axis is None else axis
    turn = np.broadcast_to(np.eye(3), (MANY, 3, 3)) if turn is None else turn
    beyond = np.argsort(random.uniform(size=(MANY, 3)), axis=1) < NEAR[near]
    depth = np.where(
        beyond, size + random.uniform(0, 1.2, (MANY, 3)) * radius[:, None], size * random.uniform(0, 1, (MANY, 3))
    )
    point, place = random.choice([-1, 1], (MANY, 3)) * depth, random.uniform(-3, 3, (MANY, 3))
    if planar:
        point[:, 1] = place[:, 1] = 0
    centre = point - (random.uniform(-1, 1, MANY) * half_length)[:, None] * axis
    world = partial(np.einsum, "nij,nj->ni", turn)
    poses = place + world(centre), world(axis), half_length, radius, place, turn, size
    return tuple(np.asarray(p, np.float32) for p in poses)


def _off(poses: Poses, one: Contacts, other: Contacts) -> Numbers:
    """Return by how much contacts differ that are near in one or the other; a normal, by where it ends.

    MJX shortens an edge or the axis by 5e-7 / its half length where it looks for the nearest points. This is not
    counted, nor how it turns a normal and moves the place between both surfaces.
    """
    (gap, place, normal), (gap2, place2, normal2) = one, other
    apart = np.clip(np.maximum(gap, gap2) + poses[3][:, None], 1e-3, 1)
    shortened = 5e-7 / np.minimum(np.where(poses[2] > 0, poses[2], 1), poses[6].min(axis=1))[:, None]
    ends = np.abs(normal - normal2).max(axis=2) * apart - shortened
    places = np.abs(place - place2).max(axis=2) - shortened * (1 + poses[3][:, None] / apart)
    differences = np.maximum(np.abs(gap - gap2), np.maximum(ends, places))
    return np.where((gap < MARGIN) | (gap2 < MARGIN), differences, 0).max(axis=1)


def _check_where_mjx_jumps(random: np.random.Generator, poses: Poses, ours: Contacts) -> None:
    """Check that MJX gives our contacts, too, for poses that differ by no more than about 1e-5.

    One may be left: shortening (`_off`) turns a normal further than this, to the other side of MJX's cosine of 0.99.
    """
    times = 64
    moved = [np.repeat(p, times, axis=0) for p in poses]
    size = np.resize([1e-5, 1e-6], len(moved[0]))[:, None]
    moved[0] = np.float32(moved[0] + random.normal(size=moved[0].shape) * size)
    moved[1] = np.float32(_unit(moved[1] + random.normal(size=moved[1].shape) * size))
    mjx, same = map(np.asarray, _all_mjx(*moved)), (np.repeat(c, times, axis=0) for c in ours)
    assert (_off(tuple(moved), tuple(mjx), tuple(same)).reshape(-1, times).min(axis=1) >= TOLERANCE).sum() <= 1


def _touches_edge(contacts: Contacts) -> Any:
    return (contacts[0][:, 0] < 0) & (contacts[0][:, 1] == 1) & (contacts[2][:, 0] != contacts[2][:, 1]).any(axis=1)


def _compare(random: np.random.Generator, poses: Poses, some_on: tuple[str, ...] = ("face", "edge")) -> None:
    """Compare both; of the poses, at least one in a hundred touches each of `some_on`."""
    mjx, ours = _both(poses)
    off = _off(poses, mjx, ours)
    assert all(np.isfinite(part).all() for part in ours)
    assert np.quantile(off, 0.99) < TOLERANCE / 2
    jumps = np.flatnonzero(off >= TOLERANCE)
    assert len(jumps) <= SELDOM * MANY
    if len(jumps):
        _check_where_mjx_jumps(random, tuple(p[jumps] for p in poses), tuple(c[jumps] for c in ours))
    edge = _touches_edge(ours)
    for kind, touches in (("face", (ours[0] < 0).any(axis=1) & ~edge), ("edge", edge)):
        assert touches.mean() >= 0.01 or kind not in some_on


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("near", NEAR)
def test_contacts_are_mjx_s(near: str, box: str) -> None:
    random = np.random.default_rng(0)
    poses = _poses(random, near, box, turn=_turns(random))
    _compare(random, poses, ("face",) if near == "inside" else ("face", "edge"))


@pytest.mark.parametrize("near", ["face", "edge"])
def test_of_planar_robots(near: str) -> None:
    random = np.random.default_rng(1)
    angle = random.uniform(-np.pi, np.pi, MANY)
    axis = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    _compare(random, _poses(random, near, axis=axis, planar=True))


def test_of_planar_robots_that_lie_or_stand() -> None:
    random = np.random.default_rng(2)
    axis = np.eye(3)[random.choice([0, 2], MANY)]
    _compare(random, _poses(random, "edge", axis=axis, planar=True))


@pytest.mark.parametrize("noise", [0.0, 1e-8])
def test_of_capsules_parallel_to_a_face(noise: float) -> None:
    random = np.random.default_rng(3)
    axis = random.normal(size=(MANY, 3)) * (1 - np.eye(3)[random.integers(0, 3, MANY)])
    axis = _unit(axis) + noise * random.normal(size=(MANY, 3))
    for near in ("face", "edge"):
        _compare(random, _poses(random, near, axis=axis))


def test_of_capsules_parallel_to_an_edge() -> None:
    """MJX takes the point next to the edge's middle, give or take what 1e-6 makes of rounding errors.

    Where the capsule reaches beyond an end of the edge, two more edges are as near. MJX takes one of the three by
    rounding, and misses the contact if it is one that the capsule is not beyond.
    """
    random = np.random.default_rng(4)
    along = random.integers(0, 3, MANY)
    axis, rows = np.eye(3)[along], np.arange(MANY)
    poses = _poses(random, "edge", axis=axis)
    mjx, ours = _both(poses)
    middle = (poses[0] - poses[4])[rows, along]
    two_edges = np.abs(middle) + poses[2] >= poses[6][rows, along]
    edge, mjx_edge = _touches_edge(ours), _touches_edge(mjx)
    assert (edge != mjx_edge)[~two_edges].mean() <= SELDOM
    assert (mjx_edge & ~edge).mean() <= SELDOM
    assert np.abs(mjx[0] - ours[0])[mjx_edge & edge].max() < TOLERANCE
    alone = edge & mjx_edge & ~two_edges
    assert alone.mean() > 0.05
    assert np.abs(mjx[2] - ours[2])[alone, 0].max() < 1e-3
    apart = (mjx[1] - ours[1])[alone, 0]
    assert np.abs(apart * (1 - axis[alone])).max() < TOLERANCE
    assert np.abs(apart).max() < ALONG
    nearest = middle + np.clip(-middle, -poses[2], poses[2])
    np.testing.assert_allclose((ours[1][:, 0] - poses[4])[rows, along][alone], nearest[alone], atol=1e-5)


def test_in_the_middle_of_a_box_the_first_of_equal_faces_counts() -> None:
    random = np.random.default_rng(7)
    poses = list(_poses(random, "inside"))
    poses[0] = poses[4]
    _compare(random, tuple(poses), ("face",))


def test_of_spheres() -> None:
    random = np.random.default_rng(5)
    poses = list(_poses(random, "corner"))
    poses[2] = np.zeros(MANY, np.float32)
    _compare(random, tuple(poses))


def test_a_kernel_with_known_numbers_has_the_same_contacts() -> None:
    random = np.random.default_rng(6)
    angle = random.uniform(-np.pi, np.pi, MANY)
    poses = _poses(random, "edge", axis=np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1), planar=True)
    fixed = [jnp.asarray(p[0]) for p in (poses[2], poses[3], poses[5], poses[6])]

    def planar(centre: Any, axis: Any, place: Any) -> Any:
        centre, axis, place = (jnp.stack([v[0], jnp.zeros(()), v[1]]) for v in (centre, axis, place))
        return capsule_on_box(centre, axis, fixed[0], fixed[1], place, jnp.eye(3), fixed[3])

    given = [p[:, [0, 2]] for p in (poses[0], poses[1], poses[4])]
    for a, b in zip(
        jax.jit(jax.vmap(one_kernel(planar, "a planar contact")))(*given), jax.vmap(planar)(*given), strict=True
    ):
        differ = np.abs(np.asarray(a) - np.asarray(b)) > TOLERANCE
        assert differ.mean() < SELDOM
