"""threshold: the median of a measure is above, or below, a number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from evoclaims.core.errors import UserError, require_known
from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.exact import sign_test
from evoclaims.judging.kinds.band import span_of_median
from evoclaims.judging.reading import NumberReading
from evoclaims.judging.sample import Sample, Trials
from evoclaims.judging.verdict import Bound, PValues

Side = Literal["above", "below"]

_OPPOSITE: dict[Side, Side] = {"above": "below", "below": "above"}


@dataclass(frozen=True)
class Threshold(Assertion):
    """The median is above a number, or below it.

    A trial at the number counts for neither direction, so that ties decide nothing; nor does one of which its reports
    do not show on which side it is. A trial without a result has the worst value, which may count against the claim
    and never counts for it.
    """

    measure: NumberReading
    side: Side
    number: float
    kind: ClassVar[str] = "threshold"
    entry: ClassVar[Entry] = Entry(
        syntax=("a.reward > 90", "a.reward < 90"),
        null="The median is not on the claimed side of the number.",
        supported="A sign test rejects that. A trial exactly at the number is not on the claimed side.",
        refuted="A sign test shows that the median is on the other side. A trial at the number is not there either.",
        source="Dixon and Mood 1946 (sign test)",
    )

    def __post_init__(self) -> None:
        """Reject an unknown side, and a number that is not finite or beyond what is observed."""
        require_known("side", self.side, _OPPOSITE)
        if not math.isfinite(self.number):
            raise UserError(f"{self.measure.describe()!r} is compared with {self.number}. Use a finite number.")
        self.measure.require_seen(self.number)

    def describe(self) -> str:
        """Return "the median of A is above 90"."""
        return f"the median of {self.measure.describe()} is {self.side} {self.number:.12g}"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of all trials on one side."""
        return sign_tests(n, n, n)

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Bound p by new trials that are all on one side."""
        sample, signs = self.measure.sample(trials), self.measure.signs(trials, self.number)
        toward, away = self._counts(sample, signs)
        new = n - len(signs)
        return sign_tests(toward + new, away + new, n), sign_tests(toward, away, n)

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run both sign tests."""
        sample, signs = self.measure.sample(trials), self.measure.signs(trials, self.number)
        toward, away = self._counts(sample, signs)
        n, decided = len(signs), toward + away
        undecided = f", {n - decided} at it or without a result, which count for neither" if n > decided else ""
        if hidden := signs.count(None):
            undecided += f" (of {hidden} it lies between two reports)"
        return self.found(
            sign_tests(toward, away, n),
            sign_tests(decided, decided, n),
            alpha,
            (sample,),
            detail=f"{toward} of {n} {self.side} {self.number:.12g}, {away} {_OPPOSITE[self.side]}{undecided}",
            bounds=(Bound("number", float(self.number)),),
            intervals=lambda: (span_of_median(sample),),
        )

    def _counts(self, sample: Sample, signs: Sequence[int | None]) -> tuple[int, int]:
        """Return how many trials count for the claim, and how many against it."""
        wanted = 1 if self.side == "above" else -1
        toward = sum(
            sign == wanted and seed not in sample.failed for seed, sign in zip(sample.seeds, signs, strict=True)
        )
        return toward, signs.count(-wanted)


def sign_tests(toward: int, away: int, n: int) -> PValues:
    """Return the p of sign tests each way, of `n` trials of which `toward` count for a claim and `away` against it."""
    return PValues(sign_test(toward, n).p, sign_test(away, n).p)
