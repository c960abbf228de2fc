"""The verdict on a claim: exactly one outcome, the reason in a sentence, and the evidence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from evoclaims.core.errors import UserError
from evoclaims.judging.sample import Sample


class Direction(StrEnum):
    """What a p value is evidence for: the claim, or its opposite."""

    FOR = "for"
    AGAINST = "against"


class Outcome(StrEnum):
    """The five possible outcomes of a claim."""

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
    def judged(self) -> bool:
        """Whether it says something about the claim: not where nothing ran, or something broke."""
        return self not in (Outcome.NOT_RUN, Outcome.ERROR)

    @property
    def direction(self) -> Direction:
        """The p value to show first: against the claim if refuted, else for it."""
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

    def __post_init__(self) -> None:
        """Reject an invalid probability, for example from a custom kind."""
        if not (0.0 <= self.supported <= 1.0 and 0.0 <= self.refuted <= 1.0):
            raise UserError(f"A p value lies between 0 and 1, unlike {self.supported} or {self.refuted}.")

    def outcome(self, alpha: float) -> Outcome:
        """Return the outcome at `alpha`; if both directions are significant, neither is decided."""
        supported, refuted = self.supported <= alpha, self.refuted <= alpha
        if supported == refuted:
            return Outcome.INCONCLUSIVE
        return Outcome.SUPPORTED if supported else Outcome.REFUTED

    def contradict(self, alpha: float) -> bool:
        """Whether both directions are significant at `alpha`."""
        return max(self.supported, self.refuted) <= alpha

    def toward(self, direction: Direction) -> float:
        """Return the p value of one direction."""
        return self.supported if direction is Direction.FOR else self.refuted


@dataclass(frozen=True)
class Interval:
    """A descriptive interval.

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
    """A number, fixed beforehand, that trials are compared with, such as the highest value of a band.

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
    """The p value that decides a verdict.

    Attributes:
        direction: whether it is for or against the claim.
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
        outcome: the outcome of this part alone at `alpha`.
        samples: every trial's value.
        n: trials per side.
        alpha: significance level of the look.
        p: for the claim; None if the kind states a fact without a test.
        attainable_p: the smallest p that n and the ties allowed.
        p_refuted: against the claim.
        attainable_p_refuted: the smallest p against it that n and the ties allowed.
        a12: Vargha and Delaney's effect size; None without two samples.
        cliffs_delta: Cliff's delta; None without two samples.
        intervals: description only.
        detail: further information for the reader.
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
        """The direction of this part alone."""
        return self.outcome.direction


@dataclass(frozen=True)
class Verdict:
    """The verdict on one claim.

    Attributes:
        outcome: exactly one of five.
        reason: why, in a sentence.
        describe: the assertion in plain English.
        fingerprint: hash of everything that was fixed beforehand.
        n: trials per side that were looked at; 0 if none.
        alpha: significance level of the deciding look; None if there was no look.
        p: of the whole assertion, corrected if it is compound; None if nothing was tested.
        attainable_p: the smallest p that n and the ties allowed.
        p_refuted: against the whole assertion.
        attainable_p_refuted: the smallest p against it that n and the ties allowed.
        evidence: one entry for each part of the assertion.
        without_result: which trials ended without a result, and how; they got the worst rank.
        overspent: which trials spent more than their budgets.
        copies: which trials are copies of each other; `reason` says so, too.
        deciding: index in `evidence` of the part that gives the whole assertion's p value; None without evidence.
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
    overspent: str = ""
    copies: str = ""

    @property
    def decision(self) -> Decision | None:
        """The p value that decides the outcome; None if nothing was tested."""
        direction = self.outcome.direction
        against = direction is Direction.AGAINST
        p, attainable_p = (self.p_refuted, self.attainable_p_refuted) if against else (self.p, self.attainable_p)
        return None if p is None else Decision(direction, p, attainable_p)

    @property
    def deciding_part(self) -> Evidence | None:
        """The part that decided."""
        return None if self.deciding is None else self.evidence[self.deciding]
