"""equivalent(A, B, margin): two measures differ by less than a margin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from evoclaims.core.errors import UserError
from evoclaims.judging.assertion import Assertion, Entry, Finding
from evoclaims.judging.design import Design
from evoclaims.judging.exact import ExactTest, rank_attainable, rank_test
from evoclaims.judging.reading import NumberReading, require_independent
from evoclaims.judging.sample import RESOLUTION, Trials, UnreadableTrialError, levelled
from evoclaims.judging.verdict import Bound, PValues
from evoclaims.judging.window import total


@dataclass(frozen=True)
class Equivalent(Assertion):
    """Two conditions differ by less than `margin`, in the measure's unit.

    Supported when both one-sided rank tests reject (A + margin above B, and B above A - margin). Refuted when a rank
    test finds one beyond the margin of the other; these are two tests, so each is at alpha / 2.
    """

    left: NumberReading
    right: NumberReading
    margin: float
    kind: ClassVar[str] = "equivalent"
    entry: ClassVar[Entry] = Entry(
        syntax=("a.reward.equivalent_to(b.reward, margin=5)",),
        null="One side is above the other by at least the margin.",
        supported="Two rank tests reject that. One adds the margin to the first side, the other to the second.",
        refuted="One of two rank tests shows that one side is above the other by more than the margin, at α/2.",
        source="Schuirmann 1987 (two one-sided tests), with the rank test",
    )

    def __post_init__(self) -> None:
        """Reject an impossible margin, and measures that cannot be ranked together at a distance."""
        if not (math.isfinite(self.margin) and self.margin > 0):
            raise UserError(f"The margin of an equivalence is {self.margin}. It must be a finite number above 0.")
        require_independent(self.left, self.right)
        if self.left.is_censored:
            raise UserError(
                f"{self.left.describe()!r} is not observed beyond that, so the distance of two trials "
                "beyond it is unknown. Compare it with <, or with a number."
            )

    def describe(self) -> str:
        """Return "A is within m of B"."""
        return f"{self.left.describe()} is within {self.margin:g} of {self.right.describe()}"

    def attainable(self, n: int, design: Design) -> PValues:
        """Return the p of complete separations; against, doubled for two tests."""
        separated = rank_attainable(n, n)
        return PValues(separated, min(1.0, 2 * separated))

    def find(self, trials: Trials, design: Design, alpha: float) -> Finding:
        """Run the two tests for it and the two against it."""
        left, right = levelled(self.left.sample(trials), self.right.sample(trials))
        a, b = left.values, right.values
        largest = max((abs(value) for value in (*a, *b) if math.isfinite(value)), default=0.0)
        if self.margin <= (apart := 2 * RESOLUTION * largest):  # each side may be moved by it
            raise UnreadableTrialError(
                f"The margin {self.margin:g} of {self.describe()!r} cannot be judged: numbers as large as {largest:g} "
                f"count as equal up to {apart:g}. Write a margin above that."
            )
        raised, lowered = _shifted(a, self.margin), _shifted(a, -self.margin)
        inside = equivalence_tests(a, b, self.margin)
        outside = (rank_test(b, raised), rank_test(lowered, b))
        p = PValues(max(test.p for test in inside), min(1.0, 2 * min(test.p for test in outside)))
        attainable = PValues(
            max(test.attainable_p for test in inside),
            min(1.0, 2 * min(test.attainable_p for test in outside)),
        )
        bounds = (Bound("margin", float(self.margin), on_axis=False),)
        return self.found(p, attainable, alpha, (left, right), bounds=bounds, effect=True)


def equivalence_tests(a: Sequence[float], b: Sequence[float], margin: float) -> tuple[ExactTest, ExactTest]:
    """Return the rank tests that both have to reject: A + margin above B, and B above A - margin."""
    return rank_test(_shifted(a, margin), b), rank_test(b, _shifted(a, -margin))


def _shifted(values: Sequence[float], by: float) -> list[float]:
    return [total(value, by) for value in values]
