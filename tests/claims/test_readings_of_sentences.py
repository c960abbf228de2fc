"""Readings of a sentence: judged from stored trials beside the claim's own, dated, and run for nobody."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from evoclaims.claims.claim import Claim, ClaimTest, claim
from evoclaims.claims.collected import VerdictFixture
from evoclaims.claims.fetching import StoredOnly
from evoclaims.claims.session import Session
from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.archive import Archive
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.readings import ReadAs, by_reading, depends

DATED = Claim("T1", "Better is better", "§1", None, line=7, read="on average", since="2026-01-02 12:00")


@pytest.fixture
def judged(reproduction: Reproduction, store: Store, made: Callable[..., TrialResult]) -> Callable[..., ClaimReport]:
    """A function that judges a claim with one more reading from ten stored trials of "better" (0.50 to 0.59)."""
    session = Session(reproduction, store, StoredOnly(Archive(store)))
    better = session.group("better", "small", "full")
    for seed in range(10):
        trial = made(better.condition, seed, 0.5 + seed / 100)
        trial.timing["started"] = f"2026-01-0{2 + seed % 2}T11:30:00+00:00"
        store.put(trial, {})

    def judge(says: Claim, since: str, on: str = "small") -> ClaimReport:
        verdict = VerdictFixture(
            lambda assertion, readings: session.settle(ClaimTest(says, "full", ""), assertion, readings)
        )
        other = session.group("better", on, "full")
        verdict.reading("solves", other.solves_every_level.in_most_trials(), because="a word", since=since)
        verdict(better.mean_success > 0.2)
        assert isinstance(verdict.report, ClaimReport)
        return verdict.report

    return judge


def test_readings_are_judged_beside_the_claims_own(judged: Callable[..., ClaimReport]) -> None:
    report = judged(DATED, "2026-01-02 11:00")
    assert (report.outcome, report.line) == (Outcome.SUPPORTED, 7)
    assert [(one.name, str(one.outcome), one.late) for one in report.readings] == [
        ("on average", "supported", True),
        ("solves", "refuted", False),
    ]
    assert report.readings[0].trials_since == "2026-01-02T11:30:00+00:00"
    assert report.depends_on_the_reading
    assert by_reading(report.readings) == ("depends on the reading: supported as “on average”; refuted as “solves”")


@pytest.mark.parametrize(
    ("since", "late"), [("2026-01-02", False), ("2026-01-02 11:30:01", True), ("2026-01-03", True)]
)
def test_a_reading_is_late_if_it_is_younger_than_its_first_trial(
    judged: Callable[..., ClaimReport], since: str, late: bool
) -> None:
    assert judged(DATED, since).readings[1].late is late


def test_a_reading_whose_trials_are_missing_is_not_run(judged: Callable[..., ClaimReport]) -> None:
    report = judged(DATED, "2026-01-02", on="large")
    assert [str(one.outcome) for one in report.readings] == ["supported", "not run"]
    assert not report.depends_on_the_reading
    assert by_reading(report.readings) == ""


def test_readings_that_end_alike_do_not_matter() -> None:
    alike = [ReadAs(name, "", "", "", Outcome.REFUTED) for name in "abc"]
    assert (by_reading(alike), depends(alike)) == ("refuted under all 3 readings", False)


def test_readings_are_of_the_papers_own_sentence(reproduction: Reproduction, store: Store, says: Claim) -> None:
    session = Session(reproduction, store, StoredOnly(Archive(store)))
    better = session.group("better", "small", "smoke")
    assert session.settle(ClaimTest(says, "smoke", ""), better.mean_success > 0.2).readings == ()


def test_a_reading_that_cannot_be_one_is_a_sentence(reproduction: Reproduction, store: Store, served: Any) -> None:
    session = Session(reproduction, store, served(lambda condition, seed: 0.5))
    better = session.group("better", "small", "full")
    verdict = VerdictFixture(lambda assertion, readings: assertion)
    solves = better.solves_every_level.in_most_trials()
    for name, given, since, said in (
        ("a", True, "2026-01-02", r"The reading 'a' is True, which is not an assertion"),
        (" ", solves, "2026-01-02", r"The reading ' ' needs a unique name"),
        ("a", solves, "yesterday", r"'yesterday' is not a date: write it as 2026-11-26"),
    ):
        with pytest.raises(UserError, match=said):
            verdict.reading(name, given, because="a word", since=since)
    verdict.reading("a", solves, because="a word", since="2026-01-02")
    with pytest.raises(UserError, match=r"The reading 'a' needs a unique name"):
        verdict.reading("a", solves, because="a word", since="2026-01-02")
    verdict(solves)
    with pytest.raises(UserError, match=r"The reading 'b' comes after the verdict"):
        verdict.reading("b", solves, because="a word", since="2026-01-02")
    with pytest.raises(UserError, match=r"'soon' is not a date"):
        claim("T1", says="a", where="b", smoke="c", since="soon")
