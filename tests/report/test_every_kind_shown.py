"""Every kind of assertion is kept, tabled, reported, put to the paper's numbers, and has a power."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from laboratory import CONDITIONS, Laboratory, record
from unpacked import whole

from evoclaims.claims.as_published import AsPublished
from evoclaims.claims.claim import Claim, ClaimTest
from evoclaims.claims.session import Session
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.power import Draws, power
from evoclaims.judging.verdict import Outcome
from evoclaims.report.run_summary import run_summary
from evoclaims.report.terminal_table import verdict_table
from evoclaims.report.trial_summary import Reader
from evoclaims.report.verdict_overview import overview
from evoclaims.report.vocabulary import declared_kinds
from evoclaims.verdicts.claim_report import ClaimReport

SUPPORTED, REFUTED, INCONCLUSIVE = Outcome.SUPPORTED, Outcome.REFUTED, Outcome.INCONCLUSIVE
Make = Callable[..., Assertion]

# Each with the outcome where a is always better than b and c, and where all three are alike.
CLAIMS: dict[str, tuple[Make, Outcome, Outcome]] = {
    "greater": (lambda a, b, c: a.mean_success > b.mean_success, SUPPORTED, INCONCLUSIVE),
    "solves": (lambda a, b, c: a.event("is high", high).in_most_trials(0.5), SUPPORTED, REFUTED),
    "stays": (lambda a, b, c: a.event("is high", high).stays(0.5), SUPPORTED, REFUTED),
    "band": (lambda a, b, c: a.mean_success.between(0.6, 1), SUPPORTED, REFUTED),
    "trend": (lambda a, b, c: a.success.falls(), INCONCLUSIVE, INCONCLUSIVE),
    "equivalent": (lambda a, b, c: a.mean_success.equivalent_to(b.mean_success, margin=0.25), REFUTED, SUPPORTED),
    "exact": (lambda a, b, c: a.event("is high", high).in_every_trial(), SUPPORTED, REFUTED),
    "self-comparison": (lambda a, b, c: a.mean_success.never_above_itself(), SUPPORTED, SUPPORTED),
    "threshold": (lambda a, b, c: a.mean_success > 0.6, SUPPORTED, REFUTED),
    "all of": (
        lambda a, b, c: (a.reward > c.reward) & (2 * b.mean_success < 3 * a.mean_success),
        SUPPORTED,
        INCONCLUSIVE,
    ),
    "any of": (lambda a, b, c: (a.reward > 0.6) | (a.steps_to("success", 0.9) < 7), SUPPORTED, REFUTED),
}
HIGH, LOW = [1.0, 0.95, 0.9, 0.85, 0.8, 0.75], [0.1, 0.2, 0.3, 0.3, 0.2, 0.1]


def high(trial: Any) -> bool:
    return bool(trial.metrics["mean_success"] > 0.6)


def groups(session: Any) -> tuple[Any, ...]:
    return tuple(session(method) for method in ("better", "worse", "neat"))


def stored(lab: Laboratory, *values: list[float]) -> Laboratory:
    """Store three conditions' trials, which have spent their whole budgets."""
    for method, of_method in zip(("better", "worse", "neat"), values, strict=True):
        condition = CONDITIONS[method, "small"]
        steps = (condition.environment_steps / 2, float(condition.environment_steps))
        curves = {"environment_steps": steps, "success": (0.5, 0.5), "level": (1.0, 1.0)}
        lab.put(method, of_method, curves=curves)
    return lab


def test_every_kind_is_here() -> None:
    assert {kind.kind for kind in declared_kinds()} == set(CLAIMS)


@pytest.mark.parametrize("kind", CLAIMS)
def test_each_kind_is_judged_kept_and_shown(lab: Laboratory, kind: str) -> None:
    make, apart, _ = CLAIMS[kind]
    report = stored(lab, HIGH, LOW, LOW).judge(lambda group: make(*groups(group)))
    assert (report.outcome, report.reason) == (apart, report.reason)
    assert report.verdict is not None
    assert report.verdict.evidence
    assert ClaimReport.from_json(report.to_json()) == report
    page = lab.page(report)
    for text in (verdict_table([report], 160, False), run_summary([report]), whole(page)):
        assert str(apart) in text
        assert "NaN" not in text
    table = overview({"full": [report]}, {"T1": "Better is better"}, Reader(lab.archive))
    assert f"**{apart}**" in table
    assert all(strip.n == 6 for part in page.sections[0].parts for strip in part.strips)


@pytest.mark.parametrize("kind", CLAIMS)
def test_each_kind_ends_otherwise_where_conditions_are_alike(lab: Laboratory, kind: str) -> None:
    make, _, alike = CLAIMS[kind]
    assert stored(lab, LOW, LOW, LOW).judge(lambda group: make(*groups(group))).outcome is alike


@pytest.mark.parametrize("kind", CLAIMS)
def test_each_kind_has_a_power(lab: Laboratory, kind: str) -> None:
    make, apart, _ = CLAIMS[kind]
    session = Session(lab.reproduction, lab.store, lambda condition, seeds: [])
    assertion = make(*groups(lambda method: session.group(method, "small", "full")))
    pilot = {
        CONDITIONS[method, "small"].id: tuple(
            record(
                CONDITIONS[method, "small"],
                seed,
                value,
                curves={
                    "environment_steps": (float(CONDITIONS[method, "small"].environment_steps),),
                    "success": (0.5,),
                    "level": (1.0,),
                },
            )
            for seed, value in enumerate(values)
        )
        for method, values in (("better", HIGH), ("worse", LOW), ("neat", LOW))
    }
    found = power(assertion, lab.design, Draws(pilot, 8), apart)
    assert found.draws == 8
    assert found.power > 0.5


PUBLISHED = """
[plots.small.mean_success]
place = "Fig. 1"
methods.better.mean = [0.9]
methods.worse.mean = [0.2]
methods.neat.mean = [0.2]

[plots.small.reward]
place = "Fig. 2"
methods.better.mean = [0.9]
methods.worse.mean = [0.2]
methods.neat.mean = [0.2]
"""
LACKING = {"trend": "no 'success'", "any of": "no 'environment_steps'"}


@pytest.mark.parametrize("kind", CLAIMS)
def test_each_kind_is_put_to_the_papers_own_numbers(lab: Laboratory, kind: str) -> None:
    make, apart, _ = CLAIMS[kind]
    lab.reproduction.folder.mkdir()
    (lab.reproduction.folder / "reported.toml").write_text(PUBLISHED)
    session = Session(replace(lab.reproduction), lab.store, AsPublished(lab.reproduction, "full"))
    assertion = make(*groups(lambda method: session.group(method, "small", "full")))
    report = session.settle(ClaimTest(Claim("T1", "says", "§1", "small"), "full", ""), assertion)
    if kind in LACKING:
        assert report.outcome is Outcome.ERROR
        assert LACKING[kind] in report.reason
    else:
        assert (report.outcome, report.reason) == (apart, report.reason)
