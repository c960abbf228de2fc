"""What cannot be built says so, in a sentence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.boxes import Box, Surface
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import Locomotion
from evoclaims.envs.ecorobot.obstacles import Obstacles
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.envs.ecorobot.sensors import PieSlices, Rangefinders
from evoclaims.envs.ecorobot.stones import SteppingStones

WRONG: Any = "steep"


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: DeceptiveMaze(difficulty=WRONG), "no difficulty named 'steep'.* Known: difficult, easy"),
        (lambda: Obstacles(heights=WRONG), "no profile of heights named 'steep'.* Known: hierarchical, high, medium"),
    ],
)
def test_an_unknown_variant_of_a_task_is_told_the_known_ones(build: Callable[[], object], sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        build()


@pytest.mark.parametrize("kind", [SteppingStones, DeceptiveMaze, Obstacles, Locomotion])
@pytest.mark.parametrize("name", ["episode_steps", "examined_episodes"])
def test_episodes_and_their_steps_are_at_least_1(kind: Any, name: str) -> None:
    with pytest.raises(UserError, match=f"{kind.name}'s {name} must be at least 1, not 0"):
        kind(**{name: 0})


@pytest.mark.parametrize(
    "numbers",
    [
        {"half_size": (0.0, 1.0)},
        {"half_size": (1.0, -1.0)},
        {"bottom": 0.5, "top": 0.5},
        {"centre": (math.nan, 0.0)},
        {"angle": math.inf},
        {"top": math.inf},
    ],
    ids=str,
)
def test_a_box_has_a_volume(numbers: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="A box has finite numbers, half-sizes above 0"):
        Box(**{"centre": (0.0, 0.0), "half_size": (1.0, 1.0), **numbers})


@pytest.mark.parametrize(
    "numbers",
    [
        {"friction": (math.nan, 0.0, 0.0)},
        {"friction": (-1.0, 0.0, 0.0)},
        {"solref": (math.inf, 1.0)},
        {"solimp": (0.9,)},
    ],
    ids=str,
)
def test_a_surface_has_numbers_that_a_simulation_can_use(numbers: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="A surface has 3 frictions of at least 0"):
        Surface(**numbers)


@pytest.mark.parametrize("sensor", [Rangefinders, PieSlices])
@pytest.mark.parametrize("numbers", [{"count": 0}, {"reach": 0.0}, {"reach": math.inf}, {"reach": math.nan}])
def test_a_sensor_has_rays_and_a_reach(sensor: Any, numbers: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="at least 1 ray and a finite reach above 0 m"):
        sensor(**numbers)


def test_a_robot_without_a_file_says_so() -> None:
    nowhere = replace(SIMPLE_ROB, name="ghost", xml="evoclaims.envs.ecorobot:assets/ghost.xml")
    with pytest.raises(UserError, match=r"The robot 'ghost' has its model in .*, and there is no file .*ghost\.xml"):
        _ = Scene(nowhere).model


def test_a_robot_whose_file_is_no_model_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_robots").mkdir()
    (tmp_path / "broken_robots/__init__.py").touch()
    (tmp_path / "broken_robots/broken.xml").write_text("<mujoco><worldbody><body></worldbody></mujoco>")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UserError, match="The model of the robot broken cannot be read"):
        _ = Scene(replace(SIMPLE_ROB, name="broken", xml="broken_robots:broken.xml")).model
