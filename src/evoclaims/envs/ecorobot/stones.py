"""The maze with stepping stones (§3.2 of the paper): a deceptive maze whose marks lead through it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Final

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from evoclaims.core.errors import UserError
from evoclaims.core.pytree import pytree
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.maze import Maze, MazePlan
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robot_task import ROBOT_PACKAGES, Outing, Ruling
from evoclaims.envs.ecorobot.sensors import ARENA

WALLS: Final = (
    Box((0.0, 0.0), (4.0, 0.1)),
    Box((0.0, 7.0), (4.0, 0.1)),
    Box((-4.0, 3.5), (4.0, 0.1), angle=90.0),
    Box((4.0, 3.5), (4.0, 0.1), angle=90.0),
    Box((-2.0, 5.0), (2.0, 0.1), angle=10.0),
    Box((-2.0, 3.5), (1.5, 0.1), angle=80.0),
    Box((0.5, 3.5), (2.5, 0.1), angle=-30.0),
    Box((0.0, 0.5), (0.5, 0.1), angle=30.0),
    Box((2.5, 4.0), (1.5, 0.1), angle=-30.0),
)
TARGET: Final = (-3.0, 6.0)
PLAN: Final = MazePlan(WALLS, area=((-4.0, 4.0), (0.0, 7.0)), start=(-3.0, 1.0), target=TARGET, within=0.1)
STONES: Final = ((-1.0, 2.5), (3.2, 1.0), (3.2, 2.5), (0.0, 4.5), (1.0, 6.0), (-2.0, 6.0), TARGET)
"""In order, m; the target is the last."""
BONUS: Final = 1000.0


@pytree
class StonesCrossed:
    """How many stones have been crossed."""

    crossed: Int[Array, ""]


@dataclass(frozen=True)
class SteppingStones(Maze):
    """Cross seven stones in order; stones are marks that touch nothing and that no sensor sees.

    A step's reward is the number of stones crossed so far, plus 1 - (distance to the next) / (the arena's diagonal);
    crossing the last, the target, pays 1,000 and ends the episode.

    Attributes:
        within: how near the torso's centre must come, m.
        shows_goal: whether the policy sees the next stone's place: goal-conditioned learning.
    """

    name: ClassVar[str] = "stepping_stones"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ROBOT_PACKAGES

    within: float = 0.1
    shows_goal: bool = False

    def __post_init__(self) -> None:
        """Check the distance."""
        super().__post_init__()
        if not 0 < self.within < math.inf:
            raise UserError(f"{self.name} has within={self.within}. Write a finite distance above 0, in m.")

    @property
    def stones(self) -> tuple[tuple[float, float], ...]:
        """The stones' places in order, m; the target is the last."""
        return STONES

    @property
    def plan(self) -> MazePlan:
        """The maze."""
        return PLAN

    @property
    def target(self) -> tuple[float, float]:
        """The last stone."""
        return self.stones[-1]

    def memory(self, pose: Pose) -> StonesCrossed:
        """Start without a stone."""
        return StonesCrossed(crossed=jnp.zeros((), jnp.int32))

    def rule(self, memory: StonesCrossed, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:
        """Count a stone when the robot is at the next one."""
        crossed = memory.crossed + (self._distance(memory, after) <= self.within).astype(jnp.int32)
        now = StonesCrossed(crossed=crossed)
        done = crossed == len(self.stones)
        reward = crossed.astype(jnp.float32) + 1.0 - self._distance(now, after) / ARENA
        return Ruling(memory=now, reward=reward + jnp.where(done, BONUS, 0.0), ended=done)

    def shown(self, outing: Outing) -> Float[Array, " more"]:
        """Return the next stone's x and y, if the policy sees its goal."""
        return self._next(outing.memory) if self.shows_goal else jnp.zeros(0)

    def reached(self, outing: Outing) -> Bool[Array, ""]:
        """Whether all stones are crossed."""
        memory: StonesCrossed = outing.memory
        return memory.crossed == len(self.stones)

    def measures(self, outing: Outing) -> dict[str, Array]:
        """Return the number of stones crossed."""
        return {"stones": outing.memory.crossed.astype(jnp.float32)}

    def _next(self, memory: StonesCrossed) -> Float[Array, 2]:
        """Return the next stone's place; after the last, the last one's."""
        stones: Array = jnp.asarray(self.stones, jnp.float32)
        return stones[jnp.minimum(memory.crossed, len(self.stones) - 1)]

    def _distance(self, memory: StonesCrossed, pose: Pose) -> Float[Array, ""]:
        """Return the distance to the next stone, m."""
        distance: Array = jnp.linalg.norm(pose.place[:2] - self._next(memory))
        return distance
