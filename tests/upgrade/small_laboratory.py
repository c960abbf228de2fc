"""A project whose conditions rest on other libraries, as small as they can be with the real methods."""

from __future__ import annotations

from typing import Final

PYPROJECT: Final = """
[tool.evoclaims]
reproduction = "laboratory"

[tool.pytest.ini_options]
testpaths = ["claims"]
"""

LABORATORY: Final = '''
"""CMA-ES of evosax, PPO of brax, flax and optax, and a network of none."""
from pathlib import Path

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.cma_es import CmaEs
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.ppo import Ppo
from evoclaims.networks.mlp import Mlp
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.spec import Budget
from evoclaims.trials.spec import Condition


def condition(method, steps):
    return Condition(method, NParity(2), "whole_budget", Budget(generations=steps, reports=1))


TINY_PPO = Ppo(
    policy_layers=(4,), value_layers=(4,), environments=8, batch_size=8, minibatches=1, updates_per_batch=2,
    learning_rate=0.03,
)
CONDITIONS = {
    ("cma_es", "parity"): condition(CmaEs(population=32, network=Mlp((8,))), 100),
    ("ppo", "parity"): condition(TINY_PPO, 4),
    ("hand_built", "parity"): condition(HandBuilt(), 1),
}
REPRODUCTION = Reproduction(
    name="laboratory",
    title="A Small Laboratory",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(CONDITIONS, Design.fixed(10)), "full": Tier(CONDITIONS, Design.fixed(10))},
)
'''

CLAIMS: Final = """
import pytest
from evoclaims import claim, expected, Outcome
from laboratory import CONDITIONS


@claim("L1", says="It solves its task", where="§1", smoke="It solves its task in small")
@pytest.mark.parametrize("names", CONDITIONS, ids="_on_".join)
def test_it_solves_its_task(names, trials, verdict):
    method, task = names
    verdict(trials(method, on=task).solves_every_level.in_most_trials(p0=0.5))
"""
