"""Balancing a Pole: what is run at each tier, by the names that claims use."""

from pathlib import Path

from evoclaims import FIXED_10, Budget, Condition, Reproduction, Tier, TrainingLoop
from evoclaims.envs import GymnasiumTask
from reproductions.hill_climber import hill_climber

METHODS = {  # packages: what computes a loop beyond numpy, such as ("torch",); raise a loop's revision= when it changes
    "hill_climber": TrainingLoop(hill_climber, packages=()),
    "first_guess": TrainingLoop(hill_climber, {"spread": 0.0}, packages=(), name="first_guess"),
}
TASKS = {"cart": GymnasiumTask("CartPole-v1", solved_at=475)}


def conditions(steps: int) -> dict[tuple[str, str], Condition]:
    """Return every method on every task, all with one budget of environment steps."""
    budget = Budget(environment_steps=steps)
    return {
        (name, on): Condition(method, task, "whole_budget", budget)
        for name, method in METHODS.items()
        for on, task in TASKS.items()
    }


REPRODUCTION = Reproduction(
    name="our_paper",
    title="Balancing a Pole",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(conditions(2_000), FIXED_10), "full": Tier(conditions(20_000), FIXED_10)},
)
