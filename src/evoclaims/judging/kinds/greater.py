"""greater(A, B): a measure of A is above the same measure of B."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.exact import ExactTest, pairs_test, rank_attainable, rank_test
from evoclaims.judging.reading import NumberReading, require_independent
from evoclaims.judging.sample import Sample, Trials, levelled
from evoclaims.judging.verdict import Bound, Outcome, PValues


@dataclass(frozen=True)
class GreaterTests:
    """The tests that decide whether A is above B, each made when it is asked for; no order of trials matters.

    Attributes:
        a: values of A, shape [n].
        b: values of B, shape [m].
        effect: the claimed size, P(A >= B); also of the reverse, for equality.
        least: what the values of A and of B are at least, where `a` and `b` are what they are at most; None if equal.
            Each test takes those that are least favourable to what it shows, and so stays valid.
    """

    a: Sequence[float]
    b: Sequence[float]
    effect: float
    least: tuple[Sequence[float], Sequence[float]] | None = None

    @cached_property
    def _least(self) -> tuple[Sequence[float], Sequence[float]]:
        return self.least or (self.a, self.b)

    @cached_property
    def above(self) -> ExactTest:
        """Rank test, A above B."""
        return rank_test(self._least[0], self.b)

    @cached_property
    def below(self) -> ExactTest:
        """Rank test, B above A."""
        return rank_test(self._least[1], self.a)

    @cached_property
    def smaller(self) -> ExactTest:
        """Test that A is at least B less often than claimed."""
        return _below_size(self.a, self._least[1], self.effect)

    @cached_property
    def reverse_smaller(self) -> ExactTest:
        """Test that B is at least A less often than that."""
        return _below_size(self.b, self._least[0], self.effect)

    @property
    def wins(self) -> float:
        """Share of all pairs in which A is, or may be, at least B: ties are wins."""
        return _share(self.a, self._least[1])

    @property
    def p(self) -> PValues:
        """For: the rank test. Against: its reverse, or equality within the claimed size; against the size alone."""
        equal = max(self.smaller.p, self.reverse_smaller.p)
        return PValues(self.above.p, min(self.below.p, equal), self.smaller.p)

    @property
    def attainable(self) -> PValues:
        """The smallest p that n and the ties allow."""
        equal = pairs_test(0.5, min(len(self.a), len(self.b)), self.effect)  # the shares of both add up to 1, or more
        return PValues(self.above.attainable_p, min(self.below.attainable_p, equal), self.smaller.attainable_p)

    def support(self, alpha: float) -> bool:
        """Whether A is found above B at `alpha`; mostly the first test alone says that it is not."""
        return self.above.p <= alpha and self.p.outcome(alpha) is Outcome.SUPPORTED


def _below_size(a: Sequence[float], b: Sequence[float], effect: float) -> ExactTest:
    """Test that A is at least B with a probability below `effect`."""
    n, pooled = min(len(a), len(b)), sorted((*a, *b))
    lowest = _share(pooled[: len(a)], pooled[len(a) :])  # of all splits of these values
    return ExactTest(pairs_test(_share(a, b), n, effect), pairs_test(lowest, n, effect))


def _share(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the share of pairs in which A is at least B."""
    ordered = sorted(b)
    return sum(bisect_right(ordered, value) for value in a) / (len(a) * len(b))


@dataclass(frozen=True)
class Greater(Assertion):
    """Trials of one condition are above those of another.

    `above` above `below` is supported by the rank test. Refuted by the reverse rank test, or where the two are equal
    within the design's A12 margin. Smaller than claimed where only an effect as large as the margin is rejected.
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
            "The first side is stochastically no larger than the second. If both have one distribution, all splits of "
            "the pooled trials are equally likely."
        ),
        supported=(
            "The rank test rejects that. Its p is the share of all splits in which the ranks of the first side have "
            "at least this sum, ties included."
        ),
        refuted=(
            "The rank test shows the reverse, or neither side reaches the margin. If only the first does not reach it, "
            "the claim is smaller than claimed. Hoeffding's bound over all pairs of trials shows this; ties count as "
            "wins. The margin is an A12 that the paper's own design detects with power 1/3 (0.71 for ten trials a "
            "side)."
        ),
        source=(
            "Mann and Whitney 1947, as a permutation test on mid-ranks; A12: Vargha and Delaney 2000; where "
            "values are censored: Gehan 1965; all pairs: Hoeffding 1963; margin: Simonsohn 2015"
        ),
    )

    def __post_init__(self) -> None:
        """Reject measures that cannot be ranked together."""
        require_independent(self.above, self.below)

    def describe(self) -> str:
        """Return "A > B"."""
        return f"{self.above.describe()} > {self.below.describe()}"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of complete separation; against, also of equality; against the size, of no win."""
        separated, margin = rank_attainable(n, n), design.a12_margin
        return PValues(separated, min(separated, pairs_test(0.5, n, margin)), pairs_test(0.0, n, margin))

    def highest(self, trials: Trials, n: int, design: Design) -> PValues:
        """Return the p of results of the missing trials that are all against it: beyond all others, without ties."""
        (least_a, a), (least_b, b) = self._spans(trials)
        place = {value: float(at) for at, value in enumerate(sorted({*a, *b, *least_a, *least_b}))}
        low = [-1.0 - at for at in range(n)]
        high = [float(len(place) + at) for at in range(n)]

        def tests(of_a: Sequence[float], of_b: Sequence[float]) -> GreaterTests:
            more, less = of_a[: n - len(a)], of_b[: n - len(b)]
            all_a, all_least_a = ([*(place[value] for value in values), *more] for values in (a, least_a))
            all_b, all_least_b = ([*(place[value] for value in values), *less] for values in (b, least_b))
            return GreaterTests(all_a, all_b, design.a12_margin, (all_least_a, all_least_b))

        best, worst = tests(high, low), tests(low, high)
        equal = max(best.smaller.p, worst.reverse_smaller.p)
        return PValues(worst.above.p, min(best.below.p, equal), best.smaller.p)

    def _spans(self, trials: Trials) -> tuple[tuple[Sequence[float], Sequence[float]], ...]:
        """Return what the values of each side are at least and at most: equal where reports show both alike."""
        sides = self.above, self.below
        if not all(side.is_shown(trials) for side in sides):
            return tuple(side.spans(trials) for side in sides)
        return tuple((sample.values, sample.values) for sample in self._samples(trials))

    def _samples(self, trials: Trials) -> tuple[Sample, Sample]:
        return levelled(self.above.sample(trials), self.below.sample(trials))

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run the tests."""
        samples = self._samples(trials)
        (least_a, a), (least_b, b) = self._spans(trials)
        tests = GreaterTests(a, b, design.a12_margin, (least_a, least_b))
        detail = (
            f"at least as high in {tests.wins:.3g} of all pairs of trials "
            f"(p = {tests.smaller.p:.3g} against A12 >= {design.a12_margin:g})"
        )
        if (least_a, least_b) != (a, b):
            detail += "; both sides do not report at the same steps: each p is of the times least favourable to it"
        bounds = (Bound("A12 margin", design.a12_margin, on_axis=False),)
        return self.found(tests.p, tests.attainable, alpha, samples, detail=detail, bounds=bounds, effect=True)
