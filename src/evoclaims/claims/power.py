"""The power of claims: how often each ends as it is expected to, by draws from the pilots of its conditions."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evoclaims.claims.claim_names import selected
from evoclaims.claims.collected import Collected
from evoclaims.judging.power import Draws, Power, power
from evoclaims.judging.reading import TrialReading
from evoclaims.judging.verdict import Outcome
from evoclaims.paper import pilots
from evoclaims.paper.reproduction import Names, Reproduction
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.trials.result import TrialResult


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


def with_test(claims: Sequence[Collected]) -> tuple[Collected, ...]:
    """Return the claims that have a test at the tier; of some, it breaks before it asserts anything."""
    last_runs = {one.test.key: one for one in claims}.values()
    return tuple(one for one in last_runs if one.assertion is not None or one.report.outcome is Outcome.ERROR)


def only(claims: Sequence[Collected], wanted: str | None) -> tuple[Collected, ...]:
    """Return the claims that a list of ids or names, such as "G1,S2[cma_es]", selects; None selects all.

    Raises:
        UnknownNameError: for a name that no claim has.
    """
    if wanted is None:
        return tuple(claims)
    names = selected(wanted, {name for one in claims for name in (one.test.claim.id, one.test.name)})
    return tuple(one for one in claims if names & {one.test.claim.id, one.test.name})


class Pilots:
    """The first or the second pilots of a tier: committed trials of its conditions, with other seeds than its own."""

    def __init__(self, reproduction: Reproduction, tier: str, claims: Sequence[Collected], *, second: bool) -> None:
        """Read the pilots of all conditions that `claims` are about: all claims of the tier.

        Raises:
            UserError: when a pilot cannot be read.
        """
        self._folder, self._tier, self.second = reproduction.folder, tier, second
        self._design = reproduction.tier(tier).design
        self.groups = {names: group for one in claims for names, group in one.groups.items()}
        self._readings: dict[Names, list[TrialReading]] = {names: [] for names in self.groups}
        for one in claims:
            for reading in one.reads:
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
        path = self._path(names)
        pilots.write(path, trials, self._readings[names])
        self._read(names)
        return str(path)

    def _path(self, names: Names) -> Path:
        return pilots.path_of(self._folder, self._tier, *names, second=self.second)

    def _read(self, names: Names) -> None:
        found = pilots.load(self._path(names))
        self._unfit[names] = pilots.unfit(found, self.groups[names].condition, self._design, self._readings[names])
        if self.groups[names].condition.existing:
            self._unfit[names] = "its trials are imported, and there are no others"
        if self.second and not self._unfit[names]:
            self._unfit[names] = pilots.not_second(found, self.other(names))
        self.trials[names] = found

    def other(self, names: Names) -> tuple[TrialResult, ...]:
        """Return the trials of a condition's other pilot: of the first, if these are second ones."""
        return pilots.load(pilots.path_of(self._folder, self._tier, *names, second=not self.second))

    def powers(self, claims: Sequence[Collected], draws: int) -> list[ClaimPower]:
        """Return the power of each claim, by so many draws."""
        sound = {
            self.groups[names].fingerprint: trials for names, trials in self.trials.items() if not self._unfit[names]
        }
        drawn = Draws(sound, draws)
        return [self._power(one, drawn) for one in claims]

    def _power(self, one: Collected, draws: Draws) -> ClaimPower:
        name, expected = one.test.name, one.expected
        if one.assertion is None:
            return ClaimPower(name, expected, None, f"its test broke: {one.report.reason}")
        without = [f"{' on '.join(names)} ({self._unfit[names]})" for names in one.groups if self._unfit[names]]
        if without:
            return ClaimPower(name, expected, None, f"no pilot of {', '.join(without)}")
        design = self._design.with_third_look() if "" in one.test.third_look else self._design
        looks = one.assertion.looks(design)
        return ClaimPower(name, expected, power(one.assertion, replace(self._design, looks=looks), draws, expected))
