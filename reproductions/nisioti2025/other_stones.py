"""The maze with stepping stones with other details: what counts as crossing, what is paid, walls, ranges, the ant's."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Final, Literal, get_args

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from evoclaims.core.errors import require_known
from evoclaims.core.pytree import pytree
from evoclaims.envs import STONES, Box, MazePlan, Pose, Rangefinders, Ruling, SteppingStones, Surface
from evoclaims.envs.ecorobot.robot_task import Outing
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.envs.ecorobot.sensors import distances
from evoclaims.envs.ecorobot.stones import BONUS, PLAN

Pays = Literal["each", "once"]
Toward = Literal["next", "after_next"]
Ends = Literal["last_stone", "near_target"]
World = Literal["small", "big"]

NEAR: Final = 1.1
"""How near the target an episode ends with `ends="near_target"`, m."""
PUBLISHED_BONUS: Final = 10_000.0
"""Paid there with all stones crossed, which nobody can: the target's stone lies nearer than `NEAR`."""
BIG: Final = MazePlan(
    walls=(
        Box((0.0, 0.0), (6.0, 0.1)),
        Box((0.0, 11.0), (6.0, 0.1)),
        Box((-6.0, 5.5), (6.0, 0.1), angle=90.0),
        Box((6.0, 5.5), (6.0, 0.1), angle=90.0),
        Box((-4.0, 8.0), (2.0, 0.1), angle=10.0),
        Box((-3.5, 6.5), (1.5, 0.1), angle=80.0),
        Box((-0.5, 6.0), (3.5, 0.1), angle=-30.0),
        Box((0.0, 1.0), (1.5, 0.1), angle=30.0),
        Box((3.5, 7.0), (2.8, 0.1), angle=-30.0),
    ),
    area=((-6.0, 6.0), (0.0, 11.0)),
    start=(-3.0, 1.0),
    target=(-4.5, 9.0),
    within=0.1,
)
BIG_STONES: Final = ((-0.5, 3.0), (4.5, 3.0), (4.5, 5.0), (-1.5, 7.4), (0.5, 9.0), (-2.5, 9.5), BIG.target)
PLACES: Final = {"small": (PLAN, STONES, math.hypot(8.0, 8.0)), "big": (BIG, BIG_STONES, math.hypot(12.0, 12.0))}
"""Plan, stones, and the length that distances are divided by, m."""


@dataclass(frozen=True)
class MetreRanges(Rangefinders):
    """Rangefinders that read metres, however far; 1 for nothing."""

    def read(self, scene: Scene, pose: Pose) -> Float[Array, " size"]:
        """Return the distance of each ray, m, unlike `Rangefinders` not in [0, 1]."""
        far = distances(scene, pose, np.linspace(-90.0, 90.0, self.count))
        return jnp.where(far < jnp.inf, far, 1.0)


@pytree
class Walk:
    """The rule's memory.

    Attributes:
        crossed: stones crossed.
        steps: environment steps made.
    """

    crossed: Int[Array, ""]
    steps: Int[Array, ""]


@dataclass(frozen=True)
class OtherStones(SteppingStones):
    """Stepping stones; with the values that fields have at first, those of the protocol.

    Attributes:
        pays: a step's reward in every step ("each"), or in the last but one of an episode alone ("once").
        toward: the distance in a step's reward is that to the next stone, or to the one after that, which in the step
            that crosses a stone is the next ("after_next").
        ends: an episode ends when the last stone is crossed, for a bonus of 1,000 ("last_stone"); or `NEAR` the target,
            crossed what may be ("near_target").
        walls: half width of the walls, m.
        surface: of the walls.
        world: the maze, or the larger one that the ant was in ("big").
        seen_positions: how many of the robot's positions a policy sees, from the first; None for all.
    """

    name: ClassVar[str] = "other_stones"  # type: ignore[misc]
    revision: ClassVar[int] = 1

    pays: Pays = "each"
    toward: Toward = "next"
    ends: Ends = "last_stone"
    walls: float = 0.1
    surface: Surface = Surface()
    world: World = "small"
    seen_positions: int | None = None

    def __post_init__(self) -> None:
        """Check the words."""
        super().__post_init__()
        require_known("way to pay", self.pays, get_args(Pays))
        require_known("shaping", self.toward, get_args(Toward))
        require_known("end", self.ends, get_args(Ends))
        require_known("world", self.world, get_args(World))

    @property
    def plan(self) -> MazePlan:
        """The maze, with its walls as wide and as rough as said."""
        plan = PLACES[self.world][0]
        walls = (replace(box, half_size=(box.half_size[0], self.walls), surface=self.surface) for box in plan.walls)
        return plan._replace(walls=tuple(walls))

    @property
    def stones(self) -> tuple[tuple[float, float], ...]:
        """The stones' places in order, m; the target is the last."""
        return PLACES[self.world][1]

    def memory(self, pose: Pose) -> Walk:  # type: ignore[override]
        """Start without a stone."""
        return Walk(crossed=jnp.zeros((), jnp.int32), steps=jnp.zeros((), jnp.int32))

    def rule(self, memory: Walk, before: Pose, after: Pose, action: Float[Array, " action"]) -> Ruling:  # type: ignore[override]
        """Count a stone when the robot is at the next one, and pay."""
        stones = jnp.asarray(self.stones, jnp.float32)
        last = len(self.stones) - 1

        def distance(stone: Int[Array, ""]) -> Float[Array, ""]:
            return jnp.linalg.norm(after.place[:2] - stones[jnp.minimum(stone, last)])

        crossed = memory.crossed + (distance(memory.crossed) <= self.within).astype(jnp.int32)
        now = Walk(crossed=crossed, steps=memory.steps + 1)
        shaping = memory.crossed + 1 if self.toward == "after_next" else crossed
        reward = crossed.astype(jnp.float32) + 1.0 - distance(shaping) / PLACES[self.world][2]
        if self.pays == "once":
            reward = jnp.where(now.steps == self.episode_steps - 1, reward, 0.0)
        through = crossed == len(self.stones)
        if self.ends == "last_stone":
            return Ruling(memory=now, reward=reward + jnp.where(through, BONUS, 0.0), ended=through)
        there = distance(jnp.asarray(last)) <= NEAR
        return Ruling(memory=now, reward=reward + jnp.where(through & there, PUBLISHED_BONUS, 0.0), ended=there)

    def _observe(self, outing: Outing) -> Float[Array, " observation"]:
        """Return what the robot sees, with only some of its positions."""
        seen = super()._observe(outing)
        if self.seen_positions is None:
            return seen
        return jnp.concatenate([seen[: self.seen_positions], seen[outing.body.position.shape[0] :]])
