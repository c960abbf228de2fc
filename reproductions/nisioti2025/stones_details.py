"""Single details of the mazes, their starts and their methods, as the authors' older commits have them.

Each function returns the changed condition, or None where the detail does not matter. Controls stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, Final

from evoclaims import Budget, Condition
from evoclaims.envs import ANT, DeceptiveMaze, RobotTask, SteppingStones
from evoclaims.methods import CmaEs, HyperNeat, MapElites, Neat, Ppo, SeldomDecomposedCmaEs
from evoclaims.networks import AllSkips
from reproductions.nisioti2025 import ecorobot
from reproductions.nisioti2025.first_level_ppo import FirstLevelPpo
from reproductions.nisioti2025.other_champions import (
    BestEverHyperNeat,
    BestEverNeat,
    OneStartMapElites,
    OtherCmaEs,
    OtherSeldomDecomposedCmaEs,
)
from reproductions.nisioti2025.other_mazes import EXAMINED_STEPS, EasyMazeAsCoded, Recurrent, RememberingStones
from reproductions.nisioti2025.other_ppo import OtherFirstLevelPpo, OtherPpo
from reproductions.nisioti2025.other_stones import MetreRanges, OtherStones
from reproductions.nisioti2025.waypoints import Waypoints

Change = Callable[[str, str, Condition], Condition | None]


def as_kind(kind: type[Any], given: Any, **settings: Any) -> Any:
    """Return a method or task as another kind of it, with some settings changed."""
    kept = {field.name: getattr(given, field.name) for field in fields(given) if field.init}
    return kind(**{**kept, **settings})


def other_stones(**settings: Any) -> Change:
    """Return the change of the full tier's stones to those of `OtherStones` with some settings."""

    def change(method: str, task: str, condition: Condition) -> Condition | None:
        asked = condition.task
        if type(asked) not in (SteppingStones, OtherStones) or isinstance(condition.method, Waypoints):
            return None
        return replace(condition, task=as_kind(OtherStones, asked, **settings))

    return change


def within(metres: float) -> Change:
    """Return the change to stones that count from as near."""

    def change(method: str, task: str, condition: Condition) -> Condition | None:
        asked = condition.task
        if type(asked) not in (SteppingStones, OtherStones) or isinstance(condition.method, Waypoints):
            return None
        return replace(condition, task=replace(asked, within=metres))

    return change


def start_noise(share: float) -> Change:
    """Return the change to stones with a share of the noise on starts; with 0 all starts are the same."""

    def change(method: str, task: str, condition: Condition) -> Condition | None:
        asked = condition.task
        if not isinstance(asked, SteppingStones) or isinstance(condition.method, Waypoints):
            return None
        robot, noise = asked.robot, (share * asked.robot.position_noise, share * asked.robot.velocity_noise)
        return replace(
            condition, task=replace(asked, robot=replace(robot, position_noise=noise[0], velocity_noise=noise[1]))
        )

    return change


metres = other_stones(sensor=MetreRanges())


def common_starts(method: str, task: str, condition: Condition) -> Condition | None:
    """CMA-ES with robots, each individual from the same two starts."""
    return _other_cma_es(condition, starts=2)


def one_start_map(method: str, task: str, condition: Condition) -> Condition | None:
    """MAP-Elites from one start."""
    if not isinstance(condition.method, MapElites):
        return None
    return replace(condition, method=as_kind(OneStartMapElites, condition.method))


LONG_MAP: Final = 50_000
"""Iterations of MAP-Elites under `long_map`: fifty times the protocol's, half of the table's loops times iterations."""


def long_map(method: str, task: str, condition: Condition) -> Condition | None:
    """MAP-Elites at full size, trained fifty times as long."""
    ours = ecorobot.FULL.get((method, task))
    if ours is None or not isinstance(condition.method, MapElites) or condition.budget != ours.budget:
        return None
    return replace(condition, budget=_generations(LONG_MAP))


def best_ever(method: str, task: str, condition: Condition) -> Condition | None:
    """NEAT, HyperNEAT and CMA-ES with robots, with the champion of the best training episode of all generations."""
    for kind, other in ((Neat, BestEverNeat), (HyperNeat, BestEverHyperNeat)):
        if isinstance(condition.method, kind) and isinstance(condition.task, RobotTask):
            return replace(condition, method=as_kind(other, condition.method))
    return _other_cma_es(condition, champion="best_ever")


