"""A controller that knows the maze: the positive control of the stepping stones (C4).

It learns nothing. Shortest paths to every stone are computed beforehand; the robot follows the one to the stone that
it observes. If it cannot cross a maze within an episode, no method can.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from evoclaims import UserError
from evoclaims.envs import ROBOT_PACKAGES, SIMPLE_ROB, STONES, Box, SteppingStones, Task
from evoclaims.methods import Policy, Progress

GRID: Final = 0.1
"""Distance between grid points of the paths, m."""
AHEAD: Final = 4
"""How many points ahead the robot steers."""
CLEARANCE: Final = 0.12
"""Distance that paths keep between the robot's surface and walls, m."""


@dataclass(frozen=True)
class Waypoints:
    """Steers the simplest robot from stone to stone.

    Attributes:
        speed: target speed, m/s.
        gain: force per m/s of speed error, N; the motors give at most 2 N.
    """

    name: ClassVar[str] = "waypoints"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = (*ROBOT_PACKAGES, "scipy")
    deterministic: ClassVar[bool] = True

    speed: float = 1.0
    gain: float = 10.0

    def init(self, key: PRNGKeyArray, task: Task) -> Int[Array, ""]:
        """Return a state that counts steps."""
        return jnp.zeros((), jnp.int32)

    def step(
        self, key: PRNGKeyArray, task: Task, level: Int[Array, ""], state: Int[Array, ""]
    ) -> tuple[Int[Array, ""], Progress]:
        """Change nothing."""
        nothing = jnp.zeros(())
        return state + 1, Progress(fitness=nothing, success=nothing, healthy=jnp.ones((), bool), metrics={})

    def best(self, task: Task, state: Int[Array, ""]) -> Policy:
        """Return the controller.

        Raises:
            UserError: for a task other than the stepping stones with the simplest robot and the goal shown.
        """
        if not isinstance(task, SteppingStones) or task.robot != SIMPLE_ROB or not task.shows_goal:
            raise UserError("Waypoints are known for the stepping stones alone, with simple_rob and shows_goal=True.")
        (low_x, _), (low_y, _) = task.area

        def function(targets: Any, observation: Float[Array, " observation"]) -> Float[Array, " action"]:
            place, velocity, goal = observation[:2], observation[3:5], observation[-2:]
            stone = jnp.argmin(jnp.sum((jnp.asarray(STONES, jnp.float32) - goal[None]) ** 2, axis=1))
            cell = jnp.round((place - jnp.asarray([low_x, low_y], jnp.float32)) / GRID).astype(jnp.int32)
            cell = jnp.clip(cell, 0, jnp.asarray(targets.shape[1:3], jnp.int32) - 1)
            way = targets[stone, cell[0], cell[1]] - place
            length = jnp.linalg.norm(way)
            wanted = way / jnp.maximum(length, 1e-6) * jnp.minimum(self.speed, 3.0 * length)
            east, north = self.gain * (wanted - velocity) / 20.0  # the motors' gear
            return jnp.maximum(jnp.stack([north, east, -east, -north]), 0.0)

        return Policy(
            parameters=jnp.asarray(_targets(task.boxes, task.area, task.robot.torso_radius)), function=function
        )

    def cost(self, task: Task) -> int:
        """Return the environment steps of one step: none are made, but trial lengths are counted in them."""
        return task.horizon


@lru_cache(maxsize=4)
def _targets(boxes: tuple[Box, ...], area: tuple[tuple[float, float], ...], radius: float) -> NDArray[np.float32]:
    """Return where to steer from each grid point to reach each stone, shape [stones, points x, points y, 2], m."""
    axes = [np.arange(round((high - low) / GRID) + 1) * GRID + low for low, high in area]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    gap = np.full(points.shape[:2], np.inf)
    for box in boxes:
        gap = np.minimum(gap, box.distance(points))
    # Points too near to walls are expensive: paths may start there, but never pass through.
    shape, flat = gap.shape, points.reshape(-1, 2)
    price = np.where(gap < radius + CLEARANCE, 1e3, 1.0).ravel()
    index = np.arange(price.size).reshape(shape)
    ends: list[NDArray[np.int64]] = []
    for here, there in (
        (index[:-1], index[1:]),
        (index[:, :-1], index[:, 1:]),
        (index[:-1, :-1], index[1:, 1:]),
        (index[:-1, 1:], index[1:, :-1]),
    ):
        ends.append(np.stack([here.ravel(), there.ravel()]))
    one, other = np.concatenate(ends, axis=1)
    length = np.linalg.norm(flat[one] - flat[other], axis=1) * (price[one] + price[other]) / 2
    graph = coo_array((length, (one, other)), shape=(price.size,) * 2).tocsr()
    goals = [int(np.argmin(np.sum((flat - np.array(stone)) ** 2, axis=1))) for stone in STONES]
    _, previous = dijkstra(graph, directed=False, indices=goals, return_predecessors=True)
    targets = np.empty((len(STONES), price.size, 2), np.float32)
    for stone, goal in enumerate(goals):
        towards = np.where(previous[stone] < 0, goal, previous[stone])
        ahead = np.arange(price.size)
        for _ in range(AHEAD):
            ahead = towards[ahead]
        targets[stone] = np.where((ahead == goal)[:, None], np.array(STONES[stone]), flat[ahead])
    return targets.reshape(len(STONES), *shape, 2)
