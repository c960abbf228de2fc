"""Whether a robot is simulated as its file says: frames of our step beside frames of MuJoCo in C.

A custom robot's model may have what a step does not simulate, or what MJX computes in another way. The robot is
refused then, before anything is trained. A built-in robot, whose model is known, shows whether a release of MJX
simulates what the release of MuJoCo does. What has passed is remembered beside the compiled programs, so that a model
is checked once a machine and release.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Final

import jax
import mujoco
import numpy as np
from numpy.typing import NDArray

from evoclaims import kernels
from evoclaims.core.canonical import as_plain, content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.files import doubt, make_private, read_file, read_private, write_atomically
from evoclaims.core.provenance import versions
from evoclaims.envs.ecorobot import physics
from evoclaims.envs.ecorobot.physics import Body
from evoclaims.envs.ecorobot.pose import torso
from evoclaims.envs.ecorobot.robots import Robot
from evoclaims.envs.ecorobot.scene import Scene, touching
from evoclaims.kernels import in_numpy

Numbers = NDArray[np.float64]

TOLERANCE: Final = 1e-8
"""Largest difference of a velocity after one frame, and of a position, in float64: a share of 1 plus the largest."""
MOST: Final = 0.8
"""Share of frames in which a built-in robot must move as MuJoCo says.

