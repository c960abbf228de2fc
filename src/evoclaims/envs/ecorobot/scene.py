"""Scenes: a robot among boxes, composed with MuJoCo's `MjSpec` and compiled once."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Final

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.core.foreign import Later
from evoclaims.envs.ecorobot import model_files
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.robots import Robot

SPACING: Final = 0.05
"""Spacing of the grid on which boxes within reach are counted, m; coarser if it would need more than `LINES` lines."""
LINES: Final = 500


def reach(model: mujoco.MjModel) -> float:
    """Return an upper bound on the distance from the torso's centre at which a robot can touch a box, m.

    Limbs are assumed stretched out straight. With a limb on a slide, or a separate body, it is infinity. The model has
    the robot alone, whose first body is the torso.
    """
    # For each body: a point about which it turns, and that point's largest distance from the torso's centre.
    pivots, furthest = np.zeros((model.nbody, 3)), np.zeros(model.nbody)
    for body in range(2, model.nbody):
        first, parent = model.body_jntadr[body], model.body_parentid[body]
        joints = slice(first, first + model.body_jntnum[body])
        kinds, anchors = model.jnt_type[joints], model.jnt_pos[joints]
        if not len(anchors):  # welded to its parent
            anchors = np.zeros((1, 3))
        start = np.zeros(3)
        mujoco.mju_rotVecQuat(start, anchors[0], model.body_quat[body])
        arm = np.linalg.norm(model.body_pos[body] + start - pivots[parent])
        arm += np.sum(np.linalg.norm(np.diff(anchors, axis=0), axis=1))
        unbound = parent == 0 or mujoco.mjtJoint.mjJNT_SLIDE in kinds
        furthest[body] = furthest[parent] + (np.inf if unbound else arm)
        pivots[body] = anchors[-1]
    geoms = touching(model)
    bodies = model.geom_bodyid[geoms]
    arms = np.linalg.norm(model.geom_pos[geoms] - pivots[bodies], axis=1)
    arms += model.geom_rbound[geoms] + model.geom_margin[geoms]
    return float(np.max(furthest[bodies] + arms, initial=0.0))


def touching(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the ids of a robot's geoms that can touch something."""
    return np.flatnonzero((model.geom_bodyid > 0) & ((model.geom_contype | model.geom_conaffinity) != 0))


