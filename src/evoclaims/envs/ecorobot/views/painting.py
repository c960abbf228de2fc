"""Paints on matplotlib's axes: bodies, the ground with its marks, and paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.drawing import optional
from evoclaims.envs.ecorobot.maze import Maze
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.views.motion import Mark, Motion, at_start, marks

TorsoPath = NDArray[np.floating]
"""Centres of the torso in an episode, shape [steps, 3], m; finite."""
Plane = tuple[int, int]
"""The coordinates a picture shows, across and up."""

FROM_ABOVE: Final[Plane] = (0, 1)
FROM_THE_SIDE: Final[Plane] = (0, 2)

WALL, ROBOT, STONE, TARGET, GROUND, INK = "#9a938a", "#2f6fb5", "#f5c04a", "#d1495b", "#e6e4df", "#333333"
PATHS: Final = ("#1b9e77", "#7570b3", "#e7298a", "#66a61e", "#a6761d", "#0072b2", "#8c2d04", "#4d4d4d")
"""Colours of paths; they repeat after eight."""
MARGIN: Final = 0.5
"""Ground shown around everything, m."""
OPEN: Final = 2.0
"""Ground shown around a robot without walls, m."""
BELOW: Final = 0.3
"""How far below the ground a view from the side reaches, m."""


def plane_of(task: RobotTask) -> Plane:
    """Return a task's view: from above if its robot moves over the ground, else from the side."""
    return FROM_ABOVE if task.robot.free_coordinates > 1 else FROM_THE_SIDE


def paint_robot(axis: Any, motion: Motion, frame: int, plane: Plane, zorder: float) -> list[Any]:
    """Paint the robot as it is in one frame; return what was added."""
    style = {"facecolor": ROBOT, "edgecolor": "white", "linewidth": 0.5, "zorder": zorder}
    return _paint_shapes(axis, motion, frame, plane, True, style)


def paint_boxes(axis: Any, motion: Motion, plane: Plane) -> None:
    """Paint the static shapes."""
    _paint_shapes(axis, motion, 0, plane, False, {"facecolor": WALL, "linewidth": 0.0, "zorder": 2})


def _paint_shapes(
    axis: Any, motion: Motion, frame: int, plane: Plane, moving: bool, style: Mapping[str, Any]
) -> list[Any]:
    """Paint the moving or the static shapes; return what was added."""
    patches = optional("matplotlib.patches")
    (depth,) = {0, 1, 2} - set(plane)
    # What is nearer to the viewer comes last: views look down, and along +y.
    order = np.argsort(motion.places[frame, :, depth] * (1.0 if depth == 2 else -1.0), kind="stable")
    outlines = [motion.outline(i, frame, plane) for i in map(int, order) if motion.shapes[i].moves == moving]
    return [axis.add_patch(patches.Polygon(outline, **style)) for outline in outlines]


def paint_ground(axis: Any, task: RobotTask, paths: Sequence[TorsoPath]) -> None:
    """Paint walls and marks from above, and set the axes: metres, equal scales."""
    paint_boxes(axis, at_start(task), FROM_ABOVE)
    patches = optional("matplotlib.patches")
    for mark in marks(task):
        colour = TARGET if mark.target else STONE
        axis.add_patch(patches.Circle(mark.place, mark.within, facecolor=colour, alpha=0.3, linewidth=0, zorder=1))
        axis.add_line(mark_sign(mark, zorder=5))
        ink = "white" if mark.target else INK
        axis.text(*mark.place, mark.label, ha="center", va="center_baseline", fontsize=7.5, color=ink, zorder=6)
    low, high = ground_shown(task, paths)
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x, m", ylabel="y, m")


def paint_elites(axis: Any, task: Maze, fitnesses: NDArray[np.floating]) -> Any:
    """Paint the fitness of each elite over its cell, shape [cells along x, along y], -inf for none; return the mesh."""
    edges = [np.linspace(*ends, count + 1) for ends, count in zip(task.area, fitnesses.shape, strict=True)]
    shown = np.ma.masked_where(~np.isfinite(fitnesses), fitnesses)
    return axis.pcolormesh(*edges, shown.T, cmap="viridis", zorder=0.5)


def ground_shown(task: RobotTask, paths: Sequence[TorsoPath]) -> NDArray[np.float64]:
    """Return the lowest and highest x and y, shape [2, 2], m, of everything seen from above."""
    start = at_start(task)
    walls = [start.outline(i, 0, FROM_ABOVE) for i, shape in enumerate(start.shapes) if not shape.moves]
    around = [] if isinstance(task, Maze) else [start.torso[:, :2] - OPEN, start.torso[:, :2] + OPEN]
    points = np.concatenate([*walls, *around, *(path[:, :2] for path in paths)]).astype(np.float64)
    return np.stack([points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN])


def paint_earth(axis: Any, motion: Motion) -> None:
    """Paint the static shapes from the side, and the ground over the parts below it."""
    paint_boxes(axis, motion, FROM_THE_SIDE)
    axis.axhspan(-BELOW, 0.0, color=GROUND, zorder=2.2)
    axis.set(aspect="equal", ylabel="z, m")


def paint_paths(axis: Any, paths: Sequence[TorsoPath], plane: Plane) -> None:
    """Paint paths as lines, and their ends."""
    for i, path in enumerate(paths):
        across, up = path[:, plane[0]], path[:, plane[1]]
        colour = PATHS[i % len(PATHS)]
        axis.plot(across, up, color=colour, linewidth=1.1, alpha=0.85, zorder=3)
        axis.plot(across[-1:], up[-1:], "s", color=colour, ms=4.5, mec="white", mew=0.6, zorder=7)


def mark_sign(mark: Mark, zorder: float = 0.0) -> Any:
    """Return a mark's symbol: a disc for its number, or a cross."""
    colour = TARGET if mark.target else STONE
    style = {"marker": "o", "mec": INK} if mark.label else {"marker": "X", "mec": "white"}
    across, up = mark.place
    line = optional("matplotlib.lines").Line2D
    return line([across], [up], linestyle="", color=colour, ms=11, zorder=zorder, **style)
