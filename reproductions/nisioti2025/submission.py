"""The protocol at the time of the paper: what the authors' scripts of April 2025 run, as far as they say it.

Two details among stones the scripts leave open, so that there are four members: what stones pay, and from where they
count. This file was committed before any of its trials ran; that networks with random weights have its stones, too, is
of 2026-11-29.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, Literal

from evoclaims import Budget, Condition
from evoclaims.envs import ANT, RobotTask, SteppingStones
from evoclaims.methods import HyperNeat, Neat
from reproductions.nisioti2025 import ecorobot, stones_details
from reproductions.nisioti2025.other_stones import MetreRanges
from reproductions.nisioti2025.published_course import SURFACE
from reproductions.nisioti2025.stones_details import Change, other_ppo, other_stones
from reproductions.nisioti2025.waypoints import Waypoints

EXAMINED: Final = 100
"""Episodes of an examination with robots."""
CMA_ES_GENERATIONS: Final = 1_000
"""Of CMA-ES among stones: the first that a commit has (July 2025; 4,000 later)."""


def _stones(pays: Literal["each", "once"], within: float) -> Change:
    """Return the change of the tasks with stones."""

    def change(method: str, task: str, condition: Condition) -> Condition | None:
        asked: Any = condition.task
        if not isinstance(asked, SteppingStones) or isinstance(condition.method, Waypoints):
            return None
        told = {"toward": "after_next", "ends": "near_target", "sensor": MetreRanges(), "surface": SURFACE}
        if asked.robot == ANT:
            told |= {"world": "big", "robot": replace(ANT, seen_velocities=2), "seen_positions": 3}
        elif asked.shows_goal:
            told |= {"within": within}
        else:
            told |= {"within": within, "walls": 0.3, "pays": "once" if method == "ppo" else pays}
        return other_stones(examined_episodes=EXAMINED, **told)(method, task, condition)

    return change


def _easy_maze(method: str, task: str, condition: Condition) -> Condition | None:
    """The easy maze as coded, examined as often."""
    now = stones_details.easy_as_coded(method, task, condition)
    return now and replace(now, task=replace(now.task, examined_episodes=EXAMINED))


def _evolution(method: str, task: str, condition: Condition) -> Condition | None:
    """NEAT and HyperNEAT with robots: rates, species, and CPPNs of at most 50 nodes with sigmoids alone."""
    evolved: Any = condition.method
    if not isinstance(evolved, Neat | HyperNeat) or not isinstance(condition.task, RobotTask):
        return None
    ours = evolved.settings
    settings = replace(ours, mutation=replace(ours.mutation, node_add=0.1))
    if isinstance(evolved, HyperNeat):
        settings = replace(settings, activations=("sigmoid",), nodes=50, connections=100)
    else:
        settings = replace(settings, species=replace(ours.species, most=ours.species.most * 50 // 20))
    return replace(condition, method=replace(evolved, settings=settings))


def _budgets(method: str, task: str, condition: Condition) -> Condition | None:
    """Training lengths of the time, at full size."""
    if (method, task) == ("cma_es", ecorobot.STONES) and condition.budget == ecorobot.FULL[method, task].budget:
        return replace(condition, budget=Budget(generations=CMA_ES_GENERATIONS))
    return stones_details.paper_time_budgets(method, task, condition)


def robots(pays: Literal["each", "once"], within: float, given: tuple[Change, ...]) -> Change:
    """Return the change of conditions with robots to a member of the composite, after the changes that are `given`."""
    changes = (
        *given,
        _stones(pays, within),
        _easy_maze,
        _evolution,
        stones_details.layered_16,
        stones_details.best_ever,
        stones_details.common_starts,
        stones_details.one_start_map,
        other_ppo(first_state=True, kept_counters=True, frozen_noise=True),
        _budgets,
    )

    def change(method: str, task: str, condition: Condition) -> Condition | None:
        now = condition
        for one in changes:
            now = one(method, task, now) or now
        return now if isinstance(condition.task, RobotTask) and now is not condition else None

    return change


def gates(method: str, task: str, condition: Condition) -> Condition | None:
    """HyperNEAT on the gates: 5,012 genomes of 50 species, rates, and CPPNs of at most 50 nodes with sigmoids alone."""
    evolved: Any = condition.method
    if not isinstance(evolved, HyperNeat) or isinstance(condition.task, RobotTask):
        return None
    ours = evolved.settings
    settings = replace(
        ours,
        population=5_012 if ours.population == 5_000 else ours.population,
        mutation=replace(ours.mutation, node_add=0.1),
        species=replace(ours.species, on_level_up="keep"),
        activations=("sigmoid",),
        nodes=50,
        connections=100,
    )
    return replace(condition, method=replace(evolved, settings=settings))
