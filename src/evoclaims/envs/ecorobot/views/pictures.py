"""Pictures of ecorobot, drawn by matplotlib without a display; the same input gives the same bytes."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.drawing import optional, own_style, saved
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


ROW: Final = 15.0
"""Approximate length of a course in one row, m."""
ROWS: Final = 5
"""Most rows of a course: longer ones are drawn smaller."""
WIDTH: Final = {FROM_ABOVE: 7.5, FROM_THE_SIDE: 11.0}
"""Of the drawing, inches."""


def draw(task: RobotTask, paths: Sequence[NDArray[np.floating]], title: str, file_format: str) -> bytes:
    """Draw a task's ground from above, or its course from the side, and the torso's paths; return the file's contents.

    Args:
        task: whose robot is shown to scale where it starts.
        paths: of the torso's centre, shapes [steps, 3], m; none for the task alone. Non-finite places are left out.
        title: what to write above.
        file_format: "svg" or "png".

    Raises:
        UserError: for another format, or when matplotlib is not installed.
    """
    seen = [path[np.isfinite(path).all(axis=1)] for path in paths]
    with own_style():
        figure = _course(task, seen, title) if plane_of(task) == FROM_THE_SIDE else _ground(task, seen, title)
        return saved(figure, file_format, bbox_inches="tight", pad_inches=0.12)


def _ground(task: RobotTask, paths: Sequence[TorsoPath], title: str) -> Any:
    low, high = ground_shown(task, paths)
    size = (high - low) * WIDTH[FROM_ABOVE] / (high - low).max() + np.array([1.0, 1.9])
    figure = _figure(size)
    axis = figure.add_subplot()
    paint_ground(axis, task, paths)
    paint_robot(axis, at_start(task), 0, FROM_ABOVE, zorder=2.5)
    paint_paths(axis, paths, FROM_ABOVE)
    axis.set_title(title, fontsize=10)
    _legend(figure, task, len(paths), columns=2)
    return figure


def _course(task: RobotTask, paths: Sequence[TorsoPath], title: str) -> Any:
    start = at_start(task)
    covered = np.concatenate([start.torso, *paths])
    low = float(covered[:, 0].min()) - 1.5
    ends = [box.centre[0] + box.half_size[0] for box in task.boxes]
    high = max([float(covered[:, 0].max()), *ends, low + ROW - 1.0]) + 1.0
    rows = min(math.ceil((high - low) / ROW), ROWS)
    length = (high - low) / rows
    top = max([1.0, float(covered[:, 2].max()), *(box.top for box in task.boxes)]) + 0.2
    width = WIDTH[FROM_THE_SIDE]
    figure = _figure((width + 1.0, rows * (width / length * (top + BELOW) + 0.45) + 1.0))
    axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for row, axis in enumerate(axes):
        paint_earth(axis, start)
        for number, box in enumerate(task.boxes, start=1):
            place = (box.centre[0], -BELOW / 2)
            label = f"{number}: {box.top:g} m"
            axis.text(*place, label, ha="center", va="center", fontsize=6.5, zorder=5, clip_on=True)
        paint_robot(axis, start, 0, FROM_THE_SIDE, zorder=2.5)
        paint_paths(axis, paths, FROM_THE_SIDE)
        axis.set(xlim=(low + row * length, low + (row + 1) * length), ylim=(-BELOW, top))
    axes[0].set_title(title, fontsize=10)
    axes[-1].set_xlabel("x, m")
    _legend(figure, task, len(paths), columns=3)
    return figure


def _figure(size: Any) -> Any:
    return optional("matplotlib.figure").Figure(figsize=size, dpi=130, layout="compressed")


def _legend(figure: Any, task: RobotTask, paths: int, columns: int) -> None:
    lines, patches = optional("matplotlib.lines"), optional("matplotlib.patches")
    handles = [patches.Patch(facecolor=ROBOT, label=f"{task.robot.name} at the start, to scale")]
    if task.boxes:
        word = "wall" if isinstance(task, Maze) else "obstacle: its number and height"
        handles.append(patches.Patch(facecolor=WALL, label=word))
    first = {mark.target: mark for mark in reversed(marks(task))}
    for target, mark in sorted(first.items()):
        word = "target" if target else "stones, to be crossed in order"
        sign = mark_sign(Mark((np.nan, np.nan), mark.within, mark.label, target))
        sign.set_label(f"{word} (within {mark.within:g} m)")
        handles.append(sign)
    if paths:
        text = f"paths of the torso in {paths} episodes, and their ends" if paths > 1 else "path of the torso, its end"
        handles.append(lines.Line2D([], [], color=PATHS[0], marker="s", ms=4.5, mec="white", label=text))
    style = {"fontsize": 8, "frameon": False, "labelspacing": 0.8}
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, **style)


MOST_FRAMES: Final = 160
"""Longer episodes drop frames, to keep the file small."""
FRAME: Final = 50
"""How long a frame is shown, ms."""
COLOURS: Final = 128
"""Per frame; a GIF has at most 256."""
WINDOW: Final = 6.0
"""Width of ground shown by the camera beside the robot, m."""
SIZES: Final = {FROM_ABOVE: (5.2, 5.6), FROM_THE_SIDE: (7.0, 2.8)}
"""Inches."""
LETTERS: Final = 11
"""In a title, per inch."""


def film(task: RobotTask, motion: Motion, title: str) -> bytes:
    """Return an episode as an animated GIF that repeats forever.

    Raises:
        UserError: when matplotlib is not installed.
    """
    shown, plane = motion.every(math.ceil(motion.frames / MOST_FRAMES)), plane_of(task)
    images = optional("PIL.Image")
    with own_style():
        figure, axis = _stage(task, shown, plane)
        figure.suptitle(textwrap.fill(title, int(LETTERS * SIZES[plane][0])), fontsize=9)
        (path,) = axis.plot([], [], color=PATHS[0], linewidth=1.2, zorder=3)
        time = axis.set_title("0.0 s", fontsize=9)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # shared elements must not move between frames
        pictures = []
        for frame in range(shown.frames):
            if plane == FROM_THE_SIDE:
                axis.set_xlim(*_window(shown, frame))
            path.set_data(*shown.torso[: frame + 1, plane].T)
            time.set_text(f"{frame * shown.seconds:.1f} s")
            robot = paint_robot(axis, shown, frame, plane, zorder=7)
            figure.canvas.draw()
            picture = images.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
            pictures.append(picture.quantize(COLOURS))
            for part in robot:
                part.remove()
    file = io.BytesIO()
    pictures[0].save(file, format="GIF", save_all=True, append_images=pictures[1:], duration=FRAME, loop=0)
    return file.getvalue()


def _stage(task: RobotTask, motion: Motion, plane: Plane) -> tuple[Any, Any]:
    """Build the static parts; return figure and axis."""
    figure = optional("matplotlib.figure").Figure(figsize=SIZES[plane], dpi=90, layout="constrained")
    optional("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
    axis = figure.add_subplot()
    if plane == FROM_ABOVE:
        paint_ground(axis, task, [motion.torso])
    else:
        paint_earth(axis, motion)
        top = max(1.2, float(motion.torso[:, 2].max()) + 0.4)
        axis.set(xlim=_window(motion, 0), ylim=(-BELOW, top), xlabel="x, m")
    return figure, axis


def _window(motion: Motion, frame: int) -> tuple[float, float]:
    """Return the lowest and the highest x that the camera beside the robot shows, m."""
    here = float(motion.torso[frame, 0])
    return here - WINDOW / 2, here + WINDOW / 2
