"""Marks: places on the ground that a task's rule uses, and that a picture shows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.stones import SteppingStones


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
