"""What the paper says, as tests: each sentence is one."""

from evoclaims import claim


@claim(
    "H1",
    says="Hill climbing balances the pole",
    where="§1",
    smoke="Hill climbing balances the pole for 100 steps or more after 2,000 steps of training",
)
def test_hill_climbing_balances_the_pole(trials, verdict):
    verdict(trials("hill_climber", on="cart").reward.between(100, 500))


@claim(
    "H2",
    says="Hill climbing balances it longer than a first guess",
    where="§2, Figure 1",
    smoke="It does so for longer after 2,000 steps of training",
)
def test_hill_climbing_is_better_than_a_first_guess(trials, verdict):
    verdict(trials("hill_climber", on="cart").reward > trials("first_guess", on="cart").reward)
