"""Plain MuJoCo, the C program: what ours is compared with."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import jax
import mujoco
import numpy as np
from numpy.typing import NDArray

from evoclaims.envs.ecorobot.robots import ROBOTS
from evoclaims.envs.ecorobot.scene import Scene

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """What every frame of a run started from, and where it led; the leading axis counts frames.

    `boxed` says whether a capsule touched a box, which MJX's collision functions work out in another way.
    """

    position: Numbers
    velocity: Numbers
    acceleration: Numbers
    control: Numbers
    next_position: Numbers
    next_velocity: Numbers
    contacts: NDArray[np.int64]
    boxed: NDArray[np.bool_]


def record(scene: Scene, frames: int, at: tuple[float, ...] = (), seed: int = 0) -> Record:
    """Drive a robot from `at` (its first positions) with motors that change every ten frames."""
    model, random = scene.whole, np.random.default_rng(seed)
    data = mujoco.MjData(model)
    data.qpos[:] = scene.start
    data.qpos[: len(at)] = at
    data.qvel[:] = 0.1 * random.standard_normal(model.nv)
    # MuJoCo's own line search stops after four trials: let it go on, to the minimum that ours works out.
    iterations, tolerance = model.opt.ls_iterations, model.opt.ls_tolerance
    model.opt.ls_iterations, model.opt.ls_tolerance = 50, 1e-10
    rows = []
    for frame in range(frames):
        if frame % 10 == 0:
            data.ctrl[:] = random.uniform(-1.0, 1.0, model.nu)
        before = [data.qpos.copy(), data.qvel.copy(), data.qacc_warmstart.copy(), data.ctrl.copy()]
        mujoco.mj_step(model, data)
        rows.append([*before, data.qpos.copy(), data.qvel.copy(), data.ncon, _capsule_on_box(model, data)])
    model.opt.ls_iterations, model.opt.ls_tolerance = iterations, tolerance
    return Record(*(np.array(column) for column in zip(*rows, strict=True)))


def chained(records: Iterable[Record]) -> Record:
    """Return runs one after the other."""
    return Record(*(np.concatenate(columns) for columns in zip(*(vars(one).values() for one in records), strict=True)))


def quickly_compiled(function: Callable[..., Any]) -> Any:
    """Return a jitted function that XLA optimizes little: what runs once is not worth twice the compilation."""
    return jax.jit(function, compiler_options={"xla_backend_optimization_level": 0})


def random_positions(model: mujoco.MjModel, count: int, seed: int = 0) -> Numbers:
    """Return configurations with unit quaternions, shape [count, nq]."""
    positions = np.random.default_rng(seed).normal(size=(count, model.nq))
    for position in positions:
        mujoco.mj_normalizeQuat(model, position)
    return positions


def alone(robot: str) -> mujoco.MjModel:
    """Return the robot's own model, as its file says."""
    return mujoco.MjModel.from_xml_path(ROBOTS[robot].file)


def _capsule_on_box(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    pair = {int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_BOX)}
    return any(set(model.geom_type[contact.geom].tolist()) == pair for contact in data.contact)
