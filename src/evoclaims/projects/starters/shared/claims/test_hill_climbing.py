"""What the paper says, as tests: each sentence is one."""

from evoclaims import claim


@claim(
    "H1",
    says="Hill climbing finds the majority of three bits",
    where="§1",
    smoke="Hill climbing finds the majority of three bits within 1,000 generations",
)
def test_hill_climbing_finds_the_majority(trials, verdict):
    verdict(trials("hill_climber", on="majority").last_success_is(1.0).in_most_trials())


@claim(
    "H2",
    says="Random search takes longer",
    where="§2, Figure 1",
    smoke="Random search takes more generations, of at most 1,000",
)
def test_random_search_takes_longer(trials, verdict):
    climber, random = trials("hill_climber", on="majority"), trials("random_search", on="majority")
    verdict(random.measure("steps", better="lower") > climber.measure("steps", better="lower"))
