"""Which conditions `evoclaims run` runs."""

from __future__ import annotations

from evoclaims.cli.run import choose
from reproductions.nisioti2025 import REPRODUCTION


def test_a_method_that_may_not_be_installed_runs_only_when_it_is_named() -> None:
    tier = REPRODUCTION.tier("smoke")
    everything = {method for method, _ in choose(tier, None, None)}
    assert "neat" in everything
    assert not {name for name in everything if name.endswith("_tensorneat")}
    assert choose(tier, "neat_tensorneat", "n_parity") == [("neat_tensorneat", "n_parity")]
