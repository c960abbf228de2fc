"""Which contacts a step keeps and what rows they make, against MJX's own driver on the same models and states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations_with_replacement, product
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from custom_robots import Texts
from numpy.typing import NDArray

from evoclaims.core.foreign import implicit_promotions
from evoclaims.envs.ecorobot import contacts, model_files, stones
from evoclaims.envs.ecorobot import scene as scene_module
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.robots import ANT, HALF_CHEETAH, HUMANOID, SIMPLE_ROB, Robot
from evoclaims.envs.ecorobot.scene import Scene, mjx, touching
from evoclaims.kernels import in_numpy

Numbers = NDArray[np.float64]
ROW = tuple(Box((x, 0.0), (0.25, 3.0), bottom=-0.75, top=0.25) for x in (9.0, 11.0, 13.0))
STATES = 200
SLACK = 1e-4
"""By how much contacts on a box's edge may differ: MJX divides by a squared length + 1e-6; faces' are the same."""


def _turned(random: np.random.Generator, count: int, most: float) -> Numbers:
    """Return quaternions around upright."""
    quaternions = np.array([1.0, 0.0, 0.0, 0.0]) + most * random.normal(size=(count, 4))
    unit: Numbers = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit


def _ants(random: np.random.Generator) -> Numbers:
    positions = np.tile(np.array(ANT.start), (STATES, 1))
    positions[:, :3] = random.uniform((-4.0, 0.0, 0.05), (4.0, 7.0, 0.5), (STATES, 3))
    corners = random.choice([-1.0, 1.0], (STATES // 2, 2)) * (4.0, 3.5) + (0.0, 3.5)
    positions[::2, :2] = corners + random.uniform(-0.9, 0.9, corners.shape)
    positions[:, 3:7] = _turned(random, STATES, 0.5)
    return positions + np.concatenate([np.zeros((STATES, 7)), 0.5 * random.normal(size=(STATES, 8))], axis=1)


def _cheetahs(random: np.random.Generator) -> Numbers:
    positions = 0.7 * random.normal(size=(STATES, 9))
    positions[:, :2] = random.uniform((8.0, -0.6), (14.0, 0.4), (STATES, 2))
    return positions


def _humanoids(random: np.random.Generator) -> Numbers:
    positions = Scene(HUMANOID).start + 0.3 * random.normal(size=(STATES, 24))
    positions[:, 2] = random.uniform(0.9, 1.3, STATES)
    positions[:, 3:7] = _turned(random, STATES, 0.1)
    return positions


def _rovers(random: np.random.Generator) -> Numbers:
    return np.concatenate([random.uniform((-4.0, 0.0), (4.0, 7.0), (STATES, 2)), np.zeros((STATES, 1))], axis=1)


Draw = Callable[[np.random.Generator], Numbers]
WORLDS: dict[str, tuple[Robot, tuple[Box, ...], Draw]] = {
    "ant": (ANT, stones.WALLS, _ants),
    "ant, three kept": (replace(ANT, contacts=3), stones.WALLS, _ants),
    "half_cheetah": (HALF_CHEETAH, ROW, _cheetahs),
    "half_cheetah, three kept": (replace(HALF_CHEETAH, contacts=3), ROW, _cheetahs),
    "humanoid": (HUMANOID, (), _humanoids),
    "simple_rob": (SIMPLE_ROB, stones.WALLS, _rovers),
    "simple_rob, one kept": (replace(SIMPLE_ROB, contacts=1), stones.WALLS, _rovers),
}
# In how many states more touch than are kept, at least.
CROWDED = {"ant, three kept": 20, "half_cheetah": 10, "half_cheetah, three kept": 40, "simple_rob, one kept": 1}


@dataclass(frozen=True)
class Kept:
    """Contacts of each state, [states, places, …], and the sums of their rows; of touching ones alone."""

    touches: NDArray[np.bool_]
    numbers: Numbers
    bodies: NDArray[np.int64]
    stiffness: Numbers
    force: Numbers

    def of(self, state: int) -> Numbers:
        """Return the distances, places and normals of a state's contacts, normals from the world to the robot."""
        touches = self.touches[state]
        numbers = self.numbers[state][touches].copy()
        numbers[self.bodies[state][touches][:, 1] == 0, 4:] *= -1.0
        return numbers


def _summed(jacobian: Any, stiffness: Any, reference: Any) -> tuple[Any, Any]:
    return jacobian.T @ (stiffness[:, None] * jacobian), jacobian.T @ (stiffness * reference)


