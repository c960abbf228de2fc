"""equivalent(A, B, margin): two measures lie within a margin of each other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.effect import a12, a12_interval, cliffs_delta
from evoclaims.judging.exact import rank_attainable, rank_test
from evoclaims.judging.kinds.greater import require_independent
from evoclaims.judging.protocol import Protocol
from evoclaims.judging.sample import Source, Trials
from evoclaims.judging.verdict import Evidence, Interval, PValues

if TYPE_CHECKING:
    from evoclaims.judging.measure import Measure


@dataclass(frozen=True)
class Equivalent(Assertion):
    """`left` and `right` differ by less than `margin` (in the measure's unit).

    Supported when both one-sided rank tests reject (A + margin above B, and B above A - margin). Refuted when a rank
    test finds one beyond the margin of the other; there are two such tests, so each is taken at alpha / 2.
    """

    left: Measure
    right: Measure
    margin: float
    kind: ClassVar[str] = "equivalent"

    def __post_init__(self) -> None:
        """Reject a margin that no data could meet, and two measures of the same trials."""
        if not (math.isfinite(self.margin) and self.margin > 0):
            raise UserError(f"The margin of an equivalence is a finite number above 0, unlike {self.margin}.")
        require_independent(self.left, self.right)

    def describe(self) -> str:
        """Return "A is within m of B"."""
        return f"{self.left.describe()} is within {self.margin:g} of {self.right.describe()}"

    def sources(self) -> tuple[Source, ...]:
        """Return both conditions."""
        return (self.left.source, self.right.source)

    def plain(self) -> dict[str, Any]:
        """Return the kind, both measures and the margin."""
        measures = {"left": self.left.plain(), "right": self.right.plain()}
        return {"kind": self.kind, **measures, "margin": float(self.margin)}

    def attainable(self, n: int, protocol: Protocol) -> PValues:
        """Return the p of complete separations; against, doubled for two tests."""
        separated = rank_attainable(n, n)
        return PValues(separated, min(1.0, 2 * separated))

    def find(self, trials: Trials, protocol: Protocol, alpha: float) -> Finding:
        """Run the two tests for and the two tests against."""
        left, right = self.left.sample(trials), self.right.sample(trials)
        a, b = left.values, right.values
        raised = tuple(value + self.margin for value in a)
        lowered = tuple(value - self.margin for value in a)
        inside = (rank_test(raised, b), rank_test(b, lowered))
        outside = (rank_test(b, raised), rank_test(lowered, b))
        p = PValues(max(test.p for test in inside), min(1.0, 2 * min(test.p for test in outside)))
        attainable = PValues(
            max(test.attainable_p for test in inside),
            min(1.0, 2 * min(test.attainable_p for test in outside)),
        )
        evidence = Evidence(
            kind=self.kind,
            describe=self.describe(),
            outcome=p.outcome(alpha),
            samples=(left, right),
            n=len(a),
            alpha=alpha,
            p=p.supported,
            attainable_p=attainable.supported,
            p_refuted=p.refuted,
            attainable_p_refuted=attainable.refuted,
            a12=a12(a, b),
            cliffs_delta=cliffs_delta(a, b),
            intervals=(Interval("A12, 95% percentile bootstrap", *a12_interval(a, b)),),
        )
        return Finding(p, attainable, (evidence,))
