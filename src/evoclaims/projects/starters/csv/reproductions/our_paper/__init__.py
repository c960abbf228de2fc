"""Climbing Hills: which trials are read from which table, by the names that claims use."""

from pathlib import Path

from evoclaims import FIXED_10, Imported, Reproduction, Tier

THEIRS = {
    "seed": "seed",
    "metric": {"steps": "generations", "last_success": "success"},  # by the names that measures read
    "by": "the training loop of `evoclaims new --with loop`",
}
RUNS = {
    (name, "majority"): Imported("runs.csv", where={"method": name}, **THEIRS)
    for name in ("hill_climber", "random_search")
}

REPRODUCTION = Reproduction(
    name="our_paper",
    title="Climbing Hills",
    folder=Path(__file__).parent,
    tiers={"smoke": Tier(RUNS, FIXED_10), "full": Tier(RUNS, FIXED_10)},  # one table has no smaller instance
)
