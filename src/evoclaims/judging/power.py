"""Power: how often an assertion ends as it is expected to, when it is judged from draws of a pilot's trials."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import islice
from math import comb
from typing import Final

import numpy as np

from evoclaims.core.canonical import content_hash
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.design import Design, Look
from evoclaims.judging.exact import MAX_TRIALS, binomial_test, clopper_pearson
from evoclaims.judging.judge import decide
from evoclaims.judging.sample import Source, Trials, UnreadableTrialError, checked
from evoclaims.judging.verdict import Outcome
from evoclaims.trials.result import TrialResult

DRAWS: Final = 1000
SEARCHED: Final = 400
"""Draws by which numbers of trials are tried, which are right to a few trials."""

ENOUGH: Final = 0.95
"""The power that a claim should have."""

SEED: Final = 20250714
"""Fixed, so that the same pilot always gives the same power."""


class Draws:
    """Trials drawn from a pilot, whole and with replacement, independently for each condition.

    Draw k of a condition is one endless sequence, which depends on nothing but the condition: more trials prolong it.
    """

    def __init__(self, pilot: Trials, count: int = DRAWS) -> None:
        """Draw nothing yet; the pilot's trials are by the fingerprint of their condition."""
        self.count = count
        self._pilot = {mark: tuple(map(checked, trials)) for mark, trials in pilot.items()}
        self._chosen: dict[str, list[list[int]]] = {}

    def size(self, assertion: Assertion) -> int:
        """Return how many trials the smallest pilot has among those that an assertion needs."""
        return min((len(self._pilot[source.fingerprint]) for source in assertion.sources()), default=MAX_TRIALS)

    def outcomes(self, assertion: Assertion, design: Design) -> Iterator[Outcome]:
        """Yield how an assertion ends in one draw after the other.

        Raises:
            UnreadableTrialError: when a trial of the pilot crashed, or lacks a number that the assertion reads.
        """
        for draw in range(self.count):
            ending = decide(assertion, design, partial(self._drawn, draw))
            if ending is not None and ending.outcome is Outcome.ERROR:
                raise UnreadableTrialError(ending.note)
            yield Outcome.INCONCLUSIVE if ending is None else ending.outcome

    def _drawn(self, draw: int, source: Source, seeds: Sequence[int]) -> tuple[TrialResult, ...]:
        """Return the first trials of a draw, as many as there are seeds; they keep their own."""
        mark = source.fingerprint
        trials = self._pilot[mark]
        if mark not in self._chosen:
            rng = np.random.default_rng([SEED, int(content_hash(mark)[:16], 16)])
            self._chosen[mark] = rng.integers(len(trials), size=(self.count, MAX_TRIALS)).tolist()
        return tuple(trials[index] for index in self._chosen[mark][draw][: len(seeds)])


@dataclass(frozen=True)
class Power:
    """How an assertion ended in draws from a pilot.

    Attributes:
        expected: the outcome that it should have.
        counts: number of draws by outcome.
        needed: about the fewest trials a condition, in a single look, with which a share of `ENOUGH` ends as expected;
            None if `most` are too few, or where no number of trials makes an outcome likely (inconclusive).
        most: trials in the smallest pilot, beyond which draws would say nothing new.
    """

    expected: Outcome
    counts: Mapping[Outcome, int]
    needed: int | None
    most: int

    @property
    def draws(self) -> int:
        """Number of draws."""
        return sum(self.counts.values())

    def share(self, outcome: Outcome | None) -> float:
        """Return the share of draws with an outcome."""
        return self.counts.get(outcome, 0) / self.draws if outcome else 0.0

    @property
    def power(self) -> float:
        """The share of draws that end as expected."""
        return self.share(self.expected)

    @property
    def interval(self) -> tuple[float, float]:
        """The 95% Clopper-Pearson interval of `power`: what the number of draws leaves open, not the pilot's."""
        return clopper_pearson(self.counts.get(self.expected, 0), self.draws, 0.025)

    @property
    def flips(self) -> float:
        """The share of draws that end the other way: with something against it where it is expected to be supported."""
        if self.expected is Outcome.SUPPORTED:
            return sum(self.share(outcome) for outcome in Outcome if outcome.is_against)
        return self.share(Outcome.SUPPORTED if self.expected.is_against else None)

    @property
    def suffices(self) -> bool:
        """Whether enough draws end as expected."""
        return self.power >= ENOUGH


def power(assertion: Assertion, design: Design, draws: Draws, expected: Outcome = Outcome.SUPPORTED) -> Power:
    """Return how often an assertion ends how.

    Raises:
        UnreadableTrialError: when a trial of the pilot crashed, or lacks a number that the assertion reads.
    """
    found = Power(expected, Counter(draws.outcomes(assertion, design)), None, draws.size(assertion))
    if expected is Outcome.INCONCLUSIVE:
        return found
    return replace(found, needed=_needed(assertion, design, draws, found))


def _needed(assertion: Assertion, design: Design, draws: Draws, found: Power) -> int | None:
    """Return about the smallest n that suffices, by some of the draws; None if no n up to the pilot's size does."""
    tried = min(SEARCHED, draws.count)
    allowed = tried - math.ceil(ENOUGH * tried)

    @cache
    def suffices(n: int) -> bool:
        """Whether a single look at `n` trials suffices; draws end when nothing can change the answer."""
        outcomes = islice(draws.outcomes(assertion, replace(design, looks=(Look(n, design.alpha),))), tried)
        missed = (index for index, outcome in enumerate(outcomes) if outcome is not found.expected)
        return next(islice(missed, allowed, None), None) is None

    lower, upper = 0, min(design.last.n, found.most)
    if not found.suffices:
        while True:  # by small factors, since the tests of many trials take long
            if upper == found.most:
                return None
            lower, upper = upper, min(math.ceil(1.5 * upper), found.most)
            if suffices(upper):
                break
    return lower + 1 + bisect_left(range(lower + 1, upper), True, key=suffices)


RATES: Final = (0.8, 0.9, 0.95)
"""Rates of an event for which its power is shown."""


def event_power(looks: Sequence[Look], p0: float, rate: float) -> float:
    """Return the probability that an event with this rate is supported in most trials (against `p0`).

    Exact: a look that supports or refutes ends it, others leave it open.
    """
    open_, before, supported = {0: 1.0}, 0, 0.0
    for look in looks:
        more, grown = look.n - before, dict[int, float]()
        for held, chance in open_.items():
            for k in range(more + 1):
                grown[held + k] = grown.get(held + k, 0.0) + chance * comb(more, k) * rate**k * (1 - rate) ** (more - k)
        open_ = {}
        for held, chance in grown.items():
            if binomial_test(held, look.n, p0, "greater").p <= look.alpha:
                supported += chance
            elif binomial_test(held, look.n, p0, "less").p > look.alpha:
                open_[held] = chance
        before = look.n
    return supported
