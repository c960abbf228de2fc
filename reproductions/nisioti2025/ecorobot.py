"""Figs. 5 to 10: conditions on ecorobot, at the paper's size ("full") and scaled down ("smoke").

Hyperparameters are from the paper's tables (appendix A); training lengths, which it omits, are from the published code.
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
from reproductions.nisioti2025.waypoints import Waypoints

Conditions = dict[tuple[str, str], Condition]

STONES, STONES_ANT = "stones", "stones_ant"
EASY, EASY_ANT, DIFFICULT = "deceptive_maze_easy", "deceptive_maze_easy_ant", "deceptive_maze_difficult"
HIERARCHICAL, MEDIUM, HIGH = "obstacles", "obstacles_medium", "obstacles_high"
CHEETAH_RUN, ANT_RUN = "locomotion_half_cheetah", "locomotion_ant"

_QUARTER = math.pi / 2
SIMPLE_ROB_SUBSTRATE = Substrate(
    (
        (
            # x, y, heading, and the velocities along x and y: inside the body. Then the rays, where they leave it, from
            # right over front to left. The bias last.
            *((0.5, 0.0), (0.0, 0.5), (0.0, 0.0), (-0.5, 0.0), (0.0, -0.5)),
            *on_circle([-_QUARTER, -_QUARTER / 2, 0.0, _QUARTER / 2, _QUARTER]),
            (-0.25, -0.25),
        ),
        on_circle([2 * math.pi * i / 16 for i in range(16)], radius=0.75),
        on_circle([_QUARTER, 0.0, math.pi, -_QUARTER]),
    )
)
"""Positions of sensors and motors (north, east, west, south) on the robot (the paper's figure of the substrate)."""


@dataclass(frozen=True)
class Size:
    """The settings of one size.

    Attributes:
        maze_steps, robot_steps: steps per episode, in mazes with the simplest robot and for robots with limbs.
        neat, limbed_neat: settings of NEAT with the simplest robot and with robots that have limbs.
        cppn: settings of HyperNEAT's CPPNs.
        cma_es: population of CMA-ES.
        hidden: neurons of the network that CMA-ES trains.
        ppo: PPO.
        map_elites: MAP-Elites.
        budgets: of each method, by task.
    """

    maze_steps: int
    robot_steps: int
    neat: Settings
    limbed_neat: Settings
    cppn: Settings
    cma_es: int
    hidden: int
    ppo: Ppo
    map_elites: MapElites
    budgets: Mapping[str, Mapping[str, Budget]]


def _conditions(size: Size) -> Conditions:
    """Return every condition at a size."""
    stones, ant_stones = SteppingStones(episode_steps=size.maze_steps), _ant(SteppingStones, size)
    tasks: dict[str, RobotTask] = {
        STONES: stones,
        STONES_ANT: ant_stones,
        EASY: DeceptiveMaze(episode_steps=size.maze_steps),
        EASY_ANT: _ant(DeceptiveMaze, size),
        DIFFICULT: DeceptiveMaze(episode_steps=size.maze_steps, difficulty="difficult"),
        HIERARCHICAL: Obstacles(episode_steps=size.robot_steps),
        MEDIUM: Obstacles(episode_steps=size.robot_steps, heights="medium"),
        HIGH: Obstacles(episode_steps=size.robot_steps, heights="high"),
        CHEETAH_RUN: Locomotion(robot=HALF_CHEETAH, episode_steps=size.robot_steps),
        ANT_RUN: _ant(Locomotion, size),
    }
    simple = {name for name, task in tasks.items() if task.robot == SIMPLE_ROB}
    placed = HyperNeat(size.cppn, substrate=SIMPLE_ROB_SUBSTRATE)
    layered = HyperNeat(size.cppn, extent="unit")
    cma_es = CmaEs(population=size.cma_es, network=AllSkips(hidden=size.hidden))
    methods: dict[str, Mapping[str, Method[Any]]] = {
        "neat": {name: Neat(size.neat if name in simple else size.limbed_neat) for name in tasks},
        "hyperneat": {name: placed if name in simple else layered for name in tasks},
        "cma_es": dict.fromkeys(tasks, cma_es),
        "ppo": dict.fromkeys(tasks, size.ppo),
        "goal_ppo": dict.fromkeys(tasks, size.ppo),
        "map_elites": dict.fromkeys(tasks, size.map_elites),
        # Control C3: no learning.
        "random_policy": dict.fromkeys(tasks, RandomPolicy()),
        # Control C4: no training.
        "waypoints": dict.fromkeys(tasks, Waypoints()),
    }
    goals = {STONES: replace(stones, shows_goal=True), STONES_ANT: replace(ant_stones, shows_goal=True)}
    whole = {STONES: replace(stones, shows_goal=True, episode_steps=1_000)}
    seen: dict[str, Mapping[str, RobotTask]] = {"goal_ppo": goals, "waypoints": whole}
    return {
        (method, task): Condition(methods[method][task], seen.get(method, tasks)[task], "whole_budget", budget)
        for method, budgets in size.budgets.items()
        for task, budget in budgets.items()
    }


def _ant(kind: Any, size: Size) -> Any:
    """Return a task for the ant."""
    return kind(robot=ANT, episode_steps=size.robot_steps)


def _generations(**by_task: int) -> Mapping[str, Budget]:
    """Return budgets in generations."""
    return {task: Budget(generations=generations) for task, generations in by_task.items()}


_EVOLVING = Settings(population=1_024, species=Species(most=20))
_LEARNING = Budget(environment_steps=150_000_000)
_LOOK = Budget(generations=1, reports=1)

FULL = _conditions(
    Size(
        maze_steps=1_000,
        robot_steps=1_000,
        neat=_EVOLVING,
        limbed_neat=_EVOLVING,
        cppn=replace(_EVOLVING, activations=CPPN_FUNCTIONS),
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
            "random_policy": {CHEETAH_RUN: _LOOK, ANT_RUN: _LOOK},
            "waypoints": {STONES: _LOOK},
        },
    )
)

