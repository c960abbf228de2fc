"""band(lo, hi): the median of a measure is in a closed interval."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import ClassVar

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.effect import median_interval
from evoclaims.judging.exact import sign_test
from evoclaims.judging.reading import NumberReading
from evoclaims.judging.sample import Sample, Trials
from evoclaims.judging.verdict import Bound, Interval, PValues


@dataclass(frozen=True)
class Band(Assertion):
    """The median is in the range from `lo` to `hi`. Both are finite, so a failed trial is outside.

    Supported when both one-sided sign tests reject (at n = 10 and alpha = 0.05: at least 9 trials >= lo and at least
    9 <= hi). Refuted when a sign test finds the median below lo or above hi, each at alpha / 2.
    """

    measure: NumberReading
    lo: float
    hi: float
    kind: ClassVar[str] = "band"
    entry: ClassVar[Entry] = Entry(
        syntax=("a.furthest_reached.between(4, 6)",),
        null="The median is below the range, or above it.",
        supported="One sign test rejects that it is below, another that it is above. A trial at an end is inside.",
        refuted="One of two sign tests shows that the median is below the range, or above it, at α/2.",
        source="Dixon and Mood 1946 (sign test); both tests have to reject: Schuirmann 1987",
    )

    def __post_init__(self) -> None:
        """Reject an empty or infinite band."""
        are_numbers = isinstance(self.lo, Real) and isinstance(self.hi, Real)
        if not (are_numbers and -math.inf < self.lo <= self.hi < math.inf):
            raise UserError(
                f"A band must go from a finite number to a higher finite number, not from {self.lo!r} to "
                f"{self.hi!r}. Compare the measure with one number (m > 90), or state a bound as an event "
                "that stays()."
            )
        for end in (self.lo, self.hi):
            self.measure.require_seen(end)

    def describe(self) -> str:
        """Return "the median of A lies in [lo, hi]"."""
        return f"the median of {self.measure.describe()} lies in [{self.lo:g}, {self.hi:g}]"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of all trials inside, and of all trials beyond one end."""
        return PValues(_p((0, 0), (0, 0), n).supported, _p((n, 0), (n, 0), n).refuted)

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Bound p by new trials that are all inside, all below or all above."""
        out, maybe = self._outside(trials)
        new = n - len(trials[self.measure.source.fingerprint])
        inside = _p(out, maybe, n)
        lower, higher = (_p(_plus(out, more), _plus(maybe, more), n) for more in ((new, 0), (0, new)))
        return (
            PValues(inside.supported, min(lower.refuted, higher.refuted)),
            PValues(max(lower.supported, higher.supported), inside.refuted),
        )

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run the sign tests."""
        sample = self.measure.sample(trials)
        out, maybe = self._outside(trials)
        n, (below, above) = len(sample.values), out
        hidden = f"; {sum(maybe) - sum(out)} times an end lies between two reports" if maybe != out else ""
        p, attainable = _p(out, maybe, n), self.attainable(n, design)
        return self.found(
            p,
            attainable,
            alpha,
            (sample,),
            detail=f"{below} below, {n - below - above} inside, {above} above{hidden}",
            bounds=(Bound("lowest", float(self.lo)), Bound("highest", float(self.hi))),
            intervals=lambda: (span_of_median(sample),),
        )

    def _outside(self, trials: Trials) -> tuple[Ends, Ends]:
        """Return how many trials are below and above, and how many may be, as far as their reports show."""
        low, high = self.measure.signs(trials, self.lo), self.measure.signs(trials, self.hi)
        out = low.count(-1), high.count(1)
        return out, _plus(out, (low.count(None), high.count(None)))


Ends = tuple[int, int]
"""Trials below a range, and above it."""


def _plus(one: Ends, other: Ends) -> Ends:
    return one[0] + other[0], one[1] + other[1]


def _p(out: Ends, maybe: Ends, n: int) -> PValues:
    """Return the sign tests' p for a median inside (both must reject) and outside (either may, so doubled)."""
    inside = max(sign_test(n - count, n).p for count in maybe)
    outside = min(sign_test(count, n).p for count in out)
    return PValues(inside, min(1.0, 2 * outside))


def span_of_median(sample: Sample) -> Interval:
    """Return the interval of a sample's median, for description; values beyond a limit count as the limit."""
    limited = "" if sample.limit is None else f", nothing beyond {sample.limit:,.12g}"
    return Interval(f"median, 95% percentile bootstrap{limited}", *median_interval(sample.capped), on_axis=True)
