"""Claims judged from a paper's own numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from evoclaims.claims.as_published import AsPublished
from evoclaims.claims.claim import Claim, ClaimTest
from evoclaims.claims.session import Session
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.reproduction import Reproduction
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport

Put = Callable[[Callable[[Any], Assertion]], ClaimReport]

REPORTED = """
[plots.small.success]
place = "Fig. 1"
methods.better.mean = [1.0, {last}]
methods.worse.mean = [0.75, 0.5]

[plots.small.reward]
place = "Fig. 2"
methods.better.mean = [5]

[plots.small.steps]
place = "Fig. 3"
methods.better.mean = [70]

[plots.small.covered]
place = "Fig. 4"
methods.better.mean = [0.6]

[plots.small.failures]
place = "Fig. 5"
methods.better.mean = [0.25]

[plots.large.last_success]
place = "§1"
methods.better.mean = [1]
"""


class Stepped(TrialGroup):
    """With measures of the paper's own; the last is computed from what it reads."""

    @property
    def steps(self) -> Any:
        return self.measure("steps", lambda t: t.metrics["environment_steps"], "lower")

    @property
    def covered(self) -> Any:
        return self.measure("covered", lambda t: t.curves["coverage"][-1])

    @property
    def failures(self) -> Any:
        return self.measure("failures", lambda t: 1 - t.metrics["share"], "lower")


@pytest.fixture
def put(reproduction: Reproduction, store: Store, says: Claim) -> Callable[..., ClaimReport]:
    """A function that judges an assertion from the published numbers, of a curve that ends at `last`."""
    reproduction.folder.mkdir()

    def judge(asserted: Callable[[Any], Assertion], last: float = 0.857) -> ClaimReport:
        (reproduction.folder / "reported.toml").write_text(REPORTED.format(last=last))
        paper = replace(reproduction, trials=Stepped)
        session = Session(paper, store, AsPublished(paper, "full"))

        def group(method: str, on: str = "small") -> TrialGroup:
            return session.group(method, on, "full")

        return session.complete(session.settle(ClaimTest(says, "full", ""), asserted(group)), None)

    return judge


def test_a_curve_below_1_does_not_pass_as_solving(put: Callable[..., ClaimReport]) -> None:
    def solves(trials: Any) -> Assertion:
        return trials("better").solves_every_level.in_most_trials()  # type: ignore[no-any-return]

    assert put(solves).outcome is Outcome.REFUTED
    assert put(solves, last=1.0).outcome is Outcome.SUPPORTED


@pytest.mark.parametrize(
    ("asserted", "outcome"),
    [
        (lambda trials: trials("better").success.above(trials("worse").success, beyond=0), Outcome.SUPPORTED),
        (lambda trials: trials("worse").last_success > trials("better").last_success, Outcome.REFUTED),
        (lambda trials: trials("better").success.falls(), Outcome.SUPPORTED),
        (lambda trials: trials("better").furthest_solved.between(0, 0), Outcome.SUPPORTED),
        (lambda trials: trials("worse").solves_level(0).in_most_trials(), Outcome.REFUTED),
        (lambda trials: trials("better").mean_success.between(0.92, 0.93), Outcome.SUPPORTED),
        (lambda trials: trials("better").reward.between(4, 6), Outcome.SUPPORTED),
        (lambda trials: trials("better").steps.between(60, 80), Outcome.SUPPORTED),
        (lambda trials: trials("better").covered.between(0.5, 0.7), Outcome.SUPPORTED),
        (lambda trials: trials("better").failures.between(0.2, 0.3), Outcome.ERROR),
        (lambda trials: trials("better", "large").solves_the_last_level.in_most_trials(), Outcome.SUPPORTED),
    ],
)
def test_each_kind_of_assertion_can_be_put_to_the_numbers(
    put: Callable[..., ClaimReport], asserted: Callable[[Any], Assertion], outcome: Outcome
) -> None:
    assert put(asserted).outcome is outcome


def test_where_the_numbers_do_not_suffice_there_is_no_verdict(put: Callable[..., ClaimReport]) -> None:
    lacking = put(lambda trials: trials("worse").reward.between(0, 1))
    assert (lacking.outcome, "no 'last_fitness'" in lacking.reason) == (Outcome.ERROR, True)
    unknown = put(lambda trials: trials("worse", "large").reward.between(0, 1))
    assert (unknown.outcome, unknown.reason) == (Outcome.NOT_RUN, "no number of worse on large is published")


def test_nothing_is_written(put: Callable[..., ClaimReport], store: Store) -> None:
    assert put(lambda trials: trials("better").success.falls()).evidence == ""
    assert not store.root.exists()