With MuJoCo 3.17 they are 0.89 to 1: where capsules touch the ground, MJX finds other points than MuJoCo in C.
"""
RUNS: Final = 12
"""Runs with random motors from which frames are taken."""
FRAMES: Final = 240
"""Frames of a run."""
EVERY: Final = 10
"""How often a frame is compared, and the motors change."""
EDGE: Final = 1e-9
"""Contacts this near to beginning begin or do not by rounding errors, m."""
FASTEST: Final = 1e3
"""Beyond such velocities a run has diverged, m/s or rad/s."""


@dataclass(frozen=True)
class Frames:
    """What frames of MuJoCo in C started from, and where they led; the leading axis counts frames.

    `pose` is the torso's place and rotation at the start of the frame; `contacts` counts the points that touch.
    """

    position: Numbers
    velocity: Numbers
    acceleration: Numbers
    control: Numbers
    next_position: Numbers
    next_velocity: Numbers
    pose: Numbers
    contacts: NDArray[np.int64]


@lru_cache(maxsize=64)
def require_fidelity(scene: Scene) -> None:
    """Check a custom robot among its boxes, in float64, once a machine, before it is planned or simulated.

    Raises:
        UserError: when a frame differs from MuJoCo's by more than `TOLERANCE`.
    """
    if not scene.robot.is_built_in:
        _check_once(scene)


@lru_cache(maxsize=64)
def require_likeness(robot: Robot) -> None:
    """Check a built-in robot, alone on the ground, in float64, once a machine, before it is simulated.

    Raises:
        UserError: when fewer than `MOST` of the frames are MuJoCo's.
    """
    if robot.is_built_in:
        _check_once(Scene(robot, ()))


def _check_once(scene: Scene) -> None:
    """Check a scene that has not passed on this machine."""
    record = _record(scene)
    if record is not None and _has_passed(record):
        return
    check(scene)
    if record is not None:
        with contextlib.suppress(UserError):  # a full or read-only disk costs time alone
            write_atomically(record, record.name.encode(), mode=0o600)


def _record(scene: Scene) -> Path | None:
    """Return the file that says that a scene has passed; None where another user could write it."""
    config: Any = jax.config  # defines its attributes at run time
    if config.jax_compilation_cache_dir is None:
        return None
    folder = Path(config.jax_compilation_cache_dir) / "robots"
    try:
        make_private(folder)
        if doubt(folder.parent) or doubt(folder):
            return None
    except OSError:  # a read-only disk, or a file in its place
        return None
    key = {"robot": as_plain(scene.robot), "boxes": as_plain(scene.boxes), "versions": versions(), "code": _code()}
    return folder / content_hash(key)


def _has_passed(record: Path) -> bool:
    try:
        return read_private(record) == record.name.encode()
    except OSError:
        return False


@cache
def _code() -> str:
    """Return a hash of the code that simulates and checks."""
    files = [*Path(__file__).parent.glob("*.py"), *Path(kernels.__file__).parent.glob("trace/*.py")]
    return hashlib.sha256(b"".join(map(read_file, sorted(files)))).hexdigest()


def check(scene: Scene) -> None:
    """Compare frames of a robot among its boxes with MuJoCo's.

    Raises:
        UserError: as `require_fidelity` and `require_likeness` do.
    """
    # A thread of its own, since this is called while a program is traced.
    with ThreadPoolExecutor(1) as own:
        off, made, ours = own.submit(_differences, scene).result()
    wrong = ~(off <= TOLERANCE)  # NaN is wrong, too
    robot = scene.robot
    if wrong.mean() <= (1 - MOST if robot.is_built_in else 0.0):
        return
    if robot.is_built_in:
        made_with = versions()
        raise UserError(
            f"The robot {robot.name} does not move as MuJoCo in C says: of {len(wrong)} random frames "
            f"{np.sum(~wrong)} are the same, and with MuJoCo 3.17 at least 256. MuJoCo is {made_with['mujoco']} and "
            f"MJX {made_with['mujoco-mjx']}. Install other versions of mujoco and mujoco-mjx, or report it."
        )
    worst = int(np.nanargmax(np.where(wrong, np.nan_to_num(off, nan=np.inf), -1.0)))
    crowded = wrong & (made.contacts > robot.contacts)
    if crowded.any() and not (wrong & ~crowded).any():
        raise UserError(
            f"The robot {robot.name} touches at {made.contacts[crowded].max()} points at a time, but only "
            f"contacts={robot.contacts} of them are simulated. Write Robot(…, contacts={made.contacts.max()}) or "
            "more."
        )
    raise UserError(
        f"The robot {robot.name} is not simulated as its file says. In {np.sum(wrong)} of {len(wrong)} random states "
        f"a frame differs from MuJoCo's own by up to {off[worst]:.2g} times (1 plus the largest velocity), in a "
        f"state with {made.contacts[worst]} contacts; {TOLERANCE:g} is allowed. {_cause(scene, made, ours, worst)}"
    )


def _cause(scene: Scene, made: Frames, ours: Numbers, row: int) -> str:
    """Return why a frame differs, as far as it is known, and what to do."""
    to_minimum = copy(scene.whole)
    to_minimum.opt.tolerance = 0.0
    theirs, _ = _stepped(to_minimum, made, row)
    if _off(ours[row, : len(theirs)], theirs) <= TOLERANCE:
        return (
            f"MuJoCo's solver stops before the minimum there (tolerance={scene.whole.opt.tolerance:g}), and a step "
            'here does not. Write <option tolerance="1e-14"/>.'
        )
    wider, narrower = copy(scene.whole), copy(scene.whole)
    for model, by in ((wider, EDGE), (narrower, -EDGE)):
        model.geom_margin += by
        model.pair_margin += by
    (far, met), (near, sure) = _stepped(wider, made, row), _stepped(narrower, made, row)
    if met != sure and not _off(far, near) <= TOLERANCE:
        one, other = (scene.whole.geom(geom).name or "without a name" for geom in min((met - sure) or (sure - met)))
        return (
            f"MuJoCo's own frame is decided by rounding errors there, since the geoms {one} and {other} are exactly as "
            "far apart as where contact begins. Move or resize one of them, or set contype and conaffinity so that "
            "the two never touch."
        )
    return (
        "Remove from the file what MJX computes in another way, such as contacts of meshes, or a solver that stops "
        "early (iterations)."
    )


def _stepped(model: mujoco.MjModel, made: Frames, row: int) -> tuple[Numbers, Counter[tuple[int, int]]]:
    """Return where a model goes from a frame's start, and the geoms of each contact at the start."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = made.position[row], made.velocity[row]
    data.qacc_warmstart[:], data.ctrl[:] = made.acceleration[row], made.control[row]
    mujoco.mj_fwdPosition(model, data)
    met = Counter((int(one), int(other)) for one, other in data.contact.geom)
    mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel]), met


def _off(ours: Numbers, theirs: Numbers) -> Any:
    """Return the largest difference of each row, as a share of 1 plus the largest number."""
    return np.max(np.abs(ours - theirs), axis=-1) / (1.0 + np.max(np.abs(theirs), axis=-1))


