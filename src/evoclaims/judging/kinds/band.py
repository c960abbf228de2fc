"""band(lo, hi): the median of a measure is in a closed interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import ClassVar

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.effect import median_interval
from evoclaims.judging.exact import sign_test
from evoclaims.judging.reading import NumberReading
from evoclaims.judging.sample import Sample, Trials, beyond
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
        return PValues(_p(0, 0, n).supported, _p(n, 0, n).refuted)

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Bound p by new trials that are all inside, all below or all above."""
        values = self.measure.sample(trials).values
        below, above = self._outside(values)
        new = n - len(values)
        inside, lower, higher = _p(below, above, n), _p(below + new, above, n), _p(below, above + new, n)
        return (
            PValues(inside.supported, min(lower.refuted, higher.refuted)),
            PValues(max(lower.supported, higher.supported), inside.refuted),
        )

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run the sign tests."""
        sample = self.measure.sample(trials)
        below, above = self._outside(sample.values)
        n = len(sample.values)
        p, attainable = _p(below, above, n), self.attainable(n, design)
        return self.found(
            p,
            attainable,
            alpha,
            (sample,),
            detail=f"{below} below, {n - below - above} inside, {above} above",
            bounds=(Bound("lowest", float(self.lo)), Bound("highest", float(self.hi))),
            intervals=lambda: (span_of_median(sample),),
        )

    def _outside(self, values: Sequence[float]) -> tuple[int, int]:
        return sum(beyond(value, self.lo) < 0 for value in values), sum(beyond(value, self.hi) > 0 for value in values)


def _p(below: int, above: int, n: int) -> PValues:
    """Return the sign tests' p for a median inside (both must reject) and outside (either may, so doubled)."""
    inside = max(sign_test(n - below, n).p, sign_test(n - above, n).p)
    outside = min(sign_test(below, n).p, sign_test(above, n).p)
    return PValues(inside, min(1.0, 2 * outside))


def span_of_median(sample: Sample) -> Interval:
    """Return the interval of a sample's median, for description; values beyond a limit count as the limit."""
    limited = "" if sample.limit is None else f", nothing beyond {sample.limit:,.12g}"
    return Interval(f"median, 95% percentile bootstrap{limited}", *median_interval(sample.capped), on_axis=True)
