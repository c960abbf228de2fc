"""Figs. 5 to 10: conditions on ecorobot, at the paper's size ("full") and scaled down ("smoke").

Hyperparameters are from the paper's tables (appendix A), MAP-Elites' training length too, as docs/protocol.md reads it.
Those of the others, which it omits, are from the published code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from evoclaims import Budget, Condition
from evoclaims.envs import (
    ANT,
    HALF_CHEETAH,
    SIMPLE_ROB,
    DeceptiveMaze,
    Locomotion,
    Obstacles,
    RobotTask,
    SteppingStones,
)
from evoclaims.methods import (
    CPPN_FUNCTIONS,
    CmaEs,
    HyperNeat,
    LevelTest,
    MapElites,
    Method,
    Neat,
    Ppo,
    RandomPolicy,
)
from evoclaims.methods.neat import Settings, Species
from evoclaims.networks import AllSkips, Mlp, Substrate, on_circle
from reproductions.nisioti2025.small_worlds import SmallDeceptiveMaze, ThreeStones
from reproductions.nisioti2025.waypoints import Waypoints

Conditions = dict[tuple[str, str], Condition]

STONES, STONES_ANT = "stones", "stones_ant"
EASY, EASY_ANT, DIFFICULT = "deceptive_maze_easy", "deceptive_maze_easy_ant", "deceptive_maze_difficult"
HIERARCHICAL, MEDIUM, HIGH = "obstacles", "obstacles_medium", "obstacles_high"
CHEETAH_RUN, ANT_RUN = "locomotion_half_cheetah", "locomotion_ant"

_QUARTER = math.pi / 2


def simple_rob_substrate(hidden: int) -> Substrate:
    """Return positions of sensors and motors (north, east, west, south) on the robot (Fig. 11), and of hidden neurons.

    Where those are is arbitrary, says its caption.
    """
    sensors = (
        # x, y, heading, and the velocities along x and y: inside the body. Then the rays, where they leave it, from
        # right over front to left. The bias last.
        *((0.5, 0.0), (0.0, 0.5), (0.0, 0.0), (-0.5, 0.0), (0.0, -0.5)),
        *on_circle([-_QUARTER, -_QUARTER / 2, 0.0, _QUARTER / 2, _QUARTER]),
        (-0.25, -0.25),
    )
    around = on_circle([2 * math.pi * i / hidden for i in range(hidden)], radius=0.75)
    return Substrate((sensors, around, on_circle([_QUARTER, 0.0, math.pi, -_QUARTER])))


@dataclass(frozen=True)
class Size:
    """The settings of one size.

    Attributes:
        tasks: by the names that claims use.
        neat, limbed_neat: settings of NEAT with the simplest robot and with robots that have limbs.
        cppn: settings of HyperNEAT's CPPNs.
        around: hidden neurons of HyperNEAT's networks around the simplest robot (others have 16).
        cma_es: population of CMA-ES.
        hidden: neurons of the network that CMA-ES trains.
        ppo: PPO.
        map_elites: MAP-Elites.
        budgets: of each method, by task.
    """

    tasks: Mapping[str, RobotTask]
    neat: Settings
    limbed_neat: Settings
    cppn: Settings
    around: int
    cma_es: int
    hidden: int
    ppo: Ppo
    map_elites: MapElites
    budgets: Mapping[str, Mapping[str, Budget]]


def _tasks(
    stones: type[SteppingStones], maze: type[DeceptiveMaze], obstacles: type[Obstacles], *, steps: int
) -> dict[str, RobotTask]:
    """Return the tasks in worlds of these kinds, with episodes of as many steps."""
    return {
        STONES: stones(episode_steps=steps),
        STONES_ANT: stones(robot=ANT, episode_steps=steps),
        EASY: maze(episode_steps=steps),
        EASY_ANT: maze(robot=ANT, episode_steps=steps),
        DIFFICULT: maze(episode_steps=steps, difficulty="difficult"),
        HIERARCHICAL: obstacles(episode_steps=steps),
        MEDIUM: obstacles(episode_steps=steps, heights="medium"),
        HIGH: obstacles(episode_steps=steps, heights="high"),
        CHEETAH_RUN: Locomotion(robot=HALF_CHEETAH, episode_steps=steps),
        ANT_RUN: Locomotion(robot=ANT, episode_steps=steps),
    }


def _conditions(size: Size) -> Conditions:
    """Return every condition at a size."""
    tasks = size.tasks
    simple = {name for name, task in tasks.items() if task.robot == SIMPLE_ROB}
    placed = HyperNeat(size.cppn, substrate=simple_rob_substrate(hidden=size.around))
    layered = HyperNeat(size.cppn, extent="unit")
    cma_es = CmaEs(population=size.cma_es, network=AllSkips(hidden=size.hidden))
    methods: dict[str, Mapping[str, Method[Any]]] = {
        "neat": {name: Neat(size.neat if name in simple else size.limbed_neat) for name in tasks},
        "hyperneat": {name: placed if name in simple else layered for name in tasks},
        "cma_es": dict.fromkeys(tasks, cma_es),
        "ppo": dict.fromkeys(tasks, size.ppo),
        "goal_ppo": dict.fromkeys(tasks, size.ppo),
        "map_elites": dict.fromkeys(tasks, size.map_elites),
        # Control C3, and a null agent: no learning.
        "random_policy": dict.fromkeys(tasks, RandomPolicy()),
        # Control C4: no training.
        "waypoints": dict.fromkeys(tasks, Waypoints()),
    }
    goals = {name: replace(task, shows_goal=True) for name, task in tasks.items() if isinstance(task, SteppingStones)}
    seen: dict[str, Mapping[str, RobotTask]] = {
        "goal_ppo": goals,
        "waypoints": {STONES: SteppingStones(shows_goal=True)},
    }
    return {
        (method, task): Condition(methods[method][task], seen.get(method, tasks)[task], "whole_budget", budget)
        for method, budgets in size.budgets.items()
        for task, budget in budgets.items()
    }


def _generations(**by_task: int) -> Mapping[str, Budget]:
    """Return budgets in generations."""
    return {task: Budget(generations=generations) for task, generations in by_task.items()}


_EVOLVING = Settings(population=1_024, species=Species(most=20))
_LEARNING = Budget(environment_steps=150_000_000)
_LOOK = Budget(generations=1, reports=1)

FULL = _conditions(
    Size(
        tasks=_tasks(SteppingStones, DeceptiveMaze, Obstacles, steps=1_000),
        neat=_EVOLVING,
        limbed_neat=_EVOLVING,
        cppn=replace(_EVOLVING, activations=CPPN_FUNCTIONS),
        around=32,
        cma_es=256,
        hidden=24,
        ppo=Ppo(
            policy_layers=(32,) * 4,
            unroll_length=5,
            discounting=0.97,
            reward_scaling=10.0,
            normalize_observations=True,
            level_test=LevelTest(every=0),
        ),
        map_elites=MapElites(),
        budgets={
            "neat": _generations(
                stones=2_000, stones_ant=2_000, obstacles=500, obstacles_medium=500, obstacles_high=500
            ),
            "hyperneat": _generations(
                stones=100,
                stones_ant=100,
                deceptive_maze_easy=1_000,
                deceptive_maze_easy_ant=1_000,
                deceptive_maze_difficult=1_000,
                obstacles=1_000,
            ),
            "cma_es": _generations(stones=4_000, stones_ant=4_000, obstacles=1_000),
            "ppo": dict.fromkeys(
                (STONES, STONES_ANT, EASY, HIERARCHICAL, MEDIUM, HIGH, CHEETAH_RUN, ANT_RUN), _LEARNING
            ),
            "goal_ppo": {STONES: _LEARNING},
            "map_elites": _generations(stones=1_000, deceptive_maze_difficult=1_000),
            "random_policy": dict.fromkeys(
                (STONES, STONES_ANT, EASY, EASY_ANT, DIFFICULT, HIERARCHICAL, MEDIUM, HIGH, CHEETAH_RUN, ANT_RUN), _LOOK
            ),
            "waypoints": {STONES: _LOOK},
        },
    )
)

_SMALL = Settings(population=64, nodes=32, connections=96, species=Species(most=4, survival=0.2))
_SHORT = Budget(environment_steps=160_000, reports=10)
_SHORTER = Budget(environment_steps=64_000, reports=10)
_SHORTEST = Budget(environment_steps=10_000, reports=10)


def _few(generations: int) -> Budget:
    """Return a smoke budget."""
    return Budget(generations=generations, reports=10)


SMOKE = _conditions(
    Size(
        tasks=_tasks(ThreeStones, SmallDeceptiveMaze, Obstacles, steps=100),
        neat=replace(_SMALL, population=128),
        limbed_neat=replace(_SMALL, nodes=64, connections=320),
        cppn=replace(_SMALL, activations=CPPN_FUNCTIONS),
        around=16,
        cma_es=128,
        hidden=12,
        ppo=Ppo(
            policy_layers=(32,) * 2,
            value_layers=(32,) * 2,
            environments=32,
            unroll_length=5,
            batch_size=32,
            minibatches=8,
            learning_rate=3e-3,
            discounting=0.97,
            reward_scaling=10.0,
            normalize_observations=True,
            level_test=LevelTest(every=0),
        ),
        map_elites=MapElites(network=Mlp((16,) * 2), batch=128, initial=128, iso_sigma=0.1, line_sigma=0.2),
        budgets={
            "neat": {
                STONES: _few(25),
                STONES_ANT: _few(10),
                HIERARCHICAL: _few(3),
                MEDIUM: _few(3),
                HIGH: _few(3),
            },
            "hyperneat": {
                STONES: _few(20),
                STONES_ANT: _few(10),
                EASY: _few(8),
                EASY_ANT: _few(3),
                DIFFICULT: _few(100),
                HIERARCHICAL: _few(3),
            },
            "cma_es": {STONES: _few(8), STONES_ANT: _few(5), HIERARCHICAL: _few(3)},
            "ppo": {
                STONES: _SHORT,
                STONES_ANT: _SHORTER,
                EASY: _SHORT,
                HIERARCHICAL: _SHORTEST,
                MEDIUM: _SHORTEST,
                HIGH: _SHORTEST,
                CHEETAH_RUN: _SHORTEST,
                ANT_RUN: _SHORTEST,
            },
            "goal_ppo": {STONES: _SHORT},
            "map_elites": {STONES: _few(8), EASY: _few(100), DIFFICULT: _few(100)},
            "random_policy": {STONES: _LOOK, CHEETAH_RUN: _LOOK, ANT_RUN: _LOOK},
            "waypoints": {STONES: _LOOK},
        },
    )
)