_SMALL = Settings(population=32, nodes=32, connections=96, species=Species(most=4, survival=0.2))
_SHORT = Budget(environment_steps=50_000, reports=10)
_SHORTER = Budget(environment_steps=10_000, reports=10)


def _few(generations: int) -> Budget:
    """Return a smoke budget."""
    return Budget(generations=generations, reports=10)


SMOKE = _conditions(
    Size(
        maze_steps=200,
        robot_steps=100,
        neat=_SMALL,
        limbed_neat=replace(_SMALL, nodes=64, connections=320),
        cppn=replace(_SMALL, activations=CPPN_FUNCTIONS),
        cma_es=32,
        hidden=4,
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
        map_elites=MapElites(network=Mlp((16,) * 2), batch=32, initial=32),
        budgets={
            "neat": {
                STONES: _few(8),
                STONES_ANT: _few(3),
                HIERARCHICAL: _few(3),
                MEDIUM: _few(3),
                HIGH: _few(3),
            },
            "hyperneat": {
                STONES: _few(8),
                STONES_ANT: _few(3),
                EASY: _few(8),
                EASY_ANT: _few(3),
                DIFFICULT: _few(8),
                HIERARCHICAL: _few(3),
            },
            "cma_es": {STONES: _few(8), STONES_ANT: _few(3), HIERARCHICAL: _few(3)},
            "ppo": {
                STONES: _SHORT,
                STONES_ANT: _SHORTER,
                EASY: _SHORT,
                HIERARCHICAL: _SHORTER,
                MEDIUM: _SHORTER,
                HIGH: _SHORTER,
                CHEETAH_RUN: _SHORTER,
                ANT_RUN: _SHORTER,
            },
            "goal_ppo": {STONES: _SHORT},
            "map_elites": {STONES: _few(8), DIFFICULT: _few(8)},
            "random_policy": {CHEETAH_RUN: _LOOK, ANT_RUN: _LOOK},
            "waypoints": {STONES: _LOOK},
        },
    )
)
