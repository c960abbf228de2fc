"""solves and stays: an event holds with probability at least p0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.exact import binomial_test, clopper_pearson
from evoclaims.judging.reading import EventReading
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import Bound, Interval, PValues


@dataclass(frozen=True)
class MostTrials(Assertion):
    """Base of `Solves` and `Stays`: exact binomial tests of P(event) against p0, in both directions.

    Attributes:
        event: what must hold; it does not hold in a failed trial.
        p0: overrides the design's p0 unless it is None.
    """

    event: EventReading
    p0: float | None = None

    def __post_init__(self) -> None:
        """Reject a probability that cannot be tested."""
        if self.p0 is not None and not 0 < self.p0 < 1:
            raise UserError(f"p0 is {self.p0}. It must be above 0 and below 1 (default 0.7).")

    def describe(self) -> str:
        """Return "E in most trials"."""
        return f"{self.event.describe()} in most trials"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of n successes, and of none."""
        return PValues(self._p(n, n, design).supported, self._p(0, n, design).refuted)

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Bound p by new trials in which the event always or never holds."""
        values = self.event.sample(trials).values
        fewest = round(sum(values))
        never, always = self._p(fewest, n, design), self._p(fewest + n - len(values), n, design)
        return PValues(always.supported, never.refuted), PValues(never.supported, always.refuted)

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run both binomial tests."""
        sample = self.event.sample(trials)
        n, k = len(sample.values), round(sum(sample.values))
        p, attainable = self._p(k, n, design), self.attainable(n, design)
        return self.found(
            p,
            attainable,
            alpha,
            (sample,),
            detail=f"holds in {k} of {n} trials, against p0 = {self._null(design):g}",
            bounds=(Bound("p0", self._null(design)),),
            intervals=lambda: (
                Interval("P(event), Clopper-Pearson, each end at 0.05", *clopper_pearson(k, n), on_axis=True),
            ),
            events=True,
        )

    def _null(self, design: Design) -> float:
        return design.p0 if self.p0 is None else self.p0

    def _p(self, k: int, n: int, design: Design) -> PValues:
        p0 = self._null(design)
        return PValues(binomial_test(k, n, p0, "greater").p, binomial_test(k, n, p0, "less").p)


@dataclass(frozen=True)
class Solves(MostTrials):
    """A goal that most trials reach."""

    kind: ClassVar[str] = "solves"
    entry: ClassVar[Entry] = Entry(
        syntax=(
            "a.solves_every_level.in_most_trials()",
            "a.solves_every_level.in_most_trials(p0=0.5)",
        ),
        null="The event holds with a probability of at most p0 (default: 0.7).",
        supported="A binomial test rejects that. In a trial without a result the event does not hold.",
        refuted="A binomial test rejects that the event holds with a probability of at least p0.",
        source="Clopper and Pearson 1934 (binomial test)",
    )


@dataclass(frozen=True)
class Stays(MostTrials):
    """A bound that most trials keep."""

    kind: ClassVar[str] = "stays"
    entry: ClassVar[Entry] = Entry(
        syntax=("a.solves_no_level_beyond(0).stays()",),
        null="The bound is kept with a probability of at most p0 (default: 0.7).",
        supported="A binomial test rejects that. A trial without a result has not kept the bound.",
        refuted="A binomial test rejects that the bound is kept with a probability of at least p0.",
        source="Clopper and Pearson 1934 (binomial test)",
    )
