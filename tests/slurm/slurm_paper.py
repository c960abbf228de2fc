"""The paper that runs on SLURM: nine conditions of toy trials, which say what they do in a log and last a while."""

from __future__ import annotations

from pathlib import Path

from tortured_paper import TRIALS
from trial_toys import Walker

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.spec import Budget, Condition

CONDITIONS = {
    (f"walker{number}", "parity"): Condition(
        Walker(chance=0.09 - 0.008 * number, hazard=0.001),
        NParity(4),
        "curriculum",
        Budget(generations=100, reports=50),
    )
    for number in range(9)
}
REPRODUCTION = Reproduction(
    name="slurm",
    title="A Paper That Runs on SLURM",
    folder=Path(__file__).parent,
    tiers={name: Tier(CONDITIONS, Design.fixed(TRIALS)) for name in ("smoke", "full")},
)
