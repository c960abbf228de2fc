"""How many boxes a robot can touch at a time: of many boxes, only as many need be simulated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from evoclaims.envs.ecorobot.boxes import Box

SPACING: Final = 0.05
"""Of the grid over which boxes within reach are counted, m."""


def reach(model: mujoco.MjModel) -> float:
    """Return a bound on how far from the torso's centre a robot can touch a box, m, whatever its posture.

    Limbs are taken as stretched out straight. A limb on a slide has no bound: infinity.

    Args:
        model: the robot alone; its first body is the torso.
    """
    furthest = np.zeros(model.nbody)
    for body in range(2, model.nbody):
        joints = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
        slides = any(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE for joint in joints)
        # A hinge beside its body's origin moves the origin, by no more than twice the distance.
        off = sum(2 * float(np.linalg.norm(model.jnt_pos[joint])) for joint in joints)
        length = np.inf if slides else float(np.linalg.norm(model.body_pos[body])) + off
        furthest[body] = furthest[model.body_parentid[body]] + length
    touching = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_contype & 1 > 0))
    middles = furthest[model.geom_bodyid[touching]] + np.linalg.norm(model.geom_pos[touching], axis=1)
    return float(np.max(middles + model.geom_rbound[touching], initial=0.0))


def touched_at_once(model: mujoco.MjModel, boxes: Sequence[Box]) -> int:
    """Return a bound on how many boxes a robot (`model`: alone) can touch at a time, wherever it is.

    It is the most boxes within its reach, seen from above.
    """
    within = reach(model) + SPACING / np.sqrt(2)  # no place is further than this from a point of the grid
    if not boxes or not np.isfinite(within):
        return len(boxes)
    corners = np.concatenate([box.corners for box in boxes])
    axes = [
        np.arange(low - within, high + within + SPACING, SPACING)
        for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return int(np.max(np.sum([box.distance(points) <= within for box in boxes], axis=0)))