def _both(robot: Robot, model: mujoco.MjModel, positions: Numbers, seed: int = 1) -> tuple[Kept, Kept, Any]:
    """Return ours and MJX's, and how many touch."""
    velocities = np.random.default_rng(seed).normal(size=(len(positions), model.nv))
    with jax.enable_x64(True):
        every, blank = mjx.put_model(model, impl="jax"), mjx.make_data(model, impl="jax")

        def kept(position: jax.Array, velocity: jax.Array) -> Any:
            with implicit_promotions():
                data = blank.replace(qpos=position, qvel=velocity)
                data = mjx.com_pos(every, mjx.kinematics(every, data))
                found = contacts._found(every, data)
                each = [contacts._kept(robot, pairs, every) for _, pairs in sorted(found.items())]
                columns = [
                    (c.touches, jnp.c_[c.distance - c.surfaces["includemargin"], c.place, c.frame[:, 0]], c.bodies)
                    for c in each
                ]
                rows = contacts.constraints(robot, every, data)
                ours = _summed(rows.mix @ rows.directions, rows.stiffness, rows.reference)
                data = mjx.collision(every, data)
                contact, theirs = data._impl.contact, mjx.make_constraint(every, data)._impl
                gap = contact.dist - contact.includemargin
                numbers = jnp.c_[gap, contact.pos, contact.frame[:, 0]]
                count = sum(jnp.sum(p.distance < p.surfaces["includemargin"]) for p in found.values())
                return (
                    *(jnp.concatenate(column) for column in zip(*columns, strict=True)),
                    *ours,
                    *(gap < 0, numbers, jnp.asarray(every.geom_bodyid)[contact.geom]),
                    *_summed(theirs.efc_J, theirs.efc_D, theirs.efc_aref),
                    count,
                )

        made = in_numpy(kept, positions, velocities)
    return Kept(*made[:5]), Kept(*made[5:10]), made[10]


@cache
def _of(name: str) -> tuple[Kept, Kept, Any]:
    robot, boxes, draw = WORLDS[name]
    return _both(robot, Scene(robot, boxes).whole, draw(np.random.default_rng(0)))


def _apart(ours: Kept, theirs: Kept) -> Numbers:
    """Return how far the nearest of the other's contacts is from any of one's, per state."""
    apart = np.zeros(len(ours.touches))
    for state in range(len(apart)):
        one, other = ours.of(state), theirs.of(state)
        assert len(one) == len(other)
        if len(one):
            between = np.abs(one[:, None] - other[None]).max(axis=2)
            apart[state] = max(between.min(axis=0).max(), between.min(axis=1).max())
    return apart


def _check_rows(ours: Kept, theirs: Kept, alike: NDArray[np.bool_]) -> None:
    """Check that the sums of rows are the same in the states whose contacts are `alike`."""
    for name in ("stiffness", "force"):
        one, other = (getattr(kept, name)[alike].reshape(alike.sum(), -1) for kept in (ours, theirs))
        assert np.max(np.abs(one - other).max(axis=1) / (1e-9 + np.abs(other).max(axis=1))) < 1e-9


@pytest.mark.parametrize("name", WORLDS)
def test_the_contacts_that_are_kept_are_mjx_s(name: str) -> None:
    ours, theirs, count = _of(name)
    robot, apart = WORLDS[name][0], _apart(ours, theirs)
    touched = theirs.touches.any(axis=1)
    assert touched.sum() >= 40
    assert np.max(apart) < SLACK
    assert np.mean(apart[touched] < 1e-10) > 0.5
    assert theirs.touches.sum(axis=1).max() == min(robot.contacts, count.max())
    assert np.sum(count > robot.contacts) >= CROWDED.get(name, 0)
    if name == "ant":  # a limb's second contact is behind the first ones of all
        assert np.sum(ours.touches[:, robot.contacts :].any(axis=1)) >= 10


@pytest.mark.parametrize("name", WORLDS)
def test_rows_are_mjx_s(name: str) -> None:
    ours, theirs, _ = _of(name)
    alike = _apart(ours, theirs) < 1e-11
    assert np.mean(alike & theirs.touches.any(axis=1)) > 0.2
    _check_rows(ours, theirs, alike)


CONDIMS = """
<mujoco>
  <option timestep="0.01" impratio="3"/>
  <default><geom margin="0.02" contype="1" conaffinity="2"/></default>
  <worldbody>
    <geom type="plane" size="9 9 1" condim="1" contype="2"/>
    <body pos="0 0 0.1">
      <freejoint/>
      <geom name="hull" type="sphere" size="0.1" condim="1" conaffinity="4"/>
      <body pos="0.3 0 0">
        <joint axis="0 1 0" range="-20 20"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.08" condim="4" friction="0.7 0.02 0.003"/>
      </body>
      <body pos="-0.3 0 0">
        <joint type="ball" range="0 30"/>
        <geom type="box" size="0.1 0.05 0.07" condim="6" friction="0.5 0.03 0.004" solref="0.03 0.7"/>
      </body>
      <body pos="0 -0.3 0">
        <joint axis="1 0 0"/>
        <geom type="cylinder" size="0.1 0.05" condim="3" priority="1" solimp="0.8 0.9 0.01 0.4 3"/>
      </body>
    </body>
    <body pos="0 0.22 0.1"><freejoint/><geom name="ball" type="sphere" size="0.12" contype="4" condim="4"/></body>
  </worldbody>
  <contact><pair geom1="ball" geom2="hull" condim="6" margin="0.04" friction="0.9 0.4 0.01 0.002 0.001"/></contact>
</mujoco>
"""
"""Contacts of all dimensions, of the robot with the floor, and of two of its bodies with each other."""


