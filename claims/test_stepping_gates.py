"""§5.1: what the paper says about the stepping gates (Figs. 3 and 4).

Smoke judges each sentence on a smaller instance: 4-parity and the first three operations of the ALU.
"""

import pytest

from evoclaims import Outcome, claim, expected

TASKS = ["n_parity", "simple_alu"]


@claim(
    "G1",
    says="CMA-ES successfully solves all levels for both tasks",
    where="§5.1, Fig. 3",
    smoke="CMA-ES solves all three levels of 4-parity, and the first three levels of Simple ALU",
    expect=Outcome.REFUTED,
    because="most trials end in a local optimum, why is not known; full: 2 of 10 solve 6-parity, none of 10 gets past "
    "XOR in the ALU",
)
@pytest.mark.parametrize("task", TASKS)
def test_cma_es_solves_every_level(trials, verdict, task):
    cma_es = trials("cma_es", on=task)
    verdict(cma_es.solves_every_level.in_most_trials())


@claim(
    "G5",
    says="PPO only reached the first level of both tasks",
    where="§5.1, Fig. 3",
    smoke="PPO solves no level but the first of 4-parity, and of the first three levels of Simple ALU",
)
@expected(
    Outcome.REFUTED,
    tier="smoke",
    because="the smaller tasks let more than half of the trials past the first level; full is undecided, with 5 of 10 "
    "and 4 of 10 trials staying there",
)
@pytest.mark.parametrize("task", TASKS)
def test_ppo_stays_at_the_first_level(trials, verdict, task):
    ppo = trials("ppo", on=task)
    verdict(ppo.solves_no_level_beyond(0).stays())


@claim(
    "G7",
    says="When directly solving 6-parity (without going through the intermediate levels) PPO solves the task",
    where="§5.1, Fig. 4",
    smoke="When directly solving 4-parity, PPO solves it",
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="2 of 10 trials answer all 64 rows, the others end at 0.73 to 0.98: near the paper's perfect success, not "
    "at it; Brax's own training loop ends likewise, 2 of 10 (docs/performance.md)",
)
def test_ppo_solves_parity_without_the_curriculum(trials, verdict):
    ppo = trials("ppo", on="n_parity_direct")
    verdict(ppo.solves_the_last_level.in_most_trials())


@claim(
    "G9",
    says="The issue does not lie in the capacity of PPO but in its inability to progress through the levels of our "
    "curriculum",
    where="§5.1, Fig. 4",
    smoke="PPO does better on 4-parity without the curriculum than with it",
)
def test_ppo_is_better_without_the_curriculum(trials, verdict):
    direct = trials("ppo", on="n_parity_direct")
    curriculum = trials("ppo", on="n_parity")
    verdict(direct.last_success > curriculum.last_success)
