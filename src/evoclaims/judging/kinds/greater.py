"""greater(A, B): a measure of A is above the same measure of B."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.exact import ExactTest, binomial_test, rank_attainable, rank_test
from evoclaims.judging.reading import NumberReading
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import Bound, PValues


@dataclass(frozen=True)
class GreaterTests:
    """The three exact tests that decide whether A is above B.

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
        """For: the rank test. Against: the reverse rank test, or rejection of the declared effect."""
        return PValues(self.above.p, min(self.below.p, self.margin.p))

    @property
    def attainable(self) -> PValues:
        """The smallest p that n and the ties allow."""
        return PValues(self.above.attainable_p, min(self.below.attainable_p, self.margin.attainable_p))


def compare(a: Sequence[float], b: Sequence[float], margin: float) -> GreaterTests:
    """Compare A with B exactly.

    Args:
        a: values of A in the order of their seeds, shape [n].
        b: values of B in the order of their seeds, shape [m].
        margin: the declared effect P(A >= B), ties counted as wins.
    """
    pairs = list(zip(a, b, strict=False))
    wins = sum(x >= y for x, y in pairs)
    # In any pairing of the pooled values, equal values make a win: so ties bound the losses.
    commonest = Counter((*a, *b)).most_common(1)[0][1]
    most_losses = min(len(pairs), len(a) + len(b) - commonest)
    return GreaterTests(
        above=rank_test(a, b),
        below=rank_test(b, a),
        margin=ExactTest(
            p=binomial_test(wins, len(pairs), margin, "less").p,
            attainable_p=binomial_test(len(pairs) - most_losses, len(pairs), margin, "less").p,
        ),
        wins=wins,
        pairs=len(pairs),
    )


def require_independent(left: NumberReading, right: NumberReading) -> None:
    """Reject two measures of the same trials: a rank test assumes independent samples.

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
    """`above` is above `below`: supported by the rank test.

    Refuted by the reverse rank test, or when a binomial test on disjoint seed pairs rejects the declared effect (the
    design's A12 margin), ties counted as wins.
    """

    above: NumberReading
    below: NumberReading
    kind: ClassVar[str] = "greater"

    def __post_init__(self) -> None:
        """Reject two measures of the same trials."""
        require_independent(self.above, self.below)

    def describe(self) -> str:
        """Return "A > B"."""
        return f"{self.above.describe()} > {self.below.describe()}"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of complete separation; against, also of no win in any pair."""
        separated = rank_attainable(n, n)
        return PValues(separated, min(separated, binomial_test(0, n, design.a12_margin, "less").p))

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run the three exact tests."""
        above, below = self.above.sample(trials), self.below.sample(trials)
        tests = compare(above.values, below.values, design.a12_margin)
        detail = (
            f"at least as high in {tests.wins} of {tests.pairs} seed pairs "
            f"(p = {tests.margin.p:.3g} against A12 >= {design.a12_margin:g})"
        )
        bounds = (Bound("A12 margin", design.a12_margin, on_axis=False),)
        samples = (above, below)
        return self.found(tests.p, tests.attainable, alpha, samples, detail=detail, bounds=bounds, effect=True)
