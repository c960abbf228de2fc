"""The verdict on a claim: exactly one outcome, the reason in a sentence, and the evidence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.judging.sample import Sample


class Direction(StrEnum):
    """What a p value is evidence for: the claim, its opposite, or only a smaller effect than the claim needs."""

    FOR = "for"
    AGAINST = "against"
    SIZE = "against its size"


class Outcome(StrEnum):
    """The six possible outcomes of a claim.

    A comparison is *refuted* where the opposite is shown, or equality within the margin; it is *smaller than claimed*
    where only an effect below the margin is shown.
    """

    SUPPORTED = "supported"
    REFUTED = "refuted"
    SMALLER = "smaller than claimed"
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
        """The p value to show first: against the claim or its size if these are shown, else for it."""
        return {Outcome.REFUTED: Direction.AGAINST, Outcome.SMALLER: Direction.SIZE}.get(self, Direction.FOR)

    @property
    def is_against(self) -> bool:
        """Whether something against the claim is shown."""
        return self in (Outcome.REFUTED, Outcome.SMALLER)


_SYMBOLS = {
    Outcome.SUPPORTED: "✓",
    Outcome.REFUTED: "✗",
    Outcome.SMALLER: "↓",
    Outcome.INCONCLUSIVE: "?",
    Outcome.ERROR: "E",
    Outcome.NOT_RUN: "-",
}


@dataclass(frozen=True)
class PValues:
    """The p values of an assertion.

    Attributes:
        supported: for the claim.
        refuted: against the claim.
        smaller: against an effect of the claimed size; None for kinds that claim no size.
    """

    supported: float
    refuted: float
    smaller: float | None = None

    def __post_init__(self) -> None:
        """Reject an invalid probability, for example from a custom kind."""
        for p in (self.supported, self.refuted, self.size):
            if not 0.0 <= p <= 1.0:
                raise UserError(f"A p value is {p}. It must be between 0 and 1.")

    @property
    def size(self) -> float:
        """The p value against the claim or its size, whichever is smaller."""
        return self.refuted if self.smaller is None else min(self.refuted, self.smaller)

    def outcome(self, alpha: float) -> Outcome:
        """Return the outcome at `alpha`.

        An effect that is shown, and shown to be below the claimed size, is smaller than claimed. Other evidence both
        ways decides nothing.
        """
        smaller = self.smaller is not None and self.smaller <= alpha
        if self.supported <= alpha:
            if smaller:
                return Outcome.SMALLER
            return Outcome.INCONCLUSIVE if self.refuted <= alpha else Outcome.SUPPORTED
        if self.refuted <= alpha:
            return Outcome.REFUTED
        return Outcome.SMALLER if smaller else Outcome.INCONCLUSIVE

    def contradict(self, alpha: float) -> bool:
        """Whether both directions are significant at `alpha`, so that nothing is decided."""
        return max(self.supported, self.refuted) <= alpha and self.outcome(alpha) is Outcome.INCONCLUSIVE

    def toward(self, direction: Direction) -> float:
        """Return the p value of one direction."""
        return {Direction.FOR: self.supported, Direction.AGAINST: self.refuted, Direction.SIZE: self.size}[direction]


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
        direction: whether it is for the claim, against it, or against its size.
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
        p_smaller: against an effect of the claimed size; None if the kind claims none.
        attainable_p_smaller: the smallest of these that n and the ties allowed.
        a12: Vargha and Delaney's effect size; None without two samples.
        cliffs_delta: Cliff's delta; None without two samples.
        intervals: description only.
        detail: further information for the reader.
        bounds: what the trials are compared with.
        events: whether values say that something held (1) or did not (0).
        shares: by how many alternatives ("or") Holm's correction divides α where this part supports the whole.
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
    p_smaller: float | None = None
    attainable_p_smaller: float | None = None
    shares: int = 1

    @property
    def direction(self) -> Direction:
        """The direction of this part alone."""
        return self.outcome.direction


OUT_OF_TIME: Final = "ran out of time"
"""How a trial ended whose result is unknown, in `Verdict.without_result`."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on one claim.

    Attributes:
        outcome: exactly one of six.
        reason: why, in a sentence.
        describe: the assertion in plain English.
        fingerprint: hash of everything that was fixed beforehand.
        n: trials per side that were looked at; 0 if none.
        alpha: significance level of the deciding look; None if there was no look.
        p: of the whole assertion, corrected if it is compound; None if nothing was tested.
        attainable_p: the smallest p that n and the ties allowed.
        p_refuted: against the whole assertion.
        attainable_p_refuted: the smallest p against it that n and the ties allowed.
        p_smaller: against an effect of the claimed size; None if no part claims one.
        attainable_p_smaller: the smallest of these that n and the ties allowed.
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
    p_smaller: float | None = None
    attainable_p_smaller: float | None = None

    @property
    def decision(self) -> Decision | None:
        """The p value that decides the outcome; None if nothing was tested."""
        direction = self.outcome.direction
        p, attainable_p = {
            Direction.FOR: (self.p, self.attainable_p),
            Direction.AGAINST: (self.p_refuted, self.attainable_p_refuted),
            Direction.SIZE: (self.p_smaller, self.attainable_p_smaller),
        }[direction]
        return None if p is None else Decision(direction, p, attainable_p)

    @property
    def deciding_part(self) -> Evidence | None:
        """The part that decided."""
        return None if self.deciding is None else self.evidence[self.deciding]
