"""Which conditions `evoclaims run` runs, and which trials that ran out of time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
from tiny_project import Evoclaims

from evoclaims.cli.project import open_project
from evoclaims.cli.running import named
from evoclaims.trials.result_making import make_unfinished
from evoclaims.trials.spec import TrialSpec
from evoclaims.trials.store import Store
from reproductions.nisioti2025 import REPRODUCTION


def test_a_method_that_may_not_be_installed_runs_only_when_it_is_named() -> None:
    tier = REPRODUCTION.tier("smoke")
    everything = {method for method, _ in named(tier, None, None)}
    assert "neat" in everything
    assert not {name for name in everything if name.endswith("_tensorneat")}
    assert named(tier, "neat_tensorneat", "n_parity") == [("neat_tensorneat", "n_parity")]


def _out_of_time(variant: str, limit: float) -> None:
    """Store a trial of the right network, seed 0, whose batch had so many seconds."""
    project = open_project(".evoclaims")
    condition = project.reproduction.tier("smoke", variant).condition("right", "parity")
    timing = {"run": 1.0, "compile": 0.0, "batch": 1, "started": "2025-01-01T00:00:00+00:00", "limit": limit}
    project.store.put(make_unfinished(TrialSpec(condition, 0), "timeout", {}, timing, jax.devices("cpu")), {})


def test_without_a_name_what_claims_need_runs_and_nothing_else(project: Any, evoclaims: Evoclaims) -> None:
    left = "Left out: 2 conditions that no claim of the smoke tier needs; names select them, as in coin --on parity.\n"
    _, out, _ = evoclaims("submit", "--dry-run", "--cluster=local")
    assert out.startswith(f"{left}2 batches of the smoke tier")
    status, out, _ = evoclaims("run", "--trials=1")
    assert (status, out.startswith(left)) == (0, True)
    ran = {result.spec["method"]["name"] for result in Store(Path(".evoclaims")).results([])}
    assert ran == {"hand_built", "hand_built_negated"}
    project.write("torn(")
    status, _, err = evoclaims("run")
    assert (status, err.count("Traceback")) == (2, 0)
    assert "cannot be collected: " in err
    assert err.endswith("Without claims only named conditions run, as in right --on parity.\n")


def test_a_trial_that_ran_out_of_as_much_time_runs_again_only_with_retry(evoclaims: Evoclaims) -> None:
    _out_of_time("", 60.0)
    (late,) = Store(Path(".evoclaims")).record_paths()
    command = ("run", "right", "--trials=2", "--time-limit=60s")
    for _ in range(2):
        status, out, _ = evoclaims(*command)
        assert status == 0
        assert "  seed 0: timeout after 0 environment steps: its batch had 1 min" in out
        assert "as much again by --retry" in out
        assert "  seed 1: done" in out
    (done,) = (path for path in Store(Path(".evoclaims")).record_paths() if path != late)
    before = done.read_bytes()
    status, out, _ = evoclaims(*command, "--retry")
    assert status == 0
    assert "  seed 0: done" in out
    assert "timeout" not in out
    assert done.read_bytes() == before  # what came to its end does not run again
    assert "  seed 0: done" in evoclaims(*command)[1]


def test_retry_leaves_a_torn_record_to_its_own_condition_and_runs_the_others(evoclaims: Evoclaims) -> None:
    assert evoclaims("run", "wrong", "--trials=1")[0] == 0
    (torn,) = Store(Path(".evoclaims")).record_paths()
    torn.write_bytes(torn.read_bytes()[:-9])
    _out_of_time("", 60.0)
    status, out, err = evoclaims("run", "--on=parity", "--trials=1", "--time-limit=60s", "--retry")
    assert status == 1
    assert "evoclaims: wrong on parity (smoke) failed: Cannot use " in err
    assert "run `evoclaims verify`, which moves the file aside" in err
    assert "right on parity (smoke)\n  seed 0: done" in out
    assert "timeout" not in out


def test_run_runs_the_seeds_that_it_is_asked_for_and_none_for_the_drift_check(evoclaims: Evoclaims) -> None:
    paper = Path("tiny_paper.py")
    tier, more = "Tier(conditions(1), Design.fixed(10)", ', for_drift={("right", "parity"): 5}'
    paper.write_text(paper.read_text().replace(tier, tier + more))
    for seeds in (["--first-seed=9", "--trials=1"], []):
        assert evoclaims("run", "right", "--on=parity", *seeds)[0] == 0
    assert {result.seed for result in Store(Path(".evoclaims")).results([])} == set(range(10))
