"""The power of claims: how often each ends as it is expected to, by draws from the pilots of its conditions."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from evoclaims.claims.collected import ClaimTest, selected
from evoclaims.claims.session import Reading, Session, judged
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Look
from evoclaims.judging.judge import fingerprint
from evoclaims.judging.power import Draws, Power, power
from evoclaims.judging.reading import TrialReading
from evoclaims.judging.sample import Source
from evoclaims.judging.verdict import Outcome, Verdict
from evoclaims.paper import pilots
from evoclaims.paper.reproduction import Names, Reproduction
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.result import TrialResult
from evoclaims.verdicts.claim_report import ClaimReport, named


@dataclass(frozen=True)
class Listening(Session):
    """A session that keeps each claim's assertion, and judges none.

    Attributes:
        assertions: by the claim's name; filled in as claims call `verdict(...)`.
    """

    assertions: dict[str, Assertion] = field(default_factory=dict)

    def settle(self, test: ClaimTest, assertion: Assertion, others: Sequence[Reading] = ()) -> ClaimReport:
        """Keep an assertion."""
        name = named(test.claim.id, test.case)
        design = self.design(test.tier, third_look=test.third_look)
        self.assertions[name] = assertion
        mark = fingerprint(assertion, design, claim=name, tier=test.tier)
        verdict = Verdict(Outcome.NOT_RUN, "it is not judged", assertion.describe(), mark)
        return judged(test, assertion, design, verdict, {})


@dataclass(frozen=True)
class Asserted:
    """A claim of a tier, and what it asserts.

    Attributes:
        report: says its name and the expected outcome.
        assertion: None where its test broke before it called `verdict(...)`.
    """

    report: ClaimReport
    assertion: Assertion | None

    @property
    def groups(self) -> dict[Names, TrialGroup]:
        """The conditions that it is about."""
        sources: tuple[Source, ...] = self.assertion.sources() if self.assertion is not None else ()
        return {(group.method, group.task): group for group in sources if isinstance(group, TrialGroup)}

    @property
    def readings(self) -> tuple[TrialReading, ...]:
        """What it reads from their trials."""
        return self.assertion.readings() if self.assertion is not None else ()

    @property
    def expected(self) -> Outcome:
        """The outcome that it should have: the accepted one, or supported."""
        expected = self.report.expected
        return expected if expected is not None and expected.judged else Outcome.SUPPORTED


@dataclass(frozen=True)
class ClaimPower:
    """A claim's power and the outcome that it should have; or, as its `trouble`, why the power cannot be computed."""

    name: str
    expected: Outcome
    power: Power | None
    trouble: str = ""

    @property
    def suffices(self) -> bool:
        """Whether enough draws end as expected."""
        return self.power is not None and self.power.suffices


def asserted(reports: Sequence[ClaimReport], assertions: Mapping[str, Assertion]) -> tuple[Asserted, ...]:
    """Return the claims that have a test at the tier, from the reports of a session that has listened to them."""
    found = (Asserted(report, assertions.get(report.name)) for report in reports)
    return tuple(one for one in found if one.assertion is not None or one.report.outcome is Outcome.ERROR)


def only(claims: Sequence[Asserted], wanted: str | None) -> tuple[Asserted, ...]:
    """Return the claims that a list of ids or names, such as "G1,S2[cma_es]", selects; None selects all.

    Raises:
        UnknownNameError: for a name that no claim has.
    """
    if wanted is None:
        return tuple(claims)
    names = selected(wanted, {name for one in claims for name in (one.report.claim, one.report.name)})
    return tuple(one for one in claims if names & {one.report.claim, one.report.name})


class Pilots:
    """The pilots of a tier: committed trials of its conditions, with other seeds than its own."""

    def __init__(self, reproduction: Reproduction, tier: str, claims: Sequence[Asserted]) -> None:
        """Read the pilots of all conditions that `claims` are about: all claims of the tier.

        Raises:
            UserError: when a pilot cannot be read.
        """
        self._folder, self._tier = reproduction.folder, tier
        self._design = reproduction.tier(tier).design
        self.groups = {names: group for one in claims for names, group in one.groups.items()}
        self._readings: dict[Names, list[TrialReading]] = {names: [] for names in self.groups}
        for one in claims:
            for reading in one.readings:
                if isinstance(reading.source, TrialGroup):
                    self._readings[reading.source.method, reading.source.task].append(reading)
        self.trials: dict[Names, tuple[TrialResult, ...]] = {}
        self._unfit: dict[Names, str] = {}
        for names in self.groups:
            self._read(names)

    def unfit(self, names: Names) -> str:
        """Return a clause that says why a condition has no pilot for the claims; empty if it has one."""
        return self._unfit[names]

    def reads(self, names: Names, trial: TrialResult) -> tuple[str, ...]:
        """Return the names of what claims read of a condition's trial."""
        return pilots.read_of(trial, self._readings[names])

    def write(self, names: Names, trials: Collection[TrialResult]) -> str:
        """Write trials (at least one) as the pilot of a condition, and return the file's path."""
        path = pilots.path_of(self._folder, self._tier, *names)
        pilots.write(path, trials, self._readings[names])
        self._read(names)
        return str(path)

    def _read(self, names: Names) -> None:
        found = pilots.load(pilots.path_of(self._folder, self._tier, *names))
        self._unfit[names] = pilots.unfit(found, self.groups[names].condition, self._design, self._readings[names])
        if self.groups[names].existing is not None:
            self._unfit[names] = "its trials are imported, and there are no others"
        self.trials[names] = found

    def powers(self, claims: Sequence[Asserted], draws: int) -> list[ClaimPower]:
        """Return the power of each claim, by so many draws."""
        sound = {
            self.groups[names].fingerprint: trials for names, trials in self.trials.items() if not self._unfit[names]
        }
        drawn = Draws(sound, draws)
        return [self._power(one, drawn) for one in claims]

    def _power(self, one: Asserted, draws: Draws) -> ClaimPower:
        name, expected = one.report.name, one.expected
        if one.assertion is None:
            return ClaimPower(name, expected, None, f"its test broke: {one.report.reason}")
        without = [f"{' on '.join(names)} ({self._unfit[names]})" for names in one.groups if self._unfit[names]]
        if without:
            return ClaimPower(name, expected, None, f"no pilot of {', '.join(without)}")
        looks = tuple(Look(look.n, look.alpha) for look in one.report.attainable)
        return ClaimPower(name, expected, power(one.assertion, replace(self._design, looks=looks), draws, expected))