def touched_at_once(model: mujoco.MjModel, boxes: Sequence[Box]) -> int:
    """Return an upper bound on the boxes a robot (`model`: alone) can touch at a time, anywhere.

    It is the most boxes within its reach, seen from above.
    """
    arm = reach(model)
    if not boxes or not np.isfinite(arm):
        return len(boxes)
    corners = np.concatenate([box.corners for box in boxes])
    low, high = corners.min(axis=0) - arm, corners.max(axis=0) + arm
    spacing = max(SPACING, float(np.max(high - low)) / LINES)
    within = arm + spacing / np.sqrt(2)  # adds the largest distance to a grid point
    axes = [np.arange(start, end + spacing, spacing) for start, end in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return int(np.max(np.sum([box.distance(points) <= within for box in boxes], axis=0)))


mjx = Later("mujoco.mjx")
_collisions = Later("mujoco.mjx._src.collision_driver")

WORLD_GROUP: Final = 1
"""The geom group of the scene's own geoms; sensors see it."""
NEWTON_STEPS: Final = 8
"""Most steps of the constraints' solver in a frame; it mostly reaches the minimum in four or fewer."""
CONTACTS: Final = frozenset(
    {
        *(("plane", kind) for kind in ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")),
        *(("sphere", kind) for kind in ("sphere", "capsule", "box")),
    }
)
"""Types of geoms between which a step finds the contacts that MuJoCo in C finds."""
_SPHERE: Final = int(mujoco.mjtGeom.mjGEOM_SPHERE)
Places = Mapping[str, Any]
"""What differs between boxes: arrays of MuJoCo's model by name, each [boxes, …]."""
GEOMS: Final = ("geom_pos", "geom_size", "geom_quat")
"""MuJoCo's arrays in which boxes may differ."""


@dataclass(frozen=True)
class Scene:
    """A robot and the boxes around it.

    Attributes:
        robot: who acts.
        boxes: the boxes in the world.

    Only as many boxes are simulated as the robot can touch at a time: before every step, these are moved to the places
    of the boxes nearest to the torso (`physics`). A row of fifteen obstacles costs no more than two. For a robot that
    touches with one sphere, all boxes cost less than finding the nearest.
    """

    robot: Robot
    boxes: tuple[Box, ...] = ()

    @cached_property
    def whole(self) -> mujoco.MjModel:
        """The model with all boxes, for plain MuJoCo: pictures and comparisons."""
        return _compiled(self.robot, self.boxes)

    @cached_property
    def near(self) -> int:
        """How many boxes are simulated: those in reach, or all if their surfaces differ; only places take turns."""
        alone = _compiled(self.robot, ())
        if len({box.surface for box in self.boxes}) > 1 or list(alone.geom_type[touching(alone)]) == [_SPHERE]:
            return len(self.boxes)
        return touched_at_once(alone, self.boxes)

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The model that is simulated."""
        return _compiled(self.robot, self.boxes[: self.near])

    @cached_property
    def mjx(self) -> Any:
        """The model that is simulated, in MJX's form; its arrays are on the host, so that programs embed them."""
        explicit = copy(self.model)
        explicit.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP  # `physics` integrates damping
        explicit.opt.enableflags = 0  # those that `features` allows compute more, but move nothing
        try:
            with jax.ensure_compile_time_eval():
                model = jax.device_get(mjx.put_model(explicit, impl="jax"))
        except (NotImplementedError, ValueError, AssertionError) as error:
            raise UserError(
                f"MJX cannot simulate the model of the robot {self.robot.name}: {str(error).removesuffix('.')}. Remove "
                "this from its file."
            ) from error
        # Erase the boxes that happen to come first, or programs would depend on them.
        geoms = box_geoms(self.model)
        blank = {name: np.array(getattr(model, name)) for name in self.turns}
        for array in blank.values():
            array[geoms] = 0.0
        return model.replace(**blank)

    @cached_property
    def blank(self) -> Any:
        """MJX's data for the model at the start; arrays on the host."""
        with jax.ensure_compile_time_eval():
            return jax.device_get(mjx.make_data(self.model, impl="jax"))

    @property
    def newton_steps(self) -> int:
        """Steps of the constraints' solver in a frame."""
        return min(int(self.model.opt.iterations), NEWTON_STEPS)

    @property
    def damps_implicitly(self) -> bool:
        """Whether a frame integrates the joints' damping implicitly, as MuJoCo does unless a file asks for less."""
        explicit = self.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EULERDAMP
        return not explicit and bool(self.model.dof_damping.any()) and not self.integrates_by_rk4

    @property
    def integrates_by_rk4(self) -> bool:
        """Whether a frame is one of Runge and Kutta's fourth order, not of Euler."""
        return bool(self.model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4)

    @cached_property
    def start(self) -> NDArray[np.float32]:
        """The robot's configuration before noise, shape [nq]."""
        configured = self.model.qpos0 if self.robot.start is None else self.robot.start
        return np.asarray(configured, np.float32)

    @property
    def seconds(self) -> float:
        """Simulated time of one environment step."""
        return float(self.model.opt.timestep) * self.robot.frames

    @cached_property
    def limbs(self) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """The places in qpos and qvel of four or more limbs of the torso that have the same joints; else empty."""
        model, alike = self.model, defaultdict(list)
        single = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
        for first in np.flatnonzero(model.body_parentid == 1):  # the torso's
            bodies = {int(first)}
            for body in range(first + 1, model.nbody):
                if int(model.body_parentid[body]) in bodies:
                    bodies.add(body)
            joints = np.flatnonzero(np.isin(model.jnt_bodyid, list(bodies)))
            if np.isin(model.jnt_type[joints], single).all():
                limb = model.jnt_qposadr[joints].astype(np.int64), model.jnt_dofadr[joints].astype(np.int64)
                alike[tuple(model.jnt_type[joints])].append(limb)
        limbs = max(alike.values(), key=len, default=[])
        return limbs if len(limbs) in (4, 8, 16, 32) and len(limbs[0][0]) else []

    @cached_property
    def turns(self) -> Places:
        """MuJoCo's arrays that differ between boxes of one surface, shape [boxes, …]; else empty."""
        if len({box.surface for box in self.boxes}) != 1:
            return {}
        arrays = {name: getattr(self.whole, name)[box_geoms(self.whole)] for name in GEOMS}
        return {name: array for name, array in arrays.items() if np.ptp(array, axis=0).any()}


@lru_cache(maxsize=64)
def scene(robot: Robot, boxes: tuple[Box, ...] = ()) -> Scene:
    """Return the scene, compiled at most once per process."""
    return Scene(robot, boxes)


def box_geoms(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the indices of the geoms that are the scene's boxes, in order."""
    return np.flatnonzero((model.geom_bodyid == 0) & (model.geom_group == WORLD_GROUP))


@lru_cache(maxsize=64)
def _compiled(robot: Robot, boxes: tuple[Box, ...]) -> mujoco.MjModel:
    """Build the model from the robot's own file, so that its defaults and total mass are unchanged.

    Raises:
        UserError: when there is no such model, or it has what `physics.act` does not simulate.
    """
    spec = model_files.read(robot.name, robot.xml)
    if any(geom.group == WORLD_GROUP for geom in spec.worldbody.geoms):
        raise UserError(
            f"The robot {robot.name} has a geom of the world in group {WORLD_GROUP}, which is the group of a task's "
            "boxes. Give its floor another group."
        )
    if robot.is_built_in:
        option = spec.option
        option.solver, option.iterations, option.ls_iterations = mujoco.mjtSolver.mjSOL_NEWTON, 1, 4
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
        # Bodies without joints are made parts of their parents, which saves a twentieth of an ant's step. What touches
        # stays apart: how hard a contact is depends on the body.
        welded = [body for body in spec.bodies if body.parent is not None and not body.joints]
        spec.compiler.fusestatic = not any(geom.contype or geom.conaffinity for body in welded for geom in body.geoms)
    # Remove Brax's own numbers: MJX (3.17) looks up its setting by the index of its name, not of its data, and would
    # read one of Brax's (the ant lost all contacts).
    for numeric in list(spec.numerics):
        spec.delete(numeric)
    spec.add_numeric(name="max_contact_points", data=[robot.contacts])
    for box in boxes:
        half = math.radians(box.angle) / 2
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=box.place,
            size=box.size,
            quat=[math.cos(half), 0.0, 0.0, math.sin(half)],
            # All bits: whatever collides with anything collides with boxes. The built-in robots need the first one.
            contype=0 if robot.is_built_in else -1,
            conaffinity=1 if robot.is_built_in else -1,
            friction=box.surface.friction,
            solref=box.surface.solref,
            solimp=box.surface.solimp,
            condim=3,
            margin=0.0,  # whatever the robot's file has for geoms that say none
            gap=0.0,
            group=WORLD_GROUP,
            rgba=[0.55, 0.5, 0.45, 1.0],
        )
    model = model_files.compiled(robot.name, spec)
    robot.require_fit(model)
    if not robot.is_built_in:
        model_files.require_unedited(robot.name, robot.xml, robot.body)
        _require_contacts(robot.name, model)
    return model


def _require_contacts(name: str, model: mujoco.MjModel) -> None:
    """Check that MJX finds the contacts of all geoms of a custom robot that can touch, as MuJoCo in C does.

    Raises:
        UserError: naming the two kinds of geoms.
    """
    geoms = {int(kind): kind.name.removeprefix("mjGEOM_").lower() for kind in mujoco.mjtGeom.__members__.values()}
    for one, other, _ in _collisions.geom_pairs(model):
        pair = tuple(geoms[int(model.geom_type[geom])] for geom in (one, other))
        if pair not in CONTACTS:
            boxes = set(box_geoms(model))
            names = [
                "of the task" if geom in boxes else model.geom(int(geom)).name or "without a name"
                for geom in (one, other)
            ]
            raise UserError(
                f"The robot {name} has a {pair[0]} ({names[0]}) and a {pair[1]} ({names[1]}) that can touch. For "
                "this pair MJX computes no contacts, or others than MuJoCo. Write another type of geom, such as "
                "spheres, or set contype and conaffinity so that the two never touch."
            )


def on_device(tree: Any) -> Any:
    """Turn the arrays of a host tree into jax arrays."""
    return jax.tree.map(jnp.asarray, tree)
