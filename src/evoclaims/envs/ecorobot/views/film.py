"""An episode as an animated GIF: from above, or from the side with the camera beside the robot."""

from __future__ import annotations

import io
import math
import textwrap
from typing import Any, Final

import numpy as np

from evoclaims.core.drawing import optional, own_style
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.views.motion import Motion
from evoclaims.envs.ecorobot.views.painting import (
    BELOW,
    FROM_ABOVE,
    FROM_THE_SIDE,
    PATHS,
    Plane,
    paint_earth,
    paint_ground,
    paint_robot,
    plane_of,
)

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
