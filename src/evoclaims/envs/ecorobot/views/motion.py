"""Bodies in space over time: every geom's pose, computed by plain MuJoCo from generalized positions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch
from typing import Final, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.envs.ecorobot.stones import SteppingStones

Kind = Literal["sphere", "capsule", "ellipsoid", "cylinder", "box"]

KINDS: Final[dict[int, Kind]] = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
}
"""The shapes shown, by MuJoCo's number; each drawer draws the floor, a plane, itself."""


@dataclass(frozen=True)
class Shape:
    """A geom.

    Attributes:
        kind: its form.
        radii: along its x, y and z axis, m; half-sizes for a box, and for z of a cylinder.
        reach: half the length of a capsule's cylinder, along z, m; 0 for all others.
        moves: whether it is part of the robot.
    """

    kind: Kind
    radii: tuple[float, float, float]
    reach: float
    moves: bool


@dataclass(frozen=True)
class Motion:
    """Shapes and their poses in each frame.

    Attributes:
        shapes: the geoms, in the order of the model.
        places: centres, shape [frames, shapes, 3], m.
        turns: rotations as unit quaternions (w, x, y, z), shape [frames, shapes, 4].
        torso: centre of the torso, shape [frames, 3], m.
        seconds: simulated time from one frame to the next.
    """

    shapes: tuple[Shape, ...]
    places: NDArray[np.float32]
    turns: NDArray[np.float32]
    torso: NDArray[np.float32]
    seconds: float

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.places)

    def outline(self, shape: int, frame: int, axes: tuple[int, int]) -> NDArray[np.float64]:
        """Return the convex polygon, shape [corners, 2], that a shape covers, seen along the third axis."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, self.turns[frame, shape].astype(np.float64))
        points = _surface(self.shapes[shape]) @ matrix.reshape(3, 3).T + self.places[frame, shape]
        flat = points[:, axes]
        polygon: NDArray[np.float64] = flat[ConvexHull(flat).vertices]
        return polygon

    def every(self, stride: int) -> Motion:
        """Return every `stride`-th frame, from the first."""
        return Motion(
            self.shapes, self.places[::stride], self.turns[::stride], self.torso[::stride], self.seconds * stride
        )


def motion(scene: Scene, positions: NDArray[np.floating]) -> Motion:
    """Return the pose of every geom.

    Args:
        scene: whose geoms; with all boxes, even those that take turns in the simulation.
        positions: generalized positions, shape [frames, nq]; the first frame that is not finite, and all later ones,
            are dropped.

    Raises:
        UserError: when no frame is finite.
    """
    finite = np.isfinite(positions).all(axis=1)
    count = len(finite) if finite.all() else int(np.argmin(finite))
    if count == 0:
        raise UserError("There is no motion to show: the robot's positions are not finite from the first step on.")
    model = scene.whole
    data = mujoco.MjData(model)
    shown = [i for i in range(model.ngeom) if int(model.geom_type[i]) in KINDS]
    places = np.empty((count, len(shown), 3), np.float32)
    turns, torso = np.empty((count, len(shown), 4), np.float32), np.empty((count, 3), np.float32)
    turn = np.empty(4)
    for frame in range(count):
        data.qpos[:] = positions[frame]
        mujoco.mj_kinematics(model, data)
        places[frame], torso[frame] = data.geom_xpos[shown], data.xpos[1]
        for i, geom in enumerate(shown):
            mujoco.mju_mat2Quat(turn, data.geom_xmat[geom])
            turns[frame, i] = turn
    return Motion(tuple(_shape(model, i) for i in shown), places, turns, torso, scene.seconds)


def at_start(task: RobotTask) -> Motion:
    """Return one frame: the robot where it starts, before noise."""
    position = task.scene.start.copy()
    if task.start is not None:
        position[:2] = task.start
    return motion(task.scene, position[None])


def _shape(model: mujoco.MjModel, geom: int) -> Shape:
    """Return a geom's shape; MuJoCo leaves unused sizes at 0."""
    kind, (a, b, c) = KINDS[int(model.geom_type[geom])], map(float, model.geom_size[geom])
    radii = {"sphere": (a, a, a), "capsule": (a, a, a), "cylinder": (a, a, b)}.get(kind, (a, b, c))
    return Shape(kind, radii, b if kind == "capsule" else 0.0, bool(model.geom_bodyid[geom] != 0))


def _surface(shape: Shape) -> NDArray[np.float64]:
    """Return surface points of a shape, in its own axes, shape [points, 3]; their hull is the shape."""
    if shape.kind == "box":
        corners = np.stack(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0]), axis=-1).reshape(-1, 3)
        return np.asarray(corners * np.array(shape.radii), np.float64)
    around = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    up = np.zeros(1) if shape.kind == "cylinder" else np.linspace(0.0, np.pi / 2, 7)
    across, high = np.cos(up)[:, None], np.ones(1) if shape.kind == "cylinder" else np.sin(up)
    half = np.stack(
        [across * np.cos(around), across * np.sin(around), np.broadcast_to(high[:, None], (len(up), 24))], axis=-1
    )
    half = half.reshape(-1, 3) * np.array(shape.radii) + np.array([0.0, 0.0, shape.reach])
    points: NDArray[np.float64] = np.concatenate([half, half * np.array([1.0, 1.0, -1.0])])
    return points


@dataclass(frozen=True)
class Mark:
    """A place to reach.

    Attributes:
        place: x and y, m.
        within: how near the torso's centre must come, m.
        label: its number; empty if there is only one.
        target: whether the task ends there.
    """

    place: tuple[float, float]
    within: float
    label: str = ""
    target: bool = False


@singledispatch
def marks(task: RobotTask) -> tuple[Mark, ...]:
    """Return the marks of a task, the target last; task classes with marks register here."""
    return ()


@marks.register
def _of_stepping_stones(task: SteppingStones) -> tuple[Mark, ...]:
    last = len(task.stones)
    return tuple(Mark(place, task.within, str(i), i == last) for i, place in enumerate(task.stones, start=1))


@marks.register
def _of_deceptive_maze(task: DeceptiveMaze) -> tuple[Mark, ...]:
    return (Mark(task.target, task.plan.within, target=True),)
