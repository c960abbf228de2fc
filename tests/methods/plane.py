"""A task that MAP-Elites maps: a point that a policy moves over a plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from evoclaims.envs.base import Episode


@dataclass(frozen=True)
class Plane:
    """A point that a policy moves from a lower left corner, through 4 m by 1.5 m; what is never called is not here.

    Fitness is how far up it ends; the target is the upper right corner.
    """

    name: ClassVar[str] = "plane"
    levels: ClassVar[int] = 1
    observation_size: ClassVar[int] = 2
    action_size: ClassVar[int] = 2
    area: ClassVar[Any] = ((-1.0, 3.0), (0.5, 2.0))

    horizon: int = 5
    stride: float = 0.5
    walled: bool = True

    def reachable(self, cells: tuple[int, int]) -> NDArray[np.bool_]:
        """All cells but the leftmost column's upper ones."""
        ground = np.ones(cells, bool)
        ground[0, 1:] = False
        return ground

    def episode(self, policy: Any, key: Any, level: Any) -> Episode:
        (x_min, x_max), (y_min, y_max) = self.area
        place = jnp.array([x_min + 0.1, y_min + 0.1])
        for _ in range(self.horizon):
            place = place + self.stride * policy(place)
            if self.walled:
                place = jnp.clip(place, jnp.array([x_min, y_min]), jnp.array([x_max, y_max]))
        reached = ((place[0] > x_max - 0.3) & (place[1] > y_max - 0.3)).astype(jnp.float32)
        return Episode(fitness=place[1], success=reached, metrics={"x": place[0], "y": place[1], "reached": reached})

    def examine(self, policy: Any, key: Any, level: Any) -> Episode:
        return self.episode(policy, key, level)
