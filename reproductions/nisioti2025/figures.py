"""Shared by the figures: how methods are shown, and the paper's published results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from evoclaims.figures import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    BarChart,
    Series,
    compared,
    load_published,
)

NEAT = Series("neat", "NEAT", BLUE)
HYPERNEAT = Series("hyperneat", "HyperNEAT", SKY)
CMA_ES = Series("cma_es", "CMA-ES", GREEN)
PPO = Series("ppo", "PPO", ORANGE)
GOAL_PPO = Series("goal_ppo", "goal PPO", VERMILION)
MAP_ELITES = Series("map_elites", "MAP-Elites", PURPLE)

PUBLISHED = load_published(Path(__file__).with_name("reported.toml"))


def stones_and_rewards(methods: tuple[Series, ...], places: Mapping[str, str]) -> BarChart:
    """Return what Figs. 5 and 9 show of the maze with stepping stones: stones crossed, and rewards.

    Args:
        methods: a bar each.
        places: tasks by what the axis calls them.
    """
    return BarChart(
        (
            compared(
                "stones",
                lambda trials: trials.stones,
                methods,
                places,
                PUBLISHED,
                ylabel="stones crossed",
                limits=(0.0, 7.0),
            ),
            compared("reward", lambda trials: trials.reward, methods, places, PUBLISHED, ylabel="reward of an episode"),
        )
    )
