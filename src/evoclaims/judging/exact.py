"""What decides claims: the exact rank and binomial tests, and a bound for all pairs of trials. Float64 on the host.

Counts are polynomials packed into one integer: with a base above every coefficient, adding and multiplying the packed
integers adds and multiplies the polynomials (Kronecker's substitution); with Python's integers this is exact and fast.
"""

from __future__ import annotations

import gc
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, get_args

MAX_TRIALS = 100
"""Maximum trials per side for the exact counts (about a second at 100 against 100)."""


@dataclass(frozen=True)
class Counts:
    """How many of equally likely cases have X = 0, 1, 2, ...

    Attributes:
        packed: the counts, `width` bits each.
        width: one more bit than their sum has.
        total: number of cases.
    """

    packed: int
    width: int
    total: int

    @property
    def largest(self) -> int:
        """The largest possible X."""
        return (self.packed.bit_length() - 1) // self.width

    def tail(self, least: int) -> float:
        """Return P(X >= least), for `least` from 0 to `largest`."""
        # Division of Python integers rounds correctly, so 1 in 20 is the float 0.05 and compares equal to it.
        return self._cases(least) / self.total

    def head(self, most: int) -> float:
        """Return P(X <= most)."""
        return (self.total - self._cases(most + 1)) / self.total

    def _cases(self, least: int) -> int:
        # A number's remainder modulo its base minus one is the sum of its digits (here below the base minus one).
        return (self.packed >> (self.width * least)) % ((1 << self.width) - 1)


Alternative = Literal["greater", "less"]


@dataclass(frozen=True)
class ExactTest:
    """A one-sided exact test.

    Attributes:
        p: probability under the null of a result at least this extreme.
        attainable_p: the smallest p that the sample sizes (and, where the null conditions on them, the ties) allow.
    """

    p: float
    attainable_p: float


def rank_test(a: Sequence[float], b: Sequence[float]) -> ExactTest:
    """Test whether A is above B: the one-sided exact permutation Mann-Whitney test on mid-ranks.

    Under the null (A is stochastically no larger than B) every split of the pooled values is equally likely. Splits
    are counted exactly, ties included, by dynamic programming over the doubled U statistic (the doubled mid-rank sum
    minus a constant). `attainable_p` is the p of the most extreme split of the pooled values.

    Args:
        a: values of A, shape [n]; infinities rank as such.
        b: values of B, shape [m].

    Raises:
        ValueError: when a side is empty or a value is NaN, which cannot be ranked.
    """
    splits, doubled_u = _split(a, b)
    return ExactTest(p=splits.tail(doubled_u), attainable_p=splits.tail(splits.largest))


def two_sided_rank_p(a: Sequence[float], b: Sequence[float]) -> float:
    """Return twice the smaller p of A above B and of B above A, at most 1; raises as `rank_test` does."""
    splits, doubled_u = _split(a, b)
    return min(1.0, 2 * min(splits.tail(doubled_u), splits.head(doubled_u)))


def _split(a: Sequence[float], b: Sequence[float]) -> tuple[Counts, int]:
    """Count the splits of the pooled values by their 2U, and return that of this split, too."""
    if not len(a) or not len(b):
        raise ValueError("A rank test needs at least one value on each side.")
    if any(map(math.isnan, (*a, *b))):
        raise ValueError("A rank test cannot rank NaN.")
    of_a, of_b = Counter(a), Counter(b)
    ties: list[int] = []
    doubled_u = b_below = 0
    for value in sorted({*of_a, *of_b}):
        from_a, from_b = of_a.get(value, 0), of_b.get(value, 0)
        doubled_u += from_a * (2 * b_below + from_b)
        b_below += from_b
        ties.append(from_a + from_b)
    return _splits_by_doubled_u(len(a), tuple(ties)), doubled_u


@lru_cache(maxsize=512)
def _splits_by_doubled_u(n: int, ties: tuple[int, ...]) -> Counts:
    """Count the splits of pooled values, `n` of A and the others of B, by their 2U.

    `ties` are the sizes of the groups of equal pooled values, in rising order of value.
    """
    m = sum(ties) - n
    total = math.comb(n + m, n)
    width = total.bit_length() + 1
    # Digit u of ways[i]: the number of ways to give A i of the values so far, with 2U = u.
    ways = {0: 1}
    below = 0
    for size in ties:
        grown: dict[int, int] = {}
        for i, packed in ways.items():
            b_below = below - i
            for j in range(max(0, size - (m - b_below)), min(size, n - i) + 1):
                # Numbers of thousands of digits: a product with 1, a shift by 0 and a sum with 0 would copy them.
                chosen = packed if j in (0, size) else packed * math.comb(size, j)
                shifted = chosen << (width * j * (2 * b_below + size - j)) if j else chosen
                grown[i + j] = grown[i + j] + shifted if i + j in grown else shifted
        ways = grown
        below += size
    return Counts(ways[n], width, total)


