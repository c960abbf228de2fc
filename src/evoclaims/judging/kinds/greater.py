"""greater(A, B): a measure of A lies above the same measure of B."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.effect import a12, a12_interval, cliffs_delta
from evoclaims.judging.exact import ExactTest, binomial_test, rank_attainable, rank_test
from evoclaims.judging.protocol import Protocol
from evoclaims.judging.sample import Source, Trials
from evoclaims.judging.verdict import Evidence, Interval, PValues

if TYPE_CHECKING:
    from evoclaims.judging.measure import Measure


@dataclass(frozen=True)
class Comparison:
    """The three exact tests that decide whether A lies above B.

    Attributes:
        above: rank test, A above B.
        below: rank test, B above A.
        margin: binomial test that the declared effect is absent.
        wins: disjoint pairs in which A is at least B.
        pairs: disjoint pairs (trial i of A against trial i of B).
    """

    above: ExactTest
    below: ExactTest
    margin: ExactTest
    wins: int
    pairs: int

    @property
    def p(self) -> PValues:
        """For: the rank. Against: the rank the other way, or the declared effect rejected."""
        return PValues(self.above.p, min(self.below.p, self.margin.p))

    @property
    def attainable(self) -> PValues:
        """The smallest p that n and the ties allow."""
        return PValues(self.above.attainable_p, min(self.below.attainable_p, self.margin.attainable_p))


def compare(a: Sequence[float], b: Sequence[float], margin: float) -> Comparison:
    """Compare A with B exactly.

    Args:
        a: values of A in the order of their seeds, shape [n].
        b: values of B in the order of their seeds, shape [m].
        margin: the declared effect P(A >= B), ties counted as wins.
    """
    pairs = list(zip(a, b, strict=False))
    wins = sum(x >= y for x, y in pairs)
    # However the pooled values were paired, a pair of equal values is a win: so ties bound the losses.
    commonest = Counter((*a, *b)).most_common(1)[0][1]
    most_losses = min(len(pairs), len(a) + len(b) - commonest)
    return Comparison(
        above=rank_test(a, b),
        below=rank_test(b, a),
        margin=ExactTest(
            p=binomial_test(wins, len(pairs), margin, "less").p,
            attainable_p=binomial_test(len(pairs) - most_losses, len(pairs), margin, "less").p,
        ),
        wins=wins,
        pairs=len(pairs),
    )


def require_independent(left: Measure, right: Measure) -> None:
    """Reject two measures of the same trials: a rank test takes its two samples as independent.

    Raises:
        UserError: when both read the same condition.
    """
    if left.source.fingerprint == right.source.fingerprint:
        raise UserError(
            f"{left.describe()!r} and {right.describe()!r} read the same trials, which no rank test may compare: "
            "use a profile's falls() or rises() for levels, never_above_itself() for a control."
        )


@dataclass(frozen=True)
class Greater(Assertion):
    """`above` lies above `below`: supported by the rank test.

    Refuted by the rank test the other way, or when the declared effect (the protocol's A12 margin) is rejected by a
    binomial test on disjoint seed pairs, ties counted as wins.
    """

    above: Measure
    below: Measure
    kind: ClassVar[str] = "greater"

    def __post_init__(self) -> None:
        """Reject two measures of the same trials."""
        require_independent(self.above, self.below)

    def describe(self) -> str:
        """Return "A > B"."""
        return f"{self.above.describe()} > {self.below.describe()}"

    def sources(self) -> tuple[Source, ...]:
        """Return both conditions."""
        return (self.above.source, self.below.source)

    def plain(self) -> dict[str, Any]:
        """Return the kind and both measures."""
        return {"kind": self.kind, "above": self.above.plain(), "below": self.below.plain()}

    def attainable(self, n: int, protocol: Protocol) -> PValues:
        """Return the p of a complete separation; against, also of no win in any pair."""
        separated = rank_attainable(n, n)
        return PValues(separated, min(separated, binomial_test(0, n, protocol.a12_margin, "less").p))

    def find(self, trials: Trials, protocol: Protocol, alpha: float) -> Finding:
        """Run the three exact tests."""
        above, below = self.above.sample(trials), self.below.sample(trials)
        a, b = above.values, below.values
        comparison = compare(a, b, protocol.a12_margin)
        p, attainable = comparison.p, comparison.attainable
        evidence = Evidence(
            kind=self.kind,
            describe=self.describe(),
            outcome=p.outcome(alpha),
            samples=(above, below),
            n=len(a),
            alpha=alpha,
            p=p.supported,
            attainable_p=attainable.supported,
            p_refuted=p.refuted,
            attainable_p_refuted=attainable.refuted,
            a12=a12(a, b),
            cliffs_delta=cliffs_delta(a, b),
            intervals=(Interval("A12, 95% percentile bootstrap", *a12_interval(a, b)),),
            detail=(
                f"at least as high in {comparison.wins} of {comparison.pairs} seed pairs "
                f"(p = {comparison.margin.p:.3g} against A12 >= {protocol.a12_margin:g})"
            ),
        )
        return Finding(p, attainable, (evidence,))
