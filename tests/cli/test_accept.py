"""`evoclaims accept`: what becomes an accepted verdict, and that automation cannot accept unseen."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import Evoclaims, Project

from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts import history

FILE = Path("verdicts.toml")
pytestmark = pytest.mark.usefixtures("stored")


def test_the_first_accept_writes_every_verdict_and_ends_with_1(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("accept", "--tier=smoke")
    assert status == 1
    assert out.splitlines()[:2] == [
        "accepted: a (smoke): supported, the first verdict",
        "accepted: b (smoke): refuted, the first verdict",
    ]
    assert f"wrote {FILE.absolute()}: look at the changes and commit them" in out
    kept = history.load(FILE)
    assert {key: entries[-1].outcome for key, entries in kept.items()} == {
        ("smoke", "a"): Outcome.SUPPORTED,
        ("smoke", "b"): Outcome.REFUTED,
    }
    assert kept["smoke", "a"][0].versions["jax"]
    assert kept["smoke", "a"][0].device == "cpu"


def test_a_second_accept_leaves_the_file_as_it_is_and_ends_with_0(accepted: Evoclaims) -> None:
    before = FILE.read_bytes(), FILE.stat().st_mtime_ns
    status, out, _ = accepted("accept", "--tier=smoke")
    assert (status, out) == (0, f"{FILE.absolute()} stays as it is: no verdict differs from the accepted one.\n")
    assert (FILE.read_bytes(), FILE.stat().st_mtime_ns) == before


def test_a_changed_verdict_is_added_to_its_history(accepted: Evoclaims) -> None:
    kept = history.load(FILE)
    old = replace(kept["smoke", "b"][0], outcome=Outcome.SUPPORTED, accepted="2020-01-01")
    FILE.write_text(history.dump({**kept, ("smoke", "b"): (old,)}))
    status, out, _ = accepted("accept", "--tier=smoke")
    assert (status, out.splitlines()[0]) == (1, "accepted: b (smoke): supported -> refuted")
    assert [entry.outcome for entry in history.load(FILE)["smoke", "b"]] == ["supported", "refuted"]


def test_a_claim_that_is_judged_otherwise_begins_a_new_history(accepted: Evoclaims, project: Project) -> None:
    project.write(a="verdict(trials('right', on='parity').solves_every_level.in_most_trials(p0=0.6))", b="refuted")
    status, out, _ = accepted("accept", "--tier=smoke")
    assert (status, out.splitlines()[0]) == (
        1,
        "accepted: a (smoke): supported; a new history begins, since what is judged has changed (it was supported)",
    )
    assert [len(era) for era in history.eras(history.load(FILE)["smoke", "a"])] == [1, 1]


def test_not_run_and_error_never_take_the_place_of_a_verdict(accepted: Evoclaims, project: Project) -> None:
    before = FILE.read_bytes()
    project.write(a="raise RuntimeError('out of order')", b="pytest.skip('not today')")
    status, out, _ = accepted("accept", "--tier=smoke")
    assert (status, FILE.read_bytes()) == (0, before)
    told = re.search(r"left alone: a \(smoke\) is error now \((.*)\): it stays supported, accepted on", out)
    assert told is not None
    assert re.fullmatch(r"RuntimeError: out of order \(claims/test_claims\.py, line \d+\)", told[1])
    assert "left alone: b (smoke) is not run now (its test was skipped (not today)): it stays refuted" in out


def test_histories_of_claims_that_are_gone_are_kept_and_said_in_order(accepted: Evoclaims, project: Project) -> None:
    kept = history.load(FILE)
    gone = [f"gone_{letter}" for letter in "abcdef"]
    FILE.write_text(history.dump({**kept, **{("smoke", name): kept["smoke", "a"] for name in gone}}))
    project.write(a="supported")
    status, out, _ = accepted("accept", "--tier=smoke")
    assert (status, out.splitlines()[0]) == (0, "kept: b (smoke), which is no longer among the claims")
    assert [line.split()[1] for line in out.splitlines() if line.startswith("kept: ")] == ["b", *gone]
    assert ("smoke", "b") in history.load(FILE)
    assert "kept:" not in accepted("accept", "--tier=full")[1]


def test_accepted_verdicts_that_are_torn_are_not_written_over(evoclaims: Evoclaims) -> None:
    FILE.write_text("torn =")
    status, _, err = evoclaims("accept")
    assert (status, FILE.read_text()) == (2, "torn =")
    assert "verdicts.toml holds no accepted verdicts: it is no whole TOML file" in err
