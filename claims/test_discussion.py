"""§6, and what the paper says of its experiments as a whole."""

import pytest

from evoclaims import Outcome, claim, expected, third_look

AUDIT = "2026-11-26"
"""When an audit made these sentences claims, after all trials had run."""
CMA_ES_ABOVE = expected(Outcome.REFUTED, because="CMA-ES collects more among stones: see S4")
NEAT_GUESSES = expected(Outcome.REFUTED, because="NEAT ends N-parity with half of the rows, as a guess does: see G2")
OVER_TASKS = "it is about the tasks at their own sizes; each task's own claims have smoke tests"


@claim(
    "T1",
    says="architecture search (through NEAT) performing in general on par with CMA-ES",
    where="§6",
    line=445,
    read="success within 0.1, rewards within 500",
    since=AUDIT,
    smoke=None,
    because=OVER_TASKS,
)
@pytest.mark.parametrize(
    "task",
    [
        pytest.param("n_parity", marks=[third_look, NEAT_GUESSES]),
        pytest.param("simple_alu", marks=third_look),
        pytest.param("stones", marks=[third_look, CMA_ES_ABOVE]),
        "obstacles",
    ],
)
def test_neat_is_on_par_with_cma_es(trials, verdict, task):
    neat, cma_es = trials("neat", on=task), trials("cma_es", on=task)
    if task in ("stones", "obstacles"):
        margin = neat.reward_of_a_stone / 2 if task == "stones" else 500
        verdict.reading(
            "rewards within 1,000",
            neat.reward.equivalent_to(cma_es.reward, margin=2 * margin),
            because="a margin that twenty trials can show; O4 reads unchanged as within 500",
            since=AUDIT,
        )
        verdict(neat.reward.equivalent_to(cma_es.reward, margin=margin))
    else:
        verdict.reading(
            "success on average over levels within 0.1",
            neat.mean_success.equivalent_to(cma_es.mean_success, margin=0.1),
            because="the benchmark as a whole, not its last level",
            since=AUDIT,
        )
        verdict(neat.last_success.equivalent_to(cma_es.last_success, margin=0.1))


@claim(
    "T2",
    says="direct encodings fair better in transfer learning",
    where="§6",
    line=445,
    read="more reward than HyperNEAT",
    since=AUDIT,
    smoke=None,
    because=OVER_TASKS,
)
@pytest.mark.parametrize("task", [pytest.param("stones", marks=third_look), "obstacles"])
@pytest.mark.parametrize("direct", ["neat", "cma_es"])
def test_direct_encodings_fare_better_in_transfer_learning(trials, verdict, direct, task):
    """On the gates it is G6."""
    encoded_directly, hyperneat = trials(direct, on=task), trials("hyperneat", on=task)
    further = (
        encoded_directly.stones > hyperneat.stones
        if task == "stones"
        else encoded_directly.obstacles_passed > hyperneat.obstacles_passed
    )
    verdict.reading(
        "more stones, or obstacles", further, because="how far the robot gets is what the tasks test", since=AUDIT
    )
    verdict(encoded_directly.reward > hyperneat.reward)


@claim(
    "T3",
    says="HyperNEAT consistently failing in our transfer learning tasks",
    where="§5.2.3",
    line=425,
    read="solves the first level, not the last",
    since=AUDIT,
    smoke=None,
    because=OVER_TASKS,
)
@pytest.mark.parametrize(
    "task",
    [
        pytest.param(
            "n_parity",
            marks=expected(Outcome.REFUTED, because="most trials solve every level: see G4"),
        ),
        "simple_alu",
    ],
)
def test_hyperneat_fails_at_transfer(trials, verdict, task):
    """With robots it is S2 and T2; that it solves the first level is asked so that learning nothing is no support."""
    hyperneat = trials("hyperneat", on=task)
    verdict(hyperneat.solves_level(0).in_most_trials() & hyperneat.does_not_solve_the_last_level.in_most_trials())
