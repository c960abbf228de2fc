"""What cannot be built says so, in a sentence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.boxes import Box, Surface
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import Locomotion, Obstacles
from evoclaims.envs.ecorobot.maze import MazePlan
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB
from evoclaims.envs.ecorobot.sensors import Rangefinders
from evoclaims.envs.ecorobot.stones import PLAN, SteppingStones

WRONG: Any = "steep"
BOX: dict[str, Any] = {"centre": (0.0, 0.0), "half_size": (1.0, 1.0)}


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (partial(DeceptiveMaze, difficulty=WRONG), "no difficulty named 'steep'.* Known: difficult, easy"),
        (partial(SteppingStones, within=math.nan), "stepping_stones has within=nan. Write a finite distance above 0"),
        (partial(SteppingStones, within=math.inf), "stepping_stones has within=inf. Write a finite distance above 0"),
        *(
            (partial(make, within=wrong), f"A MazePlan has within={wrong}. Write a finite distance above 0")
            for make in (partial(MazePlan, *PLAN[:-1]), PLAN._replace)
            for wrong in (math.nan, math.inf, 0.0, -1.0)
        ),
        *(
            (partial(PLAN._replace, **numbers), "A MazePlan has area=.* Write finite numbers, and of each side of the")
            for numbers in (
                *({name: (0.0, wrong)} for name in ("start", "target") for wrong in (math.nan, math.inf)),
                *({"area": ((0.0, 1.0), wrong)} for wrong in ((0.0, math.nan), (1.0, 1.0), (0.0, math.inf))),
            )
        ),
        (partial(Obstacles, heights=WRONG), "no profile of heights named 'steep'.* Known: hierarchical, high, medium"),
        *(
            (partial(kind, **{name: 0}), f"{kind.name}'s {name} must be at least 1, not 0")
            for kind in (SteppingStones, DeceptiveMaze, Obstacles, Locomotion)
            for name in ("episode_steps", "examined_episodes")
        ),
        *(
            (partial(Box, **{**BOX, **numbers}), "is not valid. Write finite numbers, half sizes above 0")
            for numbers in (
                *({"half_size": size} for size in ((0.0, 1.0), (1.0, -1.0))),
                {"bottom": 0.5, "top": 0.5},
                *({"centre": (math.nan, 0.0)}, {"angle": math.inf}, {"top": math.inf}),
            )
        ),
        *(
            (partial(Surface, **numbers), "is not valid. Write three frictions of at least 0")
            for numbers in (
                *({"friction": (wrong, 0.0, 0.0)} for wrong in (math.nan, -1.0)),
                *({"solref": (math.inf, 1.0)}, {"solimp": (0.9,)}),
            )
        ),
        *(
            (partial(Rangefinders, **numbers), "at least 1 ray, and a finite reach above 0")
            for numbers in (
                *({"count": wrong} for wrong in (0, 2.5, "7")),
                *({"reach": wrong} for wrong in (0.0, math.inf, math.nan, "4")),
            )
        ),
    ],
)
def test_what_cannot_be_is_told_what_may_stand_there(build: Callable[[], object], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        build()


def test_a_robot_without_a_file_says_so() -> None:
    with pytest.raises(UserError, match=r"The robot 'ghost' has its model in .*, and there is no file .*ghost\.xml"):
        replace(SIMPLE_ROB, name="ghost", xml="evoclaims.envs.ecorobot:assets/ghost.xml")