def test_rows_of_every_dimension_are_mjx_s(texts: Texts) -> None:
    robot, random = texts.robot(CONDIMS, contacts=2), np.random.default_rng(0)
    model = Scene(robot).whole
    positions = np.tile(model.qpos0, (STATES, 1)) + 0.02 * random.normal(size=(STATES, model.nq))
    for position in positions:
        mujoco.mj_normalizeQuat(model, position)
    ours, theirs, count = _both(robot, model, positions)
    assert np.max(_apart(ours, theirs)) < 1e-10
    assert np.sum(count > theirs.touches.sum(axis=1)) >= 40
    _check_rows(ours, theirs, theirs.touches.any(axis=1))
    dimensions = {int(model.geom_condim[geom]) for geom in range(model.ngeom)}
    assert dimensions == {1, 3, 4, 6}


@pytest.mark.parametrize("most", [1, 2, 3, 5])
@pytest.mark.parametrize("two_robots", [False, True])
def test_of_equally_deep_contacts_the_first_are_kept(most: int, two_robots: bool) -> None:
    """As MJX's do, and whatever has a place of its own: none is kept twice, none is lost."""
    random = np.random.default_rng(most)
    bodies = np.stack([np.full(9, int(two_robots)), [2, 2, 2, 3, 3, 3, 3, 4, 2]], axis=1)
    kinds = np.array([0, 0, 0, 0, 0, 1, 1, 0, 1])
    robot = replace(ANT, contacts=most, touching=1)
    distance = random.integers(-3, 2, (500, 9)).astype(np.float32)
    last = []

    def chosen(distance: jax.Array) -> jax.Array:
        with implicit_promotions():
            at, no_other = contacts._places(robot, bodies, kinds, distance, distance < 0)
        last.append(no_other)
        return at

    (place,) = in_numpy(chosen, distance)
    deepest = np.argsort(distance, axis=1, kind="stable")[:, :most]
    expected = np.any(deepest[:, :, None] == np.arange(9), axis=1) & (distance < 0)
    np.testing.assert_array_equal(place.sum(axis=1), expected)
    assert place.sum(axis=2).max() == 1
    assert len(last[0]) == place.shape[1]


def test_no_more_limbs_touch_twice_than_have_places() -> None:
    for sizes in (s for limbs in (1, 2, 3, 4) for s in combinations_with_replacement(range(1, 5), limbs)):
        kept = [(sum(k), sum(max(0, n - 1) for n in k)) for k in product(*(range(n + 1) for n in sizes))]
        for most in range(1, sum(sizes) + 1):
            exact = max(seconds for count, seconds in kept if count <= most)
            assert contacts._seconds(np.array(sizes), most) == exact


def _frames(model: mujoco.MjModel, positions: Numbers) -> tuple[Numbers, int]:
    """Return where C MuJoCo's frames from these positions lead, and in how many something touched."""
    data, random, touched = mujoco.MjData(model), np.random.default_rng(2), 0
    after = []
    for position in positions:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = position, random.normal(size=model.nv)
        data.ctrl[:] = random.uniform(-1.0, 1.0, model.nu)
        mujoco.mj_step(model, data)
        touched += data.ncon > 0
        after.append(np.concatenate([data.qpos, data.qvel * model.opt.timestep]))
    return np.array(after), touched


def test_an_ant_moves_as_before_its_bodies_without_joints_were_merged(monkeypatch: pytest.MonkeyPatch) -> None:
    positions = _ants(np.random.default_rng(3))
    merged = Scene(ANT, stones.WALLS).whole
    compiled = model_files.compiled

    def unmerged(name: str, spec: Any) -> mujoco.MjModel:
        spec.compiler.fusestatic = False
        return compiled(name, spec)

    monkeypatch.setattr(model_files, "compiled", unmerged)
    apart = scene_module._compiled.__wrapped__(ANT, stones.WALLS)
    assert apart.nbody == merged.nbody + 4
    (one, touched), (other, _) = _frames(merged, positions), _frames(apart, positions)
    assert touched >= 40
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12)


def test_a_humanoid_s_feet_stay_bodies_of_their_own() -> None:
    """They touch the floor, and how hard a contact is depends on the body."""
    model = Scene(HUMANOID).whole
    assert model.nbody == mujoco.MjModel.from_xml_path(HUMANOID.file).nbody
    assert set(model.body_jntnum[np.unique(model.geom_bodyid[touching(model)])]) == {0}
