"""Deceptive mazes, easy and difficult (§3.2 of the paper): the straight path to the target ends at a wall."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final, Literal, get_args

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from evoclaims.core.errors import require_known
from evoclaims.core.pytree import pytree
from evoclaims.envs.ecorobot import stones
from evoclaims.envs.ecorobot.boxes import Box
from evoclaims.envs.ecorobot.maze import Maze, MazePlan
from evoclaims.envs.ecorobot.pose import Pose
from evoclaims.envs.ecorobot.robot_task import ROBOT_PACKAGES, Outing, Ruling

Difficulty = Literal["easy", "difficult"]


EASY: Final = MazePlan(
    walls=(
        Box((0.0, 0.0), (6.0, 0.3), bottom=-1.0, top=1.0),
        Box((0.0, 11.5), (6.0, 0.3), bottom=-1.0, top=1.0),
        Box((-6.0, 5.5), (6.0, 0.3), angle=90.0, bottom=-1.0, top=1.0),
        Box((6.0, 5.5), (6.0, 0.3), angle=90.0, bottom=-1.0, top=1.0),
        Box((-3.0, 7.5), (4.0, 0.3), bottom=-1.0, top=1.0),
    ),
    area=((-6.0, 6.0), (0.0, 11.5)),
    start=(-3.0, 1.0),
    target=(-4.0, 9.0),
    within=1.1,
)
DIFFICULT: Final = stones.PLAN
PLANS: Final = {"easy": EASY, "difficult": DIFFICULT}


@pytree
class Approach:
    """Progress towards the target.

    Attributes:
        first: at the start, the distance to where the target counts as reached, m.
        done: whether it was reached.
    """

    first: Float[Array, ""]
    done: Bool[Array, ""]


@dataclass(frozen=True)
class DeceptiveMaze(Maze):
    """Reach the target: a step's reward is the decrease in distance, as a share of the first distance.

    The distance is to where the target counts as reached, so rewards sum to 1 along any path there.

    Attributes:
        difficulty: "easy" (a bar across the way) or "difficult" (the walls of the stepping stones' maze).
    """

    name: ClassVar[str] = "deceptive_maze"
    revision: ClassVar[int] = 1
    packages: ClassVar[tuple[str, ...]] = ROBOT_PACKAGES

    difficulty: Difficulty = "easy"

    def __post_init__(self) -> None:
        """Check the name of the difficulty."""
        super().__post_init__()
        require_known("difficulty", self.difficulty, get_args(Difficulty))

    @property
    def plan(self) -> MazePlan:
        """The maze."""
        return PLANS[self.difficulty]

    def memory(self, pose: Pose) -> Approach:
        """Store the target's distance."""
        return Approach(first=self._distance(pose), done=jnp.zeros((), bool))

    def rule(self, memory: Approach, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:
        """Reward progress; end at the target."""
        distance = self._distance(after)
        reached = distance <= 0.0
        gained = self._distance(before) - jnp.maximum(distance, 0.0)
        return Ruling(
            memory=Approach(first=memory.first, done=memory.done | reached),
            reward=gained / memory.first,
            ended=reached,
        )

    def reached(self, outing: Outing) -> Bool[Array, ""]:
        """Whether the target was reached."""
        done: Bool[Array, ""] = outing.memory.done
        return done

    def measures(self, outing: Outing) -> dict[str, Array]:
        """Return the distance left to the target, m."""
        return {"distance": jnp.maximum(self._distance(outing.pose), 0.0)}

    def _distance(self, pose: Pose) -> Float[Array, ""]:
        """Return the distance to where the target counts as reached, m."""
        distance: Array = jnp.linalg.norm(pose.place[:2] - jnp.asarray(self.target, jnp.float32))
        return distance - self.plan.within
