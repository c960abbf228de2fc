"""§5.1: what the paper says about the stepping gates (Figs. 3 and 4).

Smoke judges each sentence on a smaller instance: 4-parity and the first three operations of the ALU.
"""

import pytest

from evoclaims import Outcome, claim, expected

TASKS = ["n_parity", "simple_alu"]

PARITY_BY_SINES = expected(
    Outcome.REFUTED, tier="full", because="HyperNEAT, whose CPPNs may use sines, does best of all on N-parity: see G4"
)
NEAT_FORGETS = expected(
    Outcome.REFUTED, tier="full", because="NEAT forgets what it knew on the way up N-parity: see G2"
)
NEAT_NEEDS_TIME = expected(Outcome.REFUTED, tier="smoke", because="NEAT needs more than 300 generations: see G2")
TIED_AT_THREE_LEVELS = expected(
    Outcome.REFUTED,
    tier="smoke",
    because="after 300 generations CMA-ES has two or three of the third level's 14 rows wrong, as PPO or more: "
    "undecided with jax 0.10, refuted with 0.11 (PPO is above in 7 of 10 pairs)",
)
PAIRS = [
    pytest.param("cma_es", "hyperneat", "n_parity", marks=PARITY_BY_SINES),
    ("cma_es", "hyperneat", "simple_alu"),
    ("cma_es", "ppo", "n_parity"),
    pytest.param("cma_es", "ppo", "simple_alu", marks=TIED_AT_THREE_LEVELS),
    pytest.param("neat", "hyperneat", "n_parity", marks=[PARITY_BY_SINES, NEAT_NEEDS_TIME]),
    pytest.param("neat", "hyperneat", "simple_alu", marks=NEAT_NEEDS_TIME),
    pytest.param("neat", "ppo", "n_parity", marks=[NEAT_FORGETS, NEAT_NEEDS_TIME]),
    pytest.param("neat", "ppo", "simple_alu", marks=NEAT_NEEDS_TIME),
]


@claim(
    "G1",
    says="CMA-ES successfully solves all levels for both tasks",
    where="§5.1, Fig. 3",
    smoke="CMA-ES solves all three levels of 4-parity, and the first three levels of Simple ALU",
    expect=Outcome.REFUTED,
    because="local optima: nearly all of the population ties one row short; full: 2 of 10 solve 6-parity, none of 10 "
    "gets past XOR in the ALU. The published code trains a 4 x 32 perceptron instead of the network of appendix A.3, "
    "whose landscape is kinder (docs/protocol.md)",
)
@pytest.mark.parametrize("task", TASKS)
def test_cma_es_solves_every_level(trials, verdict, task):
    cma_es = trials("cma_es", on=task)
    verdict(cma_es.solves_every_level.in_most_trials())


@claim(
    "G2",
    says="NEAT solves N-parity",
    where="§5.1, Fig. 3",
    smoke="NEAT solves all three levels of 4-parity",
)
@expected(
    Outcome.REFUTED,
    tier="full",
    because="ten trials end at levels 1 to 4 and forget earlier ones: on the rows of one level alone, answering always "
    "the same is as good as what solved the level before. Asked the rows of all levels so far, as one published "
    "environment does, NEAT comes to the published curve (docs/protocol.md)",
)
@expected(
    Outcome.REFUTED,
    tier="smoke",
    because="300 generations of 256 genomes are too few: one trial of ten solves the first level",
)
def test_neat_solves_parity(trials, verdict):
    neat = trials("neat", on="n_parity")
    verdict(neat.solves_every_level.in_most_trials())


@claim(
    "G3",
    says="NEAT ... stops at level 5 of the Simple ALU task",
    where="§5.1, Fig. 3",
    smoke="NEAT stops at the first or the second of three levels of Simple ALU",
)
def test_neat_stops_within_the_alu(trials, verdict, claim_tier):
    neat = trials("neat", on="simple_alu")
    lowest, highest = {"full": (4, 6), "smoke": (0, 1)}[claim_tier]
    verdict(neat.furthest_reached.between(lowest, highest) & neat.does_not_solve_the_last_level.in_most_trials())


@claim(
    "G4",
    says="HyperNEAT initially makes some progress, but its performance quickly drops with increasing levels",
    where="§5.1, Fig. 3",
    smoke="HyperNEAT solves the first of three levels, not the last, and its success falls from level to level",
)
@pytest.mark.parametrize(
    "task",
    [
        pytest.param(
            "n_parity",
            marks=expected(
                Outcome.REFUTED,
                because="a CPPN with sines draws parity: at full size 7 of 10 trials solve every level. The published "
                "code lets a CPPN use sigmoids only, unlike the text of §4",
            ),
        ),
        pytest.param(
            "simple_alu",
            marks=expected(Outcome.REFUTED, tier="smoke", because="300 generations are too few for the first level"),
        ),
    ],
)
def test_hyperneat_drops_with_the_levels(trials, verdict, task):
    hyperneat = trials("hyperneat", on=task)
    verdict(
        hyperneat.solves_level(0).in_most_trials()
        & hyperneat.success.falls()
        & hyperneat.does_not_solve_the_last_level.in_most_trials()
    )


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


@claim(
    "G6",
    says="Direct encodings perform best in this benchmark",
    where="§5.1, Fig. 3",
    smoke="CMA-ES and NEAT have more success than HyperNEAT and PPO at the second and the third level",
)
@pytest.mark.parametrize(("direct", "other", "task"), PAIRS)
def test_direct_encodings_perform_best(trials, verdict, direct, other, task):
    encoded_directly = trials(direct, on=task)
    others = trials(other, on=task)
    verdict(encoded_directly.success.above(others.success, beyond=0))


@claim(
    "G8",
    says="NEAT's performance degrades slightly when directly solving 6-parity (without going through the intermediate "
    "levels)",
    where="§5.1, Fig. 4",
    smoke="NEAT has less success on 4-parity without the curriculum than with it, but still at least 0.75",
)
@expected(
    Outcome.REFUTED,
    because="it is the other way round: at full size NEAT ends at 0.69 to 0.98 of the 64 rows without the curriculum, "
    "and at 0.5 with it, since it forgets on the way up (see G2)",
)
def test_neat_degrades_slightly_without_the_curriculum(trials, verdict):
    direct = trials("neat", on="n_parity_direct")
    curriculum = trials("neat", on="n_parity")
    verdict((curriculum.last_success > direct.last_success) & direct.last_success.between(0.75, 1.0))


@claim(
    "G10",
    says="NEAT grows large networks for the stepping gates tasks",
    where="§5.2.1",
    smoke="Most neurons of NEAT's champions are hidden on 4-parity, and on the first three levels of Simple ALU",
)
@pytest.mark.parametrize("task", TASKS)
def test_neat_grows_large_networks(trials, verdict, task):
    neat = trials("neat", on=task)
    verdict(neat.champion_is_mostly_hidden.in_most_trials())


@claim(
    "G10",
    says="NEAT grows large networks for the stepping gates tasks while the networks found for this maze are "
    "surprisingly small",
    where="§5.2.1",
    smoke="In the room with three stones, at most half of the neurons of NEAT's champions are hidden",
)
@expected(Outcome.REFUTED, tier="full", because="the champions have 98 to 100 neurons, as many as the arrays hold")
@pytest.mark.parametrize("task", ["stones"])
def test_neat_s_networks_stay_small_in_the_maze(trials, verdict, task):
    neat = trials("neat", on=task)
    verdict(neat.champion_is_mostly_input_and_output.in_most_trials())
