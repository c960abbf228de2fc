"""`evoclaims compare`: now against accepted, stores, and the gate that fails on chosen changes."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tiny_project import Evoclaims, aged, forget, out_of_time, spoiled, trials_of

from evoclaims.core.canonical import content_hash
from evoclaims.judging.verdict import Outcome
from evoclaims.paper import references
from evoclaims.trials.result import TrialResult, digest
from evoclaims.trials.store import Store
from evoclaims.verdicts import history

OWN = Path(".evoclaims")
FILE = Path("verdicts.toml")
pytestmark = pytest.mark.usefixtures("stored")


def _edit(**changes: Any) -> None:
    """Change the accepted verdict of `a`."""
    kept = history.load(FILE)
    FILE.write_text(history.dump({**kept, ("smoke", "a"): (replace(kept["smoke", "a"][0], **changes),)}))


def _copy(to: str, change: Callable[[TrialResult], TrialResult] = lambda trial: trial) -> None:
    """Fill a store with the changed trials of the right network."""
    for trial in trials_of(Store(OWN), "hand_built"):
        Store(Path(to)).put(change(replace(trial, champion="")), {})


def _either(trial: TrialResult) -> TrialResult:
    """Return a trial that went well or not, by its seed."""
    metrics = {**trial.metrics, "mean_success": float(trial.seed % 2)}
    new = digest(trial.status, metrics, trial.levels, trial.curves, b"")
    return replace(trial, metrics=metrics, digest=new, champion="")


def test_what_is_as_accepted_is_counted_and_not_listed(accepted: Evoclaims) -> None:
    status, out, _ = accepted("compare", "--tier=smoke", "--fail=*->*")
    assert status == 0
    assert out.splitlines()[:4] == [
        "old: accepted verdicts, and reference trials",
        f"new: judged from the store {OWN}, and from reference trials where it has no better ones",
        "verdicts: 2 the same",
        "trials: 0 comparisons, 0 drifted (by method, permutation tests, Holm, α = 0.01)",
    ]


@pytest.mark.parametrize(
    ("fail", "status"),
    [("refuted->supported", 1), ("*->supported", 1), ("supported->refuted", 0), ("supported->refuted,refuted->*", 1)],
)
def test_a_changed_verdict_fails_only_where_it_is_asked_to(accepted: Evoclaims, fail: str, status: int) -> None:
    _edit(outcome=Outcome.REFUTED)
    ended, out, _ = accepted("compare", f"--fail={fail}")
    assert ended == status
    assert "verdicts: 1 the same, 1 changed" in out
    assert "  a (smoke): refuted -> supported\n" in out
    assert ("FAIL a (smoke): refuted -> supported\n" in out) == bool(status)


def test_a_changed_fingerprint_is_a_new_history_and_no_change(accepted: Evoclaims) -> None:
    _edit(outcome=Outcome.REFUTED, fingerprint="e" * 64)
    status, out, _ = accepted("compare", "--fail=*->*")
    assert status == 0
    assert "  a (smoke): a new history begins, since what is judged has changed (fingerprint eeeeeeeeeeee -> " in out


def test_a_tier_can_be_left_out_of_a_comparison(accepted: Evoclaims) -> None:
    _edit(outcome=Outcome.REFUTED)
    status, out, _ = accepted("compare", "--tier=full", "--fail=*->*")
    assert (status, "a (smoke)" in out) == (0, False)


def test_new_trials_that_drifted_from_the_references_are_said(evoclaims: Evoclaims) -> None:
    path = references.path_of(Path("reference"), "smoke", "right", "parity")
    references.write(path, map(spoiled, trials_of(Store(OWN), "hand_built")))
    evoclaims("accept", "--tier=smoke")
    _, out, _ = evoclaims("compare", "--tier=smoke")
    assert "  DRIFT in smoke/right-parity: mean_success is " in out
    assert "to the bit: 10 trials compared, 10 changed" in out
    assert "  CHANGED in smoke/right-parity: seeds 0, 1, 2, 3, 4, 5, 6, 7, 8, 9\n" in out
    assert "trials of the new side alone: smoke/wrong-parity" in out


def test_trials_that_no_verdict_looks_at_hide_no_drift(evoclaims: Evoclaims) -> None:
    """Fifty of a pilot, which are as the reference trials are."""
    own = trials_of(Store(OWN), "hand_built")
    path = references.path_of(Path("reference"), "smoke", "right", "parity")
    references.write(path, map(spoiled, own))
    for seed in range(100, 150):
        spec = {**own[0].spec, "seed": seed}
        Store(OWN).put(replace(spoiled(own[0]), id=content_hash(spec), spec=spec, seed=seed, champion=""), {})
    evoclaims("accept", "--tier=smoke")
    _, out, _ = evoclaims("compare", "--tier=smoke")
    assert "  DRIFT in smoke/right-parity: mean_success is " in out
    assert "to the bit: 10 trials compared, 10 changed" in out


def test_methods_whose_names_begin_alike_before_a_dash_are_tested_each_for_itself(evoclaims: Evoclaims) -> None:
    for path in (Path("tiny_paper.py"), Path("claims/test_claims.py")):
        text = re.sub("""(["'])right(["'])""", r"\1my-a\2", path.read_text(encoding="utf-8"))
        path.write_text(re.sub("""(["'])wrong(["'])""", r"\1my-b\2", text), encoding="utf-8")
    for name, method in (("my-a", "hand_built"), ("my-b", "hand_built_negated")):
        path = references.path_of(Path("reference"), "smoke", name, "parity")
        references.write(path, map(_either, trials_of(Store(OWN), method)))
    evoclaims("accept", "--tier=smoke")
    _, out, _ = evoclaims("compare", "--tier=smoke")
    assert "trials: 2 comparisons, 0 drifted" in out  # together they would have
    assert " SD in smoke/my-a, smoke/my-b\n" in out


def test_versions_behind_both_sides_are_said_where_a_condition_depends_on_them(evoclaims: Evoclaims) -> None:
    path = references.path_of(Path("reference"), "smoke", "right", "parity")
    own = trials_of(Store(OWN), "hand_built")
    older = {**own[0].provenance["versions"], "jax": "0.0.9", "qdax": "0.0.9"}  # of which it uses the first alone
    references.write(path, [replace(one, provenance={**one.provenance, "versions": older}) for one in own])
    evoclaims("accept", "--tier=smoke")
    _, out, _ = evoclaims("compare", "--tier=smoke")
    now = own[0].provenance["versions"]["jax"]
    assert f"versions changed: jax 0.0.9 -> {now}: smoke/right-parity\n" in out
    assert "qdax" not in out


def test_verdicts_of_now_come_from_reference_trials_where_the_store_has_none(accepted: Evoclaims) -> None:
    for name, method in (("right", "hand_built"), ("wrong", "hand_built_negated")):
        references.write(references.path_of(Path("reference"), "smoke", name, "parity"), trials_of(Store(OWN), method))
    Path("empty").mkdir()
    status, out, _ = accepted("compare", "--storage=empty", "--tier=smoke")
    assert status == 0
    assert "verdicts: 2 the same\n" in out
    assert "trials of the old side alone: smoke/right-parity, smoke/wrong-parity\n" in out


def test_two_stores_are_each_judged_from_their_own_trials(evoclaims: Evoclaims) -> None:
    _copy("sound")
    _copy("spoiled", spoiled)
    path = references.path_of(Path("reference"), "smoke", "wrong", "parity")
    references.write(path, trials_of(Store(OWN), "hand_built_negated"))
    status, out, _ = evoclaims("compare", "sound", "spoiled", "--tier=smoke", "--fail=supported->refuted")
    assert status == 1
    assert out.splitlines()[:3] == ["old: the store sound", "new: the store spoiled", out.splitlines()[2]]
    assert "FAIL a (smoke): supported -> refuted" in out
    assert "  DRIFT in smoke/right-parity: mean_success is " in out
    assert "verdicts: 1 changed, 1 not run, then or now" in out  # the reference trials of `b` are of neither store


def test_an_old_store_is_judged_from_its_own_trials_also_where_reference_trials_are_newer(evoclaims: Evoclaims) -> None:
    _copy("old", lambda trial: aged(spoiled(trial)))
    path = references.path_of(Path("reference"), "smoke", "right", "parity")
    references.write(path, trials_of(Store(OWN), "hand_built"))
    status, out, _ = evoclaims("compare", "./old", "--tier=smoke", "--fail=refuted->supported")
    assert status == 1
    assert "FAIL a (smoke): refuted -> supported" in out
    assert "  DRIFT in smoke/right-parity: mean_success is higher now" in out


def test_trials_that_ran_out_of_time_here_are_no_drift_of_those_that_are_judged(evoclaims: Evoclaims) -> None:
    store, right = Store(OWN), trials_of(Store(OWN), "hand_built")
    references.write(references.path_of(Path("reference"), "smoke", "right", "parity"), map(aged, right))
    assert evoclaims("accept", "--tier=smoke")[0] == 1
    forget(store, right)
    for trial in right:
        store.put(aged(trial), {})
        store.put(out_of_time(trial), {})
    _, out, _ = evoclaims("compare", "--tier=smoke", "--fail=*->*")
    assert "verdicts: 2 the same\n" in out
    assert " comparisons, 0 drifted" in out
    forget(store, right)
    for trial in right:
        store.put(aged(spoiled(trial)), {})
    references.write(references.path_of(Path("reference"), "smoke", "right", "parity"), right)
    _, out, _ = evoclaims("compare", "--tier=smoke", "--fail=*->*")
    assert "verdicts: 2 the same\n" in out  # from the reference trials, which this environment has made
    assert "trials: 0 comparisons, 0 drifted" in out


def test_one_store_is_compared_with_the_projects_own(evoclaims: Evoclaims) -> None:
    _copy("spoiled", spoiled)
    status, out, _ = evoclaims("compare", "./spoiled", "--fail=refuted->supported,not run->refuted", "--tier=smoke")
    assert status == 1
    assert f"new: the store {OWN}" in out
    assert "FAIL a (smoke): refuted -> supported" in out
    assert "FAIL b (smoke): not run -> refuted" in out


def test_a_damaged_record_is_said_and_the_rest_is_compared(evoclaims: Evoclaims) -> None:
    for name in ("one", "other"):
        _copy(name)
    store = Store(Path("other"))
    store.record_files(store.ids()[0])[-1].write_text("torn")
    _, out, _ = evoclaims("compare", "one", "other")
    assert "  a (smoke): supported -> error" in out
    assert f"not read: Cannot use {store.record_files(store.ids()[0])[-1]}: it is not one whole JSON text" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--fail=supported->refutd",), "There is no outcome named 'refutd'. Did you mean 'refuted'?"),
        (("--fail=refuted",), "'refuted' is not a change of a verdict"),
        (("a", "b", "c"), "Two stores can be compared, not 3."),
        (("nothing",), "There is no trial store 'nothing': no folder has this name."),
        (("\x1b[2J",), r"There is no trial store '\x1b[2J'"),
        (("claims",), "claims is not a trial store: it has no store.json, and test_claims.py is in it."),
    ],
)
def test_a_users_mistake_is_one_sentence(accepted: Evoclaims, arguments: tuple[str, ...], said: str) -> None:
    Path("claims/__pycache__").mkdir(exist_ok=True)  # where Python writes bytecode: no name that tells a user anything
    status, _, err = accepted("compare", *arguments)
    assert (status, err.count("\n")) == (2, 1)
    assert said in err


def test_before_the_first_accept_there_is_nothing_to_compare_with(evoclaims: Evoclaims) -> None:
    status, _, err = evoclaims("compare")
    assert status == 2
    assert "No verdict has been accepted yet: run `evoclaims accept` to accept the current ones." in err
