"""Committed verdicts are what the judge makes of the records, and an independent program with nothing but NumPy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from verdicts_by_numpy import Records, judge, load

from evoclaims.cli import main
from evoclaims.cli.project import open_project
from evoclaims.envs import Circuit
from evoclaims.verdicts import history
from evoclaims.verdicts.claim_report import named
from reproductions.nisioti2025 import REPRODUCTION
from reproductions.nisioti2025.measures import constant_success

LOOKS = {"full": [(5, 0.01), (10, 0.04)], "smoke": [(10, 0.05)]}
THIRD = (30, 0.0095)
"""Of claims that ten trials left open, and that have it."""


@pytest.mark.parametrize("tier", LOOKS)
def test_every_committed_verdict_is_that_of_the_independent_program(
    tier: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    project = open_project(str(tmp_path))
    assertions = {one.test.name: one.assertion for one in project.collect([("", tier)])[0] if one.assertion is not None}
    tasks = {one.id: one.task for one in project.reproduction.tier(tier).conditions.values()}
    ends = {mark: task.observation_size + task.action_size for mark, task in tasks.items()}
    guesses = {mark: constant_success(task)[-1] for mark, task in tasks.items() if isinstance(task, Circuit)}
    records = Records(load(project.reproduction.folder / "reference" / tier), ends, guesses)
    committed = {
        claim: entries[-1]
        for (of, claim), entries in history.load(project.reproduction.folder / history.FILE).items()
        if of == tier
    }
    found = {}
    for claim, entry in committed.items():
        looks = [*LOOKS[tier], *[THIRD] * (entry.n == THIRD[0])]
        outcome, n, (p, *_) = judge(assertions[claim].plain(), records, looks)
        found[claim] = outcome
        if outcome != "inconclusive":  # what more trials could not change ends earlier
            assert n == entry.n, claim
        if n == entry.n and entry.p is not None:
            assert p == pytest.approx(entry.p, rel=1e-9), claim
    assert found == {claim: str(entry.outcome) for claim, entry in committed.items()}
    assert len(found) > 30


def test_committed_trials_give_the_accepted_verdicts_with_the_same_fingerprints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    rows = []
    for tier in REPRODUCTION.tiers:
        assert main(["status", f"--tier={tier}", "--as=json", f"--storage={tmp_path}"]) == 0
        rows += [row for row in json.loads(capsys.readouterr().out)["rows"] if row["outcome"] != "not run"]
    now = {
        (row["tier"], named(row["claim"], row["case"])): (row["outcome"], row["fingerprint"], row["n"], row["p"])
        for row in rows
    }
    assert len(now) > 80
    # SciPy's releases round the last digits of a binomial p differently; other data would change its first ones.
    assert now == {
        key: (last.outcome, last.fingerprint, last.n, last.p and pytest.approx(last.p, rel=1e-12, abs=0))
        for key, (*_, last) in history.load(REPRODUCTION.folder / history.FILE).items()
    }
