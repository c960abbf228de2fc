"""An episode as a page that the mouse can rotate: one self-contained HTML file, drawn by WebGL."""

from __future__ import annotations

import base64
import html
import json
import math
from importlib import resources
from string import Template
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evoclaims.core.content_policy import exactly
from evoclaims.envs.ecorobot.maze import Maze
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.views.motion import Motion, Shape, marks

ASSETS: Final = resources.files("evoclaims.envs.ecorobot.views") / "assets"
DIGITS: Final = 6
"""For static shapes; moving ones keep every bit."""


def page(task: RobotTask, motion: Motion, title: str) -> bytes:
    """Return the page of an episode, under a title of plain text.

    It contains the viewer (`assets/viewer.html`, `assets/viewer.js`) and, as JSON, what `scenery` returns. It needs
    no network, and its policy forbids network access and any other script.
    """
    # "<" could end the element around the text; the escape means the same in JSON.
    data = json.dumps(scenery(task, motion), allow_nan=False).replace("<", "\\u003c")
    template = Template((ASSETS / "viewer.html").read_text("utf-8"))
    script = (ASSETS / "viewer.js").read_text("utf-8")
    shown = {"title": html.escape(title), "data": data, "script": script, "allowed": exactly(script)}
    return template.substitute(shown).encode()


def scenery(task: RobotTask, motion: Motion) -> dict[str, Any]:
    """Return what the viewer shows, as plain JSON.

    Whole arrays are little-endian float32 in base64: "poses" [frames, moving shapes, 7] (place, m, and quaternion
    w, x, y, z) and "torso" [frames, 3].
    """
    moves = np.array([shape.moves for shape in motion.shapes], bool)
    poses = np.concatenate([motion.places, motion.turns], axis=-1)
    return {
        "seconds": motion.seconds,
        "frames": motion.frames,
        "shapes": [_shape(shape, poses[0, i]) for i, shape in enumerate(motion.shapes)],
        "poses": _packed(poses[:, moves]),
        "torso": _packed(motion.torso),
        "marks": [
            {
                "place": list(mark.place),
                "within": mark.within,
                "text": " ".join(filter(None, (mark.label, "target" if mark.target else ""))),
                "target": mark.target,
            }
            for mark in marks(task)
        ],
        "view": _view(task, motion),
    }


def _shape(shape: Shape, pose: NDArray[np.float32]) -> dict[str, Any]:
    """Return a shape; with its pose if it is static."""
    plain = {"kind": shape.kind, "radii": list(shape.radii), "reach": shape.reach, "moves": shape.moves}
    return plain if shape.moves else {**plain, "pose": [round(float(value), DIGITS) for value in pose]}


def _view(task: RobotTask, motion: Motion) -> dict[str, Any]:
    """Return the first view: a whole maze from above, anything else beside the robot."""
    if isinstance(task, Maze):
        (low_x, high_x), (low_y, high_y) = task.area
        return {
            "target": [(low_x + high_x) / 2, (low_y + high_y) / 2, 0.0],
            "azimuth": -math.pi / 2,
            "elevation": math.radians(58),
            "distance": 1.35 * max(high_x - low_x, high_y - low_y),
            "follow": False,
        }
    return {
        "target": [float(value) for value in motion.torso[0]],
        "azimuth": math.radians(-75),
        "elevation": math.radians(20),
        "distance": 5.0,
        "follow": True,
    }


def _packed(values: NDArray[np.float32]) -> str:
    """Return an array as little-endian float32 in base64."""
    return base64.b64encode(np.ascontiguousarray(values, "<f4").tobytes()).decode("ascii")
