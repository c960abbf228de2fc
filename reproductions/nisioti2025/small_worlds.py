"""The smoke tier's mazes: rooms with one wall, in which a few thousand policies show what the paper says of its mazes.

The straight way ends at the wall, so that a method that only follows the rising reward stays there, or at the first
stone. docs/smoke.md has what fifty trials of each method did in them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

from evoclaims.envs import Box, DeceptiveMaze, MazePlan, SteppingStones

Area = tuple[tuple[float, float], tuple[float, float]]
"""Lowest and highest x, lowest and highest y, m."""


def _room(area: Area, inside: Box) -> tuple[Box, ...]:
    """Return the outer walls of a room, and the one inside it."""
    (west, east), (south, north) = area
    middle, across, along = ((west + east) / 2, (south + north) / 2), (east - west) / 2, (north - south) / 2
    return (
        Box((middle[0], south), (across, 0.1)),
        Box((middle[0], north), (across, 0.1)),
        Box((west, middle[1]), (along, 0.1), angle=90.0),
        Box((east, middle[1]), (along, 0.1), angle=90.0),
        inside,
    )


STONES: Final = ((-1.0, 1.5), (1.0, 1.5), (1.0, 0.5))
"""The first straight ahead of the start, the others behind a wall; the last is the target."""
START: Final = (-1.0, 0.5)
"""So far from all walls that the ant's legs do not touch them."""
HALVES: Final[Area] = ((-2.5, 2.5), (-1.0, 3.5))
WALL_BETWEEN: Final = MazePlan(
    walls=_room(HALVES, Box((0.0, 0.5), (1.5, 0.1), angle=90.0)),
    area=HALVES,
    start=START,
    target=STONES[-1],
    within=0.6,
)
"""A room in two halves, which meet at its far end; start and target lie on either side of the wall."""
BARRED: Final[Area] = ((-2.5, 2.5), (-1.0, 4.0))
WALL_AHEAD: Final = MazePlan(
    walls=_room(BARRED, Box((-1.0, 2.0), (1.5, 0.1))),
    area=BARRED,
    start=START,
    target=(-1.0, 3.2),
    within=0.8,
)
"""A room with a wall across the straight way to the target, which ends 2 m from the eastern one."""


@dataclass(frozen=True)
class ThreeStones(SteppingStones):
    """Three stones in a room with one wall."""

    name: ClassVar[str] = "three_stones"  # type: ignore[misc]
    revision: ClassVar[int] = 1

    within: float = 0.35

    @property
    def stones(self) -> tuple[tuple[float, float], ...]:
        """One before the wall, two behind it."""
        return STONES

    @property
    def plan(self) -> MazePlan:
        """The room."""
        return WALL_BETWEEN


@dataclass(frozen=True)
class SmallDeceptiveMaze(DeceptiveMaze):
    """A wall across the way ("easy"), or the room of the three stones without them ("difficult")."""

    name: ClassVar[str] = "small_deceptive_maze"  # type: ignore[misc]
    revision: ClassVar[int] = 1

    @property
    def plan(self) -> MazePlan:
        """The room."""
        return {"easy": WALL_AHEAD, "difficult": WALL_BETWEEN}[self.difficulty]
