"""Shared by the figures: how methods are shown, and the paper's published results."""

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
