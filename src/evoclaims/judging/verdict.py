"""How a claim ends: exactly one outcome, the reason in a sentence, and the evidence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from evoclaims.core.canonical import as_plain
from evoclaims.judging.sample import Sample


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


@dataclass(frozen=True)
class Interval:
    """An interval that describes; `of` says what it covers and how it was made."""

    of: str
    low: float
    high: float


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

    def to_json(self) -> dict[str, Any]:
        """Return the verdict as strict JSON: an infinity becomes the string "inf" or "-inf"."""
        plain: dict[str, Any] = as_plain(self)
        return plain
