"""trend: a profile falls (or rises) with the level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from evoclaims.core.errors import require_known
from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.entry import Entry
from evoclaims.judging.kendall import Slope, trend_attainable, trend_test
from evoclaims.judging.reading import LevelsReading
from evoclaims.judging.sample import Trials
from evoclaims.judging.verdict import PValues

_OPPOSITE: dict[Slope, Slope] = {"falls": "rises", "rises": "falls"}


@dataclass(frozen=True)
class Trend(Assertion):
    """The profile falls, or rises, with the level: exact permutation test of the rank correlation within trials.

    Refuted by the same test in the other direction.
    """

    profile: LevelsReading
    direction: Slope
    kind: ClassVar[str] = "trend"
    entry: ClassVar[Entry] = Entry(
        syntax=(
            "a.success.falls()",
            "a.success.rises()",
        ),
        null="Within a trial, each order of its values over the levels is equally likely.",
        supported="The permutation test of the sum over trials of Kendall's S rejects that, ties counted exactly.",
        refuted="The same test does in the other direction.",
        source="Kendall 1938; its distribution with ties: MacMahon 1913",
    )

    def __post_init__(self) -> None:
        """Reject an unknown direction."""
        require_known("direction", self.direction, _OPPOSITE)

    def describe(self) -> str:
        """Return "P falls with the level"."""
        return f"{self.profile.describe()} {self.direction} with the level"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of a strict trend in every trial, for and against."""
        strict = trend_attainable(n, self.profile.size)
        return PValues(strict, strict)

    def bounds(self, trials: Trials, n: int, design: Design) -> tuple[PValues, PValues]:
        """Bound p from below by new trials that follow the trend strictly.

        A strict row adds the most inversions; ties in a new row would only remove possible inversions from the null.
        So no other row lowers p further.
        """
        rows = self.profile.rows(trials)
        falling = tuple(float(-level) for level in range(self.profile.size))
        rising = tuple(reversed(falling))
        new = n - len(rows)
        fall = trend_test(rows + (falling,) * new, "falls").p
        rise = trend_test(rows + (rising,) * new, "rises").p
        return PValues(*((fall, rise) if self.direction == "falls" else (rise, fall))), PValues(1.0, 1.0)

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run the trend test in both directions."""
        rows = self.profile.rows(trials)
        test, reverse = trend_test(rows, self.direction), trend_test(rows, _OPPOSITE[self.direction])
        p, attainable = PValues(test.p, reverse.p), PValues(test.attainable_p, reverse.attainable_p)
        return self.found(p, attainable, alpha, self.profile.samples(trials))
