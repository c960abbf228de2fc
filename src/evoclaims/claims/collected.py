"""A claim's test called once for a command: what it passes to `verdict`, and which trials it asks for; none is run."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest

from evoclaims.claims.claim import TIER, ClaimTest, Expectation, gap_of
from evoclaims.claims.fetching import NotStoredError
from evoclaims.claims.report_making import Reading, unjudged
from evoclaims.claims.session import Session
from evoclaims.claims.verdict_fixture import VerdictFixture
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.reading import TrialReading
from evoclaims.judging.sample import Source
from evoclaims.judging.verdict import Outcome
from evoclaims.paper.reproduction import Names
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Condition
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import key_of


@dataclass(frozen=True)
class Collected:
    """A claim's test, after it was called.

    Attributes:
        test: the claim, the tier and the case.
        report: the verdict where it was judged; else why nothing is asserted: the test broke, is skipped or missing.
        reader: the session that judged it during the call; None where nothing did.
        expectation: the accepted outcome.
        skipped: whether the test is skipped, or missing at its tier.
        assertion: what it passes to `verdict(...)`; None where it did not get there.
        readings: further readings of the sentence.
        asked: the trials that it asked for.
        filters: what becomes of warnings in it, by the project's settings and its marks.
    """

    test: ClaimTest
    report: ClaimReport
    reader: Session | None = None
    expectation: Expectation | None = None
    skipped: bool = False
    assertion: Assertion | None = None
    readings: tuple[Reading, ...] = ()
    asked: tuple[TrialGroup, ...] = ()
    filters: tuple[Any, ...] = ()

    @property
    def groups(self) -> dict[Names, TrialGroup]:
        """The conditions that the assertion is about."""
        sources: tuple[Source, ...] = self.assertion.sources() if self.assertion is not None else ()
        return {(group.method, group.task): group for group in sources if isinstance(group, TrialGroup)}

    @property
    def reads(self) -> tuple[TrialReading, ...]:
        """What the assertion reads from their trials."""
        return self.assertion.readings() if self.assertion is not None else ()

    @property
    def expected(self) -> Outcome:
        """The outcome that the claim should have: the accepted one, or supported."""
        accepted = self.expectation
        return accepted.outcome if accepted is not None and accepted.outcome.judged else Outcome.SUPPORTED


def never(condition: Condition, seeds: Sequence[int]) -> Sequence[TrialResult]:
    """Have no trials."""
    raise NotStoredError(f"{condition.label} is not run yet")


@dataclass(frozen=True)
class Recorder(Session):
    """A session that keeps what each test asserts.

    It judges nothing by itself. With a reader, an assertion is judged during its test's call, as a run of pytest does:
    what a measure reads besides trials may be gone when the test has ended.

    Attributes:
        reader: a session that only reads trials.
        tests: what each test judges, by `ClaimTest.key`; filled in before tests are called.
        found: what has been collected so far, in the order of the calls.
    """

    reader: Session | None = None
    tests: dict[tuple[str, str], ClaimTest] = field(default_factory=dict)
    found: list[Collected] = field(default_factory=list)
    _asked: list[TrialGroup] = field(default_factory=list)
    _asserted: list[tuple[ClaimReport, dict[str, Any]]] = field(default_factory=list)

    @staticmethod
    def of(session: Session) -> Recorder:
        """Return a recorder for the protocol of a session, without a reader."""
        return Recorder(session.reproduction, session.store, never, session.trials, session.variant)

    def group(self, method: str, on: str, tier: str) -> TrialGroup:
        """Return trials that are not run, and note that they were asked for."""
        self._asked.append(super().group(method, on, tier))
        return self._asked[-1]

    def settle(self, test: ClaimTest, assertion: Assertion, others: Sequence[Reading] = ()) -> ClaimReport:
        """Keep an assertion, and have it judged by the reader if there is one."""
        if self.reader is not None:
            report = self.reader.settle(test, assertion, others)
        else:
            report = unjudged(test, Outcome.NOT_RUN, "it is not judged")
        kept = {"assertion": assertion, "readings": tuple(others), "filters": tuple(warnings.filters)}
        more = {**kept, "reader": self.reader}
        self._asserted[:] = [(report, more)]
        return report

    def complete(
        self, report: ClaimReport, expectation: Expectation | None, last: ClaimReport | None = None
    ) -> ClaimReport:
        """Note that a test has ended; what it asserts counts unless it broke after that."""
        kept: dict[str, Any] = next((more for settled, more in self._asserted if settled is report), {})
        self._note(report, expectation=expectation, **kept)
        return report

    def skipped(self, report: ClaimReport) -> ClaimReport:
        """Note that a test was skipped."""
        self._note(report, skipped=True)
        return report

    def _note(self, report: ClaimReport, **more: Any) -> None:
        self.found.append(Collected(self.tests[key_of(report)], report, asked=tuple(self._asked), **more))
        self._asked.clear()
        self._asserted.clear()

    def has_conditions_of(self, one: Collected) -> bool:
        """Whether a test, called under this protocol, would ask for the same conditions and so assert the same."""
        conditions = self.reproduction.tier(one.test.tier, self.variant).conditions
        return one.assertion is not None and all(
            (known := conditions.get((group.method, group.task))) is not None and known.id == group.fingerprint
            for group in (*one.asked, *one.groups.values())
        )

    def call(self, item: pytest.Item, test: ClaimTest) -> Collected:
        """Call a test within the run of pytest that it belongs to, without the fixtures and marks of the run.

        Nothing is asserted by a test with fixtures of its own, which are for the run itself. What a test raises is
        reported when it is run.
        """

        def trials(method: str, *, on: str) -> TrialGroup:
            return self.group(method, on, test.tier)

        verdicts = VerdictFixture(lambda assertion, others: self.settle(test, assertion, others))
        function: Callable[..., Any] = item.obj  # type: ignore[attr-defined]
        given = {**item.callspec.params, TIER: test.tier, "trials": trials, "verdict": verdicts}  # type: ignore[attr-defined]
        names = inspect.signature(function).parameters
        if not gap_of(item, test.tier) and set(names) <= set(given):
            try:
                with warnings.catch_warnings(action="ignore"):
                    function(**{name: given[name] for name in names})
            except KeyboardInterrupt:
                raise
            except BaseException:  # noqa: S110  (pytest's own outcomes, such as a skip, are no `Exception`)
                pass
            renew(item)
        self.tests[test.key] = test
        self.complete(verdicts.report or unjudged(test, Outcome.NOT_RUN, "it asserts nothing"), None)
        return self.found[-1]


def renew(item: pytest.Item) -> None:
    """Let a test that is called again have a new object of its class."""
    if isinstance(item.parent, pytest.Class):
        vars(item).pop("_instance", None)
        vars(item).pop("_obj", None)
