"""How many boxes a robot can touch at a time: only that many need to be simulated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from evoclaims.envs.ecorobot.boxes import Box

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
    touching = np.flatnonzero((model.geom_bodyid > 0) & ((model.geom_contype | model.geom_conaffinity) != 0))
    bodies = model.geom_bodyid[touching]
    arms = np.linalg.norm(model.geom_pos[touching] - pivots[bodies], axis=1) + model.geom_rbound[touching]
    return float(np.max(furthest[bodies] + arms, initial=0.0))


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
