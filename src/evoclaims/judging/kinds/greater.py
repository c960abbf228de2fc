"""greater(A, B): a measure of A is above the same measure of B."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.entry import Entry
from evoclaims.judging.exact import ExactTest, binomial_test, rank_attainable, rank_test
from evoclaims.judging.reading import NumberReading, require_independent
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import Bound, Outcome, PValues


@dataclass(frozen=True)
class GreaterTests:
    """The three exact tests that decide whether A is above B, each made when it is asked for.

    Attributes:
        a: values of A in the order of their seeds, shape [n].
        b: values of B in the order of their seeds, shape [m].
        effect: the declared effect P(A >= B), ties counted as wins.
    """

    a: Sequence[float]
    b: Sequence[float]
    effect: float

    @cached_property
    def above(self) -> ExactTest:
        """Rank test, A above B."""
        return rank_test(self.a, self.b)

    @cached_property
    def below(self) -> ExactTest:
        """Rank test, B above A."""
        return rank_test(self.b, self.a)

    @cached_property
    def margin(self) -> ExactTest:
        """Binomial test that the declared effect is absent."""
        # In any pairing of the pooled values, equal values make a win: so ties bound the losses.
        commonest = Counter((*self.a, *self.b)).most_common(1)[0][1]
        most_losses = min(self.pairs, len(self.a) + len(self.b) - commonest)
        return ExactTest(
            p=binomial_test(self.wins, self.pairs, self.effect, "less").p,
            attainable_p=binomial_test(self.pairs - most_losses, self.pairs, self.effect, "less").p,
        )

    @property
    def wins(self) -> int:
        """Disjoint pairs (trial i of A against trial i of B) in which A is at least B."""
        return sum(x >= y for x, y in zip(self.a, self.b, strict=False))

    @property
    def pairs(self) -> int:
        """Number of disjoint pairs."""
        return min(len(self.a), len(self.b))

    @property
    def p(self) -> PValues:
        """For: the rank test. Against: the reverse rank test, or rejection of the declared effect."""
        return PValues(self.above.p, min(self.below.p, self.margin.p))

    @property
    def attainable(self) -> PValues:
        """The smallest p that n and the ties allow."""
        return PValues(self.above.attainable_p, min(self.below.attainable_p, self.margin.attainable_p))

    def support(self, alpha: float) -> bool:
        """Whether A is found above B at `alpha`; mostly the first test alone says that it is not."""
        return self.above.p <= alpha and self.p.outcome(alpha) is Outcome.SUPPORTED


@dataclass(frozen=True)
class Greater(Assertion):
    """`above` is above `below`: supported by the rank test.

    Refuted by the reverse rank test, or when a binomial test on disjoint seed pairs rejects the declared effect (the
    design's A12 margin), ties counted as wins.
    """

    above: NumberReading
    below: NumberReading
    kind: ClassVar[str] = "greater"
    entry: ClassVar[Entry] = Entry(
        syntax=(
            "a.reward > b.reward",
            'a.steps_to("success", 0.9) < b.steps_to("success", 0.9)',
            "2 * a.environment_steps < b.environment_steps",
        ),
        null=(
            "The first is stochastically no larger than the second: each split of the pooled trials is equally likely."
        ),
        supported=(
            "The rank test rejects that: the share of splits with a sum of ranks as large, ties counted exactly."
        ),
        refuted=(
            "The rank test rejects the reverse; or a binomial test over pairs of trials by seed, ties counted "
            "as wins, rejects the design's effect (A12 of at least 0.71)."
        ),
        source=(
            "Mann and Whitney 1947, as a permutation test on mid-ranks; A12: Vargha and Delaney 2000; where "
            "values are censored: Gehan 1965"
        ),
    )

    def __post_init__(self) -> None:
        """Reject measures that cannot be ranked together."""
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
        tests = GreaterTests(above.values, below.values, design.a12_margin)
        detail = (
            f"at least as high in {tests.wins} of {tests.pairs} seed pairs "
            f"(p = {tests.margin.p:.3g} against A12 >= {design.a12_margin:g})"
        )
        bounds = (Bound("A12 margin", design.a12_margin, on_axis=False),)
        samples = (above, below)
        return self.found(tests.p, tests.attainable, alpha, samples, detail=detail, bounds=bounds, effect=True)