def _differences(scene: Scene) -> tuple[Numbers, Frames, Numbers]:
    """Return how far each frame of our step is from MuJoCo's, MuJoCo's, and ours in one row each."""
    made = frames_of(scene)
    try:
        cpu = jax.local_devices(backend="cpu")[0]
    except RuntimeError:
        cpu = jax.local_devices()[0]
    with jax.enable_x64(True), jax.default_device(cpu):
        world = Scene(scene.robot, scene.boxes)  # with arrays of float64

        def frame(position: Any, velocity: Any, acceleration: Any, control: Any) -> Any:
            body = Body(position=position, velocity=velocity, acceleration=acceleration)
            moved, pose = physics._frame(world, body, control, world.turns), torso(world, position)
            return moved.position, moved.velocity, pose.place, pose.rotation.reshape(9)

        # To compile what runs once would take five times as long as all the rest.
        ours = np.concatenate(in_numpy(frame, made.position, made.velocity, made.acceleration, made.control), axis=1)
    theirs = np.concatenate([made.next_position, made.next_velocity, made.pose], axis=1)
    return _off(ours, theirs), made, ours


def frames_of(scene: Scene) -> Frames:
    """Return frames of MuJoCo in C, with the file's options, from runs with random motors."""
    model, random = scene.whole, np.random.default_rng(0)
    data = mujoco.MjData(model)
    limited = model.actuator_ctrllimited.astype(bool)[:, None]
    low, high = np.where(limited, model.actuator_ctrlrange, np.array([-1.0, 1.0])).T
    rows = []
    for run in range(RUNS):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = scene.start + 0.1 * random.standard_normal(model.nq)
        mujoco.mj_normalizeQuat(model, data.qpos)
        if scene.boxes:
            _beside(scene, data, random)
        if run % 2:
            _to_the_floor(model, data)
        data.qvel[:] = random.standard_normal(model.nv)
        for frame in range(FRAMES):
            recorded = frame % EVERY == 0
            if recorded:
                # Half of the runs ask for more than the motors' range.
                data.ctrl[:] = (low + high) / 2 + (1 + run % 2) * random.uniform(-0.5, 0.5, model.nu) * (high - low)
                mujoco.mj_kinematics(model, data)
                pose = np.concatenate([data.xpos[1], data.xmat[1]])
                before = [data.qpos.copy(), data.qvel.copy(), data.qacc_warmstart.copy(), data.ctrl.copy()]
            mujoco.mj_step(model, data)
            if not np.abs(data.qvel).max(initial=0.0) < FASTEST:  # NaN, too
                break
            if recorded:
                touching = np.count_nonzero(data.contact.efc_address >= 0)
                rows.append([*before, data.qpos.copy(), data.qvel.copy(), pose, touching])
    if not rows:
        raise UserError(
            f"The robot {scene.robot.name} diverges in its first frame, in MuJoCo itself. Write a smaller timestep."
        )
    return Frames(*(np.array(column) for column in zip(*rows, strict=True)))


def _beside(scene: Scene, data: mujoco.MjData, random: np.random.Generator) -> None:
    """Move a robot beside one of the boxes, as far as its torso's joints allow."""
    model, robot = scene.whole, scene.robot
    box = scene.boxes[random.integers(len(scene.boxes))]
    side = random.uniform(-1.0, 1.0, 2)
    side /= np.max(np.abs(side))
    outside = side * (np.array(box.half_size) + robot.torso_radius * random.uniform(0.5, 1.5))
    target = np.array(box.centre) + box.rotation[:2, :2] @ outside
    mujoco.mj_kinematics(model, data)
    _move(model, data, np.append(target - data.xpos[1][:2], 0.0))


def _to_the_floor(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Let down a robot that starts above the floor: it would fall for the whole run, and touch with nothing."""
    mujoco.mj_kinematics(model, data)
    geoms = touching(model)
    lowest = np.min(data.geom_xpos[geoms, 2] - model.geom_rbound[geoms], initial=np.inf)
    if 0.0 < lowest < np.inf:
        _move(model, data, np.array([0.0, 0.0, -lowest]))


def _move(model: mujoco.MjModel, data: mujoco.MjData, by: NDArray[np.float64]) -> None:
    """Move a robot by a vector, as far as its torso's joints allow."""
    for joint in range(model.body_jntadr[1], model.body_jntadr[1] + model.body_jntnum[1]):
        at = model.jnt_qposadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[at : at + 3] += by
        elif model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
            data.qpos[at] += by @ data.xaxis[joint]
