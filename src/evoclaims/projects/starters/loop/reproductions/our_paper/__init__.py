"""Climbing Hills: what is run at each tier, by the names that claims use."""

from pathlib import Path

from evoclaims import FIXED_10, Budget, Condition, Reproduction, Tier, TrainingLoop
from reproductions.hill_climber import hill_climber
from reproductions.our_paper.majority import Majority

METHODS = {  # packages: what computes a loop beyond numpy, such as ("torch",); raise a loop's revision= when it changes
    "hill_climber": TrainingLoop(hill_climber, packages=()),
    "random_search": TrainingLoop(hill_climber, {"spread": 1.0}, packages=(), name="random_search"),
}
TASKS = {"majority": Majority()}


def conditions(generations: int) -> dict[tuple[str, str], Condition]:
    """Return every method on every task, all with one budget of generations."""
    budget = Budget(generations=generations)
    return {
        (name, on): Condition(method, task, "whole_budget", budget)
        for name, method in METHODS.items()
        for on, task in TASKS.items()
    }


REPRODUCTION = Reproduction(
    name="our_paper",
    title="Climbing Hills",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(conditions(1_000), FIXED_10), "full": Tier(conditions(10_000), FIXED_10)},
)
