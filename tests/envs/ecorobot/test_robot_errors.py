"""What cannot be built says so, in a sentence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.ecorobot.boxes import Box, Surface
from evoclaims.envs.ecorobot.deceptive import DeceptiveMaze
from evoclaims.envs.ecorobot.locomotion import Locomotion, Obstacles
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB, Robot
from evoclaims.envs.ecorobot.scene import Scene
from evoclaims.envs.ecorobot.sensors import Rangefinders
from evoclaims.envs.ecorobot.stones import SteppingStones

WRONG: Any = "steep"


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: DeceptiveMaze(difficulty=WRONG), "no difficulty named 'steep'.* Known: difficult, easy"),
        (lambda: SteppingStones(within=math.nan), "stepping_stones has within=nan. Write a finite distance above 0"),
        (lambda: SteppingStones(within=math.inf), "stepping_stones has within=inf. Write a finite distance above 0"),
        (lambda: Obstacles(heights=WRONG), "no profile of heights named 'steep'.* Known: hierarchical, high, medium"),
    ],
)
def test_a_wrong_word_or_number_of_a_task_is_told_what_may_stand_there(
    build: Callable[[], object], sentence: str
) -> None:
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
    with pytest.raises(UserError, match="is not valid. Write finite numbers, half sizes above 0"):
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
    with pytest.raises(UserError, match="is not valid. Write three frictions of at least 0"):
        Surface(**numbers)


@pytest.mark.parametrize("numbers", [{"count": 0}, {"reach": 0.0}, {"reach": math.inf}, {"reach": math.nan}])
def test_a_sensor_has_rays_and_a_reach(numbers: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="at least 1 ray, and a finite reach above 0"):
        Rangefinders(**numbers)


def test_a_robot_without_a_file_says_so() -> None:
    with pytest.raises(UserError, match=r"The robot 'ghost' has its model in .*, and there is no file .*ghost\.xml"):
        replace(SIMPLE_ROB, name="ghost", xml="evoclaims.envs.ecorobot:assets/ghost.xml")


@pytest.fixture
def of_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Robot]:
    """A function that returns a robot whose model is a text."""
    folder = tmp_path / tmp_path.name  # a package of its own, since packages and models are cached
    folder.mkdir()
    numbers = count(1)
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)

    def robot(text: str) -> Robot:
        name = f"rob{next(numbers)}"
        (folder / f"{name}.xml").write_text(text)
        return replace(SIMPLE_ROB, name=name, xml=f"{folder.name}:{name}.xml")

    return robot


def test_a_robot_whose_file_is_no_model_says_so(of_text: Callable[[str], Robot]) -> None:
    with pytest.raises(UserError, match="The model of the robot rob1 cannot be read"):
        _ = Scene(of_text("<mujoco><worldbody><body></worldbody></mujoco>")).model


ROB = """
<mujoco>
  <option integrator="Euler" cone="pyramidal"/>
  <worldbody>
    <geom type="plane" size="9 9 1" group="0"/>
    <body><joint name="x" type="slide"/><joint name="y" type="slide" axis="0 1 0"/><geom size="0.2"/></body>
  </worldbody>
  <actuator><general joint="x"/></actuator>
  <!-- more -->
</mujoco>
"""
BEYOND = {
    ('axis="0 1 0"', 'axis="0 1 0" frictionloss="0.1"'): "friction loss in joints",
    ("<general ", '<general dyntype="filter" '): "actuators with a state",
    ("pyramidal", "elliptic"): "elliptic friction cones",
    ('"Euler"', '"implicit"'): "another integrator than Euler or RK4",
    ("<!-- more -->", '<equality><joint joint1="x" joint2="y"/></equality>'): "equality constraints",
    ("<!-- more -->", '<tendon><fixed><joint joint="x" coef="1"/></fixed></tendon>'): "tendons",
}


@pytest.mark.parametrize(("change", "name"), BEYOND.items(), ids=BEYOND.values())
def test_a_robot_with_what_is_not_simulated_says_so(
    change: tuple[str, str], name: str, of_text: Callable[[str], Robot]
) -> None:
    assert Scene(of_text(ROB)).model.nq == 2
    with pytest.raises(UserError, match=f"The model of the robot rob2 has {name}, which is not simulated here"):
        _ = Scene(of_text(ROB.replace(*change))).model


def test_a_robot_whose_floor_would_count_as_a_box_says_so(of_text: Callable[[str], Robot]) -> None:
    with pytest.raises(UserError, match="has a geom of the world in group 1, which is the group of a task's boxes"):
        _ = Scene(of_text(ROB.replace('group="0"', 'group="1"'))).model
