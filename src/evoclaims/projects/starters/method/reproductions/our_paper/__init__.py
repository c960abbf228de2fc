"""Climbing Hills: what is run at each tier, by the names that claims use."""

from pathlib import Path

from evoclaims import FIXED_10, Budget, Condition, Reproduction, Tier
from evoclaims.methods import RandomSearch
from evoclaims.networks import Mlp
from reproductions.our_paper.hill_climber import HillClimber
from reproductions.our_paper.majority import Majority

METHODS = {"hill_climber": HillClimber(), "random_search": RandomSearch(population=1, network=Mlp((8,)))}
TASKS = {"majority": Majority()}


def conditions(generations: int) -> dict[tuple[str, str], Condition]:
    """Return every method on every task, all with one budget of generations."""
    budget = Budget(generations=generations)
    return {
        (name, on): Condition(method, task, "direct", budget)
        for name, method in METHODS.items()
        for on, task in TASKS.items()
    }


REPRODUCTION = Reproduction(
    name="our_paper",
    title="Climbing Hills",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(conditions(1_000), FIXED_10), "full": Tier(conditions(10_000), FIXED_10)},
)
