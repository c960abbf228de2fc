"""The obstacles as the published code has them: flat, rough and hard boxes, no control cost, a longer examination."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import ClassVar, Final

from jaxtyping import Array, Int, PRNGKeyArray

from evoclaims.envs import HALF_CHEETAH, Box, Episode, Obstacles, Robot, Surface

SURFACE: Final = Surface(friction=(2.0, 0.1, 0.1), solref=(0.01, 1.0), solimp=(0.99, 0.99, 0.01, 0.5, 2.0))
LONGER: Final = 2
"""How many times as long as its training episodes a policy is examined."""


def published_boxes(boxes: Iterable[Box], *, flat: bool = True, surface: Surface = SURFACE) -> tuple[Box, ...]:
    """Return boxes with a surface, the published one, and if `flat` as deep below the floor as they are high."""
    return tuple(replace(box, bottom=-box.top if flat else box.bottom, surface=surface) for box in boxes)


@dataclass(frozen=True)
class PublishedObstacles(Obstacles):
    """Obstacles that reach as far below the floor as above it.

    Without a control cost an episode's reward is the distance run, in m, divided by 0.05 s, however long it takes.
    """

    name: ClassVar[str] = "published_obstacles"  # type: ignore[misc]
    revision: ClassVar[int] = 1

    robot: Robot = replace(HALF_CHEETAH, control_cost=0.0)

    @property
    def boxes(self) -> tuple[Box, ...]:
        """The obstacles."""
        return published_boxes(super().boxes)

    def examine(self, policy: Callable[[Array], Array], key: PRNGKeyArray, level: Int[Array, ""]) -> Episode:
        """Run `examined_episodes`, each `LONGER` times as long as in training."""
        return Obstacles.examine(replace(self, episode_steps=LONGER * self.episode_steps), policy, key, level)