def _other_cma_es(condition: Condition, **settings: Any) -> Condition | None:
    """Return a condition of CMA-ES with robots, with some settings changed."""
    trained: Any = condition.method
    if not isinstance(trained, CmaEs) or not isinstance(condition.task, RobotTask):
        return None
    kind = OtherSeldomDecomposedCmaEs if isinstance(trained, SeldomDecomposedCmaEs) else OtherCmaEs
    return replace(condition, method=as_kind(kind, trained, **settings))


def layered_16(method: str, task: str, condition: Condition) -> Condition | None:
    """HyperNEAT with a layered substrate of 16 hidden neurons around the simplest robot, too."""
    evolved: Any = condition.method
    if not isinstance(evolved, HyperNeat) or evolved.substrate is None:
        return None
    return replace(condition, method=replace(evolved, substrate=None, hidden=(16,), extent="largest_layer"))


def _millions(of: int) -> Budget:
    return Budget(environment_steps=of * 1_000_000)


def _generations(of: int) -> Budget:
    return Budget(generations=of)


_OBSTACLES: Final = (ecorobot.HIERARCHICAL, ecorobot.MEDIUM, ecorobot.HIGH)
PAPER_TIME: Final = {
    **{("neat", task): _generations(100) for task in (ecorobot.STONES, ecorobot.STONES_ANT)},
    **{("neat", task): _generations(1_000) for task in _OBSTACLES},
    **{("hyperneat", task): _generations(100) for task in (ecorobot.EASY, ecorobot.EASY_ANT)},
    ("ppo", ecorobot.STONES): _millions(550),
    ("goal_ppo", ecorobot.STONES): _millions(50),
    ("ppo", ecorobot.STONES_ANT): _millions(50),
    **{("ppo", task): _millions(750) for task in _OBSTACLES},
    **{("ppo", task): _millions(50) for task in (ecorobot.CHEETAH_RUN, ecorobot.ANT_RUN)},
}
"""Training lengths of April 2025 that differ from the protocol's; those of CMA-ES with robots are not known."""


def paper_time_budgets(method: str, task: str, condition: Condition) -> Condition | None:
    """Robots at full size, trained for as long as the scripts of April 2025 have it."""
    names = method, task
    if names not in PAPER_TIME or condition.budget != ecorobot.FULL[names].budget:
        return None
    return replace(condition, budget=PAPER_TIME[names])


def big_maze_ant(method: str, task: str, condition: Condition) -> Condition | None:
    """The ant among stones in the larger maze."""
    asked: Any = condition.task
    return other_stones(world="big")(method, task, condition) if getattr(asked, "robot", None) == ANT else None


def torso_only(method: str, task: str, condition: Condition) -> Condition | None:
    """The ant among stones sees its torso's place and two velocities, and no joint."""
    asked: Any = condition.task
    if getattr(asked, "robot", None) != ANT:
        return None
    return other_stones(robot=replace(ANT, seen_velocities=2), seen_positions=3)(method, task, condition)


def easy_as_coded(method: str, task: str, condition: Condition) -> Condition | None:
    """The full tier's easy maze, with HyperNEAT's substrate layered: the paper's has no neurons for the way shown."""
    asked: Any = condition.task
    if type(asked) is not DeceptiveMaze or asked.difficulty != "easy":
        return None
    steps = EXAMINED_STEPS if isinstance(condition.method, Ppo) else asked.episode_steps
    coded = as_kind(
        EasyMazeAsCoded,
        asked,
        sensor=EasyMazeAsCoded.sensor,
        robot=replace(asked.robot, seen_velocities=2),
        episode_steps=steps,
    )
    return replace(layered_16(method, task, condition) or condition, task=coded)


def recurrent_24(method: str, task: str, condition: Condition) -> Condition | None:
    """CMA-ES among the full tier's stones, with 24 neurons that feed each other and keep their state."""
    trained: Any = condition.method
    if type(condition.task) is not SteppingStones or not isinstance(trained, CmaEs):
        return None
    if not isinstance(trained.network, AllSkips):
        return None
    network = Recurrent(hidden=trained.network.hidden)
    seldom = SeldomDecomposedCmaEs(trained.population, network)
    remembering = as_kind(RememberingStones, condition.task, remembered=network.hidden)
    return replace(condition, method=seldom, task=remembering)


def other_ppo(**settings: Any) -> Change:
    """Return the change of PPO to `OtherPpo` with some settings; with `first_state` only with robots."""

    def change(method: str, task: str, condition: Condition) -> Condition | None:
        learner: Any = condition.method
        if not isinstance(learner, Ppo) or ("first_state" in settings and not isinstance(condition.task, RobotTask)):
            return None
        kind = OtherFirstLevelPpo if isinstance(learner, FirstLevelPpo) else OtherPpo
        return replace(condition, method=as_kind(kind, learner, **settings))

    return change