def rank_attainable(n: int, m: int) -> float:
    """Return the smallest one-sided p of the rank test for `n` against `m` values without ties: 1 / C(n + m, n)."""
    return 1 / math.comb(n + m, n)


@lru_cache(maxsize=4096)
def binomial_test(k: int, n: int, p0: float, alternative: Alternative = "greater") -> ExactTest:
    """Test P(success) > p0 ("greater") or P(success) < p0 ("less") by the exact binomial test, given `k` of `n` trials.

    Raises:
        ValueError: for another alternative, less than one trial, or a p0 that is not strictly between 0 and 1.
    """
    if alternative not in get_args(Alternative):
        raise ValueError(f"No alternative {alternative!r}; known: {', '.join(get_args(Alternative))}.")
    if not 0 < p0 < 1:
        raise ValueError(f"The null's probability lies strictly between 0 and 1, unlike {p0}.")
    if n < 1 or not 0 <= k <= n:
        raise ValueError(f"A test needs one trial at least, and from none to all of them, not {k} of {n}.")
    if alternative == "less":  # as many failures or more
        k, p0 = n - k, 1 - p0
    return ExactTest(p=_at_least(k, n, p0), attainable_p=_at_least(n, n, p0))


def _at_least(k: int, n: int, p: float) -> float:
    """Return the probability of `k` or more successes in `n` trials."""
    from scipy.special import betainc  # scipy.stats has this, too, and takes a second longer to import

    return float(betainc(k, n - k + 1, p)) if k > 0 else 1.0


def pairs_test(wins: float, n: int, share: float) -> float:
    """Return a p value against "A is at least B with a probability of at least `share`", by all pairs of trials.

    Hoeffding's bound (1963, section 5): the share of winning pairs is the mean, over all ways to pair trials, of the
    mean of `n` independent wins, so that P(share <= wins) <= exp(-n KL(wins || share)). Seeds are labels, and decide
    nothing. Another valid p, twice the mean of the binomial p over all pairings, had less power in every simulation.

    Args:
        wins: share of all pairs that A wins or ties, from 0 to 1.
        n: trials of the smaller side.
        share: strictly between 0 and 1.
    """
    if wins >= share:
        return 1.0
    lost = (1 - wins) * math.log((1 - wins) / (1 - share))
    return math.exp(-n * (lost + (wins * math.log(wins / share) if wins else 0.0)))


def sign_test(k: int, n: int) -> ExactTest:
    """Test whether a median is on the side where `k` of `n` trials are (including the edge itself).

    If the median were strictly beyond the edge, a trial would be on the side with probability at most 1/2: so the test
    is binomial with p0 = 1/2.
    """
    return binomial_test(k, n, 0.5, "greater")


def clopper_pearson(k: int, n: int, alpha: float = 0.05) -> tuple[float, float]:
    """Return the exact interval of a proportion, each end a one-sided bound at `alpha`.

    So 10 of 10 at 0.05 gives (0.741, 1.0): the level of the whole interval is 1 - 2 alpha.
    """
    from scipy.special import betaincinv  # as above

    low = betaincinv(k, n - k + 1, alpha) if k > 0 else 0.0
    high = betaincinv(k + 1, n - k, 1 - alpha) if k < n else 1.0
    return float(low), float(high)


def holm(ps: Sequence[float]) -> tuple[float, ...]:
    """Return the Holm-adjusted `ps`; rejecting those of at most alpha has the familywise error alpha."""
    return _holm(tuple(ps)) if len(ps) else ()


def smallest(ps: Sequence[float]) -> float:
    """Return the smallest Holm-adjusted p, which is at most alpha if any is: the smallest times their number."""
    return min(1.0, len(ps) * min(ps))


@lru_cache(maxsize=1024)
def _holm(ps: tuple[float, ...]) -> tuple[float, ...]:
    from statsmodels.stats.multitest import multipletests  # takes a second: it imports pandas

    gc.freeze()  # statsmodels collects garbage in every call, for seconds where many programs have been traced
    try:
        return tuple(float(p) for p in multipletests(list(ps), method="holm")[1])
    finally:
        gc.unfreeze()
