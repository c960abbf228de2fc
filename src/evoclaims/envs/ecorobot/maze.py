"""The base of all mazes: the ground a robot can reach, and how much of it a path has covered."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import Any, Final, NamedTuple, Self

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from numpy.typing import NDArray

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.robot_task import RobotTask
from evoclaims.envs.ecorobot.sensors import Rangefinders, Sensor

Area = tuple[tuple[float, float], tuple[float, float]]
"""Lowest and highest x, lowest and highest y, m."""

CELLS: Final = (50, 50)
"""The grid over which coverage is counted (§A.5 of the paper)."""
FINE: Final = 4
"""Points along each side of a cell for computing reachability."""


class _Plan(NamedTuple):
    walls: tuple[Box, ...]
    area: Area
    start: tuple[float, float]
    target: tuple[float, float]
    within: float


class MazePlan(_Plan):
    """A maze: walls, the ground between them, start, target, and the distance that counts as reached, m."""

    __slots__ = ()

    def __new__(
        cls, walls: tuple[Box, ...], area: Area, start: tuple[float, float], target: tuple[float, float], within: float
    ) -> Self:
        """Check its numbers: a target within NaN is never reached."""
        places = (*start, *target, *chain.from_iterable(area))
        if not all(map(math.isfinite, places)) or any(low >= high for low, high in area):
            raise UserError(
                f"A MazePlan has area={area}, start={start} and target={target}. Write finite numbers, and of each "
                "side of the area the lowest first."
            )
        if not 0 < within < math.inf:
            raise UserError(f"A MazePlan has within={within}. Write a finite distance above 0, in m.")
        outside = any(not low <= at <= high for at, (low, high) in zip(start, area, strict=True))
        if outside or any(wall.distance(np.array([start]))[0] <= 0.0 for wall in walls):
            raise UserError(f"A MazePlan has start={start}, outside its area or in a wall. Write another place.")
        if math.isclose(math.dist(start, target), within, rel_tol=1e-6):
            raise UserError(
                f"A MazePlan has start={start} exactly within={within} of target={target}, and rewards are shares of "
                "the way between. Write another distance."
            )
        return super().__new__(cls, walls, area, start, target, within)

    @classmethod
    def _make(cls, iterable: Iterable[Any]) -> Self:  # type: ignore[override]
        """Return the plan with these values, of which `_replace` makes another plan."""
        return cls(*iterable)


@dataclass(frozen=True)
class Maze(RobotTask):
    """A task among walls. The policy sees positions, velocities and five rangefinders."""

    sensor: Sensor | None = Rangefinders()

    @property
    @abstractmethod
    def plan(self) -> MazePlan:
        """The maze."""

    @property
    def boxes(self) -> tuple[Box, ...]:
        """The walls."""
        return self.plan.walls

    @property
    def area(self) -> Area:
        """The ground between the outer walls."""
        return self.plan.area

    @property
    def start(self) -> tuple[float, float]:
        """Where the robot starts, m."""
        return self.plan.start

    @property
    def target(self) -> tuple[float, float]:
        """The target's place, m."""
        return self.plan.target

    def reachable(self, cells: tuple[int, int] = CELLS) -> NDArray[np.bool_]:
        """Return which cells of a grid over the area the torso's centre can reach, shape [cells along x, along y]."""
        return _reachable(self.boxes, self.area, self.start, self.robot.torso_radius, cells)

    def path_measures(
        self, path: Float[Array, "steps 2"], alive: Bool[Array, " steps"]
    ) -> Mapping[str, Float[Array, ""]]:
        """Return the share of the reachable cells that the path visited."""
        ground = self.reachable()
        low = jnp.asarray([bounds[0] for bounds in self.area], jnp.float32)
        high = jnp.asarray([bounds[1] for bounds in self.area], jnp.float32)
        size = jnp.asarray(CELLS)
        share = (path - low[None]) / (high - low)[None]
        cell = jnp.floor(share * size[None].astype(jnp.float32)).astype(jnp.int32)
        inside = jnp.all((share >= 0.0) & (share <= 1.0), axis=1)
        cell = jnp.clip(cell, 0, size[None] - 1)
        been = jnp.zeros(CELLS, bool).at[cell[:, 0], cell[:, 1]].max(alive & inside)
        return {"coverage": jnp.sum(been & ground).astype(jnp.float32) / float(ground.sum())}


@lru_cache(maxsize=64)
def _reachable(
    boxes: tuple[Box, ...], area: Area, start: tuple[float, float], radius: float, cells: tuple[int, int]
) -> NDArray[np.bool_]:
    """Flood the ground from the start, on a grid `FINE` times as fine as the cells."""
    axes = [
        low + (np.arange(count * FINE) + 0.5) * (high - low) / (count * FINE)
        for (low, high), count in zip(area, cells, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    free = np.ones((cells[0] * FINE, cells[1] * FINE), bool)
    for box in boxes:
        free &= box.distance(points) >= radius
    first = tuple(int(np.argmin(np.abs(axis - at))) for axis, at in zip(axes, start, strict=True))
    # By hand rather than by SciPy, whose versions trials in mazes would depend on.
    flooded, edge = np.zeros_like(free), [first]
    flooded[first] = True
    while edge:
        x, y = edge.pop()
        for i, j in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if 0 <= i < free.shape[0] and 0 <= j < free.shape[1] and free[i, j] and not flooded[i, j]:
                flooded[i, j] = True
                edge.append((i, j))
    ground = np.asarray(flooded.reshape(cells[0], FINE, cells[1], FINE).any(axis=(1, 3)))
    ground.setflags(write=False)
    return ground
