"""`evoclaims merge`: what it prints, returns and refuses, and that a project judges what it has brought together."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import Evoclaims, forget, trials_of

from evoclaims.cli.store_folder import open_store
from evoclaims.judging.verdict import Outcome
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport, save


def _report(outcome: Outcome) -> ClaimReport:
    return ClaimReport("a", "", "smoke", "a in small", "§1", outcome, "ten of ten")


@pytest.fixture
def halves(stored: Store) -> tuple[Store, Store]:
    """Two stores, one with the trials of the right network and a verdict, one with those of the wrong one."""
    right, wrong = (Store(Path(shutil.copytree(stored.root, name))) for name in ("right", "wrong"))
    forget(right, trials_of(right, "hand_built_negated"))
    forget(wrong, trials_of(wrong, "hand_built"))
    save(_report(Outcome.SUPPORTED), right.root)
    return right, wrong


@pytest.mark.usefixtures("halves")
def test_stores_are_brought_together_and_judged(evoclaims: Evoclaims) -> None:
    shutil.rmtree(".evoclaims")
    status, out, err = evoclaims("merge", "right", "wrong")
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        f"{name}: trials: 10 copied into .evoclaims, 0 there already, 0 different; "
        f"verdicts: {verdicts} copied; damaged files left out: 0"
        for name, verdicts in (("right", 1), ("wrong", 0))
    ]
    path = Path(".evoclaims/verdicts/smoke/a.json")
    assert ClaimReport.from_json(json.loads(path.read_text())).evidence == str(path)
    _, out, _ = evoclaims("status")
    assert "claims (smoke): 1 supported, 1 refuted" in out
    status, out, _ = evoclaims("merge", "right", "wrong")
    assert (status, out.count("trials: 0 copied"), out.count("10 there already")) == (0, 2, 2)


@pytest.mark.usefixtures("halves")
def test_a_dry_run_makes_no_store(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("merge", "right", "wrong", "--storage=both", "--dry-run")
    assert (status, out.count("trials: 10 to copy into both")) == (0, 2)
    assert not Path("both").exists()


def test_what_differs_is_named_and_stays(evoclaims: Evoclaims, halves: tuple[Store, Store], stored: Store) -> None:
    one = trials_of(stored, "hand_built")[0]
    forget(stored, [one])
    stored.put(replace(one, digest="0" * 64, metrics={**one.metrics, "last_success": 0.5}), {})
    save(_report(Outcome.REFUTED), stored.root)
    status, out, _ = evoclaims("merge", "right")
    assert status == 1
    differs, verdict, total = out.splitlines()
    assert differs.startswith(str(halves[0].record_files(one.id)[-1]))
    assert f"is in {stored.record_files(one.id)[-1]} and stays: metrics (last_success 1.0 and 0.5)" in differs
    assert verdict.endswith("supported, and refuted in .evoclaims/verdicts/smoke/a.json, which stays until claims are "
                            "judged again")  # fmt: skip
    assert "9 there already, 1 different" in total


def test_verdicts_alone_that_differ_are_no_failure(
    evoclaims: Evoclaims, halves: tuple[Store, Store], stored: Store
) -> None:
    save(_report(Outcome.REFUTED), stored.root)
    status, out, _ = evoclaims("merge", "right")
    assert (status, out.count("which stays until claims are judged again")) == (0, 1)


@pytest.mark.usefixtures("halves")
@pytest.mark.parametrize("text", ["torn", '{"claim": "a"}'])
def test_a_damaged_verdict_is_left_out_and_named(text: str, evoclaims: Evoclaims) -> None:
    Path("right/verdicts/smoke/a.json").write_text(text)
    status, out, _ = evoclaims("merge", "right")
    assert status == 1
    assert "right/verdicts/smoke/a.json: it is left out: it holds no verdict" in out
    assert not Path(".evoclaims/verdicts").exists()


@pytest.mark.usefixtures("halves")
def test_a_verdict_in_a_foreign_place_is_left_out(evoclaims: Evoclaims) -> None:
    Path("right/verdicts/smoke/a.json").rename("right/verdicts/smoke/b.json")
    assert evoclaims("merge", "right")[0] == 1
    assert not Path(".evoclaims/verdicts").exists()


@pytest.mark.usefixtures("halves")
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("right", "nowhere"), "There is no trial store 'nowhere': the folder does not exist."),
        (("right", "claims"), "claims is not a trial store: it has no store.json"),
        (("right", ".evoclaims"), ".evoclaims is the store to copy into"),
        (("right", "--storage=claims"), "claims is not a trial store: it has no store.json"),
    ],
)
def test_what_is_no_other_store_is_refused_before_anything_is_copied(
    arguments: tuple[str, ...], text: str, evoclaims: Evoclaims
) -> None:
    before = open_store(".evoclaims").ids()
    status, out, err = evoclaims("merge", *arguments)
    assert (status, out) == (2, "")
    assert text in err
    assert open_store(".evoclaims").ids() == before
