"""What the figures share: the methods as they are shown, and what the paper has published."""

from __future__ import annotations

from pathlib import Path

from evoclaims.figures import BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, Series, load_published

NEAT = Series("neat", "NEAT", BLUE)
HYPERNEAT = Series("hyperneat", "HyperNEAT", SKY)
CMA_ES = Series("cma_es", "CMA-ES", GREEN)
PPO = Series("ppo", "PPO", ORANGE)
GOAL_PPO = Series("goal_ppo", "goal PPO", VERMILION)
MAP_ELITES = Series("map_elites", "MAP-Elites", PURPLE)

PUBLISHED = load_published(Path(__file__).with_name("reported.toml"))
