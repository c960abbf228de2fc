"""What the figures share: the methods as they are shown, and what the paper has published."""

from __future__ import annotations

from pathlib import Path

from evoclaims.figures import reported, style
from evoclaims.figures.bar_panel import Series

NEAT = Series("neat", "NEAT", style.BLUE)
HYPERNEAT = Series("hyperneat", "HyperNEAT", style.SKY)
CMA_ES = Series("cma_es", "CMA-ES", style.GREEN)
PPO = Series("ppo", "PPO", style.ORANGE)
GOAL_PPO = Series("goal_ppo", "goal PPO", style.VERMILION)
MAP_ELITES = Series("map_elites", "MAP-Elites", style.PURPLE)

PUBLISHED = reported.load(Path(__file__).with_name("reported.toml"))
