"""How a claim ends: exactly one outcome, the reason in a sentence, and the evidence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from evoclaims.judging.sample import Sample


class Direction(StrEnum):
    """What a p value speaks for: the claim, or its opposite."""

    FOR = "for"
    AGAINST = "against"


class Outcome(StrEnum):
    """The five ways in which a claim can end."""

    SUPPORTED = "supported"
    REFUTED = "refuted"
    INCONCLUSIVE = "inconclusive"
    ERROR = "error"
    NOT_RUN = "not run"

    @property
    def symbol(self) -> str:
        """One character for tables."""
        return _SYMBOLS[self]

    @property
    def direction(self) -> Direction:
        """Which p value a reader wants to see first: the one against what is refuted, else the one for the claim."""
        return Direction.AGAINST if self is Outcome.REFUTED else Direction.FOR


_SYMBOLS = {
    Outcome.SUPPORTED: "✓",
    Outcome.REFUTED: "✗",
    Outcome.INCONCLUSIVE: "?",
    Outcome.ERROR: "E",
    Outcome.NOT_RUN: "-",
}


@dataclass(frozen=True)
class PValues:
    """A pair of p values: for the claim (`supported`) and against it (`refuted`)."""

    supported: float
    refuted: float

    def outcome(self, alpha: float) -> Outcome:
        """Return what the pair says at `alpha`; evidence for both directions at once decides neither."""
        supported, refuted = self.supported <= alpha, self.refuted <= alpha
        if supported == refuted:
            return Outcome.INCONCLUSIVE
        return Outcome.SUPPORTED if supported else Outcome.REFUTED

    def toward(self, direction: Direction) -> float:
        """Return the p value of one direction."""
        return self.supported if direction is Direction.FOR else self.refuted


@dataclass(frozen=True)
class Interval:
    """An interval that describes.

    Attributes:
        of: what it covers, and how it was made.
        low, high: its ends.
        on_axis: whether its ends can be drawn on the axis of the samples' values.
    """

    of: str
    low: float
    high: float
    on_axis: bool = False


@dataclass(frozen=True)
class Bound:
    """A number that was fixed beforehand for trials to be compared with, such as the highest value of a band.

    Attributes:
        name: such as "highest".
        value: the number.
        on_axis: whether it can be drawn on the axis of the samples' values.
    """

    name: str
    value: float
    on_axis: bool = True


@dataclass(frozen=True)
class Decision:
    """The p value that a verdict rests on.

    Attributes:
        direction: whether it speaks for the claim or against it.
        p: of the whole assertion.
        attainable_p: the smallest p that n and the ties allowed in this direction.
    """

    direction: Direction
    p: float
    attainable_p: float | None


@dataclass(frozen=True)
class Evidence:
    """The numbers behind one assertion, or one part of a compound assertion.

    Attributes:
        kind: "greater", "solves", ...
        describe: the assertion in plain English.
        outcome: what this part says by itself at `alpha`.
        samples: every trial's value.
        n: trials a side.
        alpha: significance level of the look.
        p: for the claim; None where the kind states a fact rather than a test.
        attainable_p: the smallest p that n and the ties allowed.
        p_refuted: against the claim.
        attainable_p_refuted: the smallest p against it that n and the ties allowed.
        a12: Vargha and Delaney's effect size; None without two samples.
        cliffs_delta: Cliff's delta; None without two samples.
        intervals: description only.
        detail: what else the reader should know.
        bounds: what the trials are compared with.
        events: whether values say that something held (1) or did not (0).
    """

    kind: str
    describe: str
    outcome: Outcome
    samples: tuple[Sample, ...]
    n: int
    alpha: float
    p: float | None
    attainable_p: float | None
    p_refuted: float | None
    attainable_p_refuted: float | None
    a12: float | None = None
    cliffs_delta: float | None = None
    intervals: tuple[Interval, ...] = ()
    detail: str = ""
    bounds: tuple[Bound, ...] = ()
    events: bool = False

    @property
    def direction(self) -> Direction:
        """What this part speaks for by itself."""
        return self.outcome.direction


@dataclass(frozen=True)
class Verdict:
    """How one claim ended.

    Attributes:
        outcome: exactly one of five.
        reason: why, in a sentence.
        describe: the assertion in plain English.
        fingerprint: hash of everything that was fixed beforehand.
        n: trials a side that were looked at; 0 when none were.
        alpha: significance level of the deciding look; None when no look was taken.
        p: of the whole assertion, corrected where it is compound; None where nothing was tested.
        attainable_p: the smallest p that n and the ties allowed.
        p_refuted: against the whole assertion.
        attainable_p_refuted: the smallest p against it that n and the ties allowed.
        evidence: one entry for each part of the assertion.
        without_result: which trials ended without a result of their own, and how; they took the worst rank.
        deciding: index in `evidence` of the part whose p value the whole assertion's rests on; None without evidence.
    """

    outcome: Outcome
    reason: str
    describe: str
    fingerprint: str
    n: int = 0
    alpha: float | None = None
    p: float | None = None
    attainable_p: float | None = None
    p_refuted: float | None = None
    attainable_p_refuted: float | None = None
    evidence: tuple[Evidence, ...] = ()
    without_result: str = ""
    deciding: int | None = None

    @property
    def decision(self) -> Decision | None:
        """The p value that the outcome rests on; None where nothing was tested."""
        direction = self.outcome.direction
        against = direction is Direction.AGAINST
        p, attainable_p = (self.p_refuted, self.attainable_p_refuted) if against else (self.p, self.attainable_p)
        return None if p is None else Decision(direction, p, attainable_p)

    @property
    def deciding_part(self) -> Evidence | None:
        """The part that decided."""
        return None if self.deciding is None else self.evidence[self.deciding]
