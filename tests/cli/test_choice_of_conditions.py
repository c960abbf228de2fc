"""Which conditions `evoclaims run` runs."""

from __future__ import annotations

import jax
from tiny_project import Evoclaims

from evoclaims.cli.chosen_conditions import named
from evoclaims.cli.project import open_project
from evoclaims.trials.result_making import make_unfinished
from evoclaims.trials.spec import TrialSpec
from reproductions.nisioti2025 import REPRODUCTION


def test_a_method_that_may_not_be_installed_runs_only_when_it_is_named() -> None:
    tier = REPRODUCTION.tier("smoke")
    everything = {method for method, _ in named(tier, None, None)}
    assert "neat" in everything
    assert not {name for name in everything if name.endswith("_tensorneat")}
    assert named(tier, "neat_tensorneat", "n_parity") == [("neat_tensorneat", "n_parity")]


def test_trials_of_a_variant_that_ran_out_of_less_time_are_counted_among_those_to_run(evoclaims: Evoclaims) -> None:
    project = open_project(".evoclaims")
    condition = project.reproduction.tier("smoke", "traded").condition("right", "parity")
    timing = {"run": 1.0, "compile": 0.0, "batch": 1, "started": "2025-01-01T00:00:00+00:00", "limit": 1.0}
    project.store.put(make_unfinished(TrialSpec(condition, 0), "timeout", {}, timing, jax.devices("cpu")), {})
    status, out, _ = evoclaims("run", "--variant=traded", "--trials=1")
    assert status == 0
    assert "  right on parity (smoke): 1 trial to run, time unknown\n" in out
    assert "  seed 0: done" in out
