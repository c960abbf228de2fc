"""self-comparison: a control that compares a condition with itself, to detect false positives of the judge."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar

import numpy as np

from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design, Look
from evoclaims.judging.exact import binomial_test, rank_attainable
from evoclaims.judging.kinds.greater import GreaterTests
from evoclaims.judging.reading import NumberReading
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import PValues

MOST_SPLITS = math.comb(10, 5)
SPLIT_SEED = 20250714
"""Fixed, so that the same trials always get the same splits."""


@dataclass(frozen=True)
class SelfComparison(Assertion):
    """A measure is never above itself: halves of its trials are compared as in `greater`.

    Up to ten trials, all splits are judged; for more, a fixed sample of splits. Supported when the share of supported
    splits is at most alpha. For a sample of splits, refuted only when an exact binomial test at alpha says that the
    share among all splits exceeds alpha.
    """

    measure: NumberReading
    kind: ClassVar[str] = "self-comparison"
    entry: ClassVar[Entry] = Entry(
        syntax=("a.reward.never_above_itself()",),
        null="None, because this is a control of the judge. It compares halves of the same trials, as greater does.",
        supported=(
            "The judge finds a difference in at most a share of α of the splits into halves. Of up to ten trials these "
            "are all splits, of more trials 252 that are drawn once."
        ),
        refuted="It finds more. If splits are drawn, an exact binomial test at α must show this.",
        source="By construction of the rank test",
    )

    def describe(self) -> str:
        """Return "A is never judged above itself"."""
        return f"{self.measure.describe()} is never judged above itself"

    def looks(self, design: Design) -> tuple[Look, ...]:
        """Return only the last look: stopping early would save nothing."""
        return (design.last,)

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the smallest p of one split, for both: if no split can be supported, the control shows nothing."""
        smallest = rank_attainable(n // 2, n - n // 2) if n > 1 else 1.0
        return PValues(smallest, smallest)

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Judge the splits and compare the share of supported ones with alpha."""
        sample = self.measure.sample(trials)
        n = len(sample.values)
        judged = above = 0
        for half in _halves(n):
            chosen = set(half)
            rest = [value for index, value in enumerate(sample.values) if index not in chosen]
            tests = GreaterTests([sample.values[index] for index in half], rest, design.a12_margin)
            above += tests.support(alpha)
            judged += 1
        excessive = above / judged > alpha
        if math.comb(n, n // 2) > MOST_SPLITS:
            excessive = binomial_test(above, judged, alpha, "greater").p <= alpha
        detail = f"{above} of {judged} splits into halves came out supported (share {above / judged:.3g})"
        return self.fact(not excessive, alpha, sample, detail)


def _halves(n: int) -> Iterator[tuple[int, ...]]:
    if math.comb(n, n // 2) <= MOST_SPLITS:
        yield from combinations(range(n), n // 2)
        return
    rng = np.random.default_rng(SPLIT_SEED)
    for _ in range(MOST_SPLITS):
        yield tuple(int(index) for index in rng.permutation(n)[: n // 2])
