"""trend: a profile falls (or rises) with the level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar, Literal

from evoclaims.core.errors import require_known
from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.kinds.threshold import sign_tests
from evoclaims.judging.reading import LevelsReading
from evoclaims.judging.sample import Trials, beyond
from evoclaims.judging.verdict import PValues

Slope = Literal["falls", "rises"]

_SIGNS: dict[Slope, int] = {"falls": -1, "rises": 1}


def kendall_s(profile: Sequence[float]) -> int:
    """Return Kendall's S of values against their index: pairs of them that rise, less pairs that fall."""
    steps = [beyond(later, earlier) for earlier, later in combinations(profile, 2)]
    return sum(step > 0 for step in steps) - sum(step < 0 for step in steps)


@dataclass(frozen=True)
class Trend(Assertion):
    """The values of most trials fall, or rise, with the level.

    A trial is one draw, whatever its number of levels. Were its pairs of levels the draws, as in a permutation test of
    the sum of S, a method of which half of the trials rise and half fall would be found to fall in 17 of 100 samples
    of ten trials with five levels.
    """

    profile: LevelsReading
    direction: Slope
    kind: ClassVar[str] = "trend"
    entry: ClassVar[Entry] = Entry(
        syntax=(
            "a.success.falls()",
            "a.success.rises()",
        ),
        null="At most half of all trials fall. A trial falls if more pairs of its levels fall than rise (Kendall's S).",
        supported="A sign test rejects that. A trial with as many of both, or without a result, does not fall.",
        refuted="A sign test shows that most trials rise. A trial with as many of both does not rise either.",
        source="Kendall 1938; Dixon and Mood 1946 (sign test)",
    )

    def __post_init__(self) -> None:
        """Reject an unknown direction."""
        require_known("direction", self.direction, _SIGNS)

    def describe(self) -> str:
        """Return "P falls with the level"."""
        return f"{self.profile.describe()} {self.direction} with the level"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of a trend in every trial, for and against."""
        return sign_tests(n, n, n)

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Bound p by new trials that all go one way."""
        toward, away, known = self._counts(trials)
        new = n - known
        return sign_tests(toward + new, away + new, n), sign_tests(toward, away, n)

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run both sign tests."""
        toward, away, n = self._counts(trials)
        decided = toward + away
        opposite = "rises" if self.direction == "falls" else "falls"
        neither = f", and neither in {n - decided}" if n > decided else ""
        return self.found(
            sign_tests(toward, away, n),
            sign_tests(decided, decided, n),
            alpha,
            self.profile.samples(trials),
            detail=f"{self.direction} in {toward} of {n} trials, {opposite} in {away}{neither}",
        )

    def _counts(self, trials: Trials) -> tuple[int, int, int]:
        """Return how many trials go the claimed way, how many the other way, and how many there are."""
        slopes = [_SIGNS[self.direction] * kendall_s(row) for row in self.profile.rows(trials)]
        return sum(slope > 0 for slope in slopes), sum(slope < 0 for slope in slopes), len(slopes)
