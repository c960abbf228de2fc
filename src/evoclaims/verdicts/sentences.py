"""Verdicts counted by sentence: one sentence may have several cases, and two sentences one result."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import ClaimReport, Tally
from evoclaims.verdicts.history import ordered


@dataclass(frozen=True)
class Sentence:
    """A sentence of the paper at one tier.

    Attributes:
        claim: its id.
        cases: the reports of its cases.
        same_as: names of the cases of earlier sentences whose results decide all of its own; empty if one is its own.
    """

    claim: str
    cases: tuple[ClaimReport, ...]
    same_as: tuple[str, ...] = ()

    @property
    def outcome(self) -> Tally:
        """How the sentence ends: refuted if a case is, supported if all cases are, or what keeps it from that."""
        found = {case.counted_as for case in self.cases}
        order = (Tally.ERROR, Tally.REFUTED, *(tally for tally in Tally if tally not in _LAST), *_LAST)
        return next(tally for tally in order if tally in found)


_LAST = (Tally.INCONCLUSIVE, Tally.NOT_RUN, Tally.VACUOUS, Tally.INSENSITIVE, Tally.SUPPORTED)
"""How a sentence ends only if none of its cases ends otherwise, in this order."""


def sentences(reports: Iterable[ClaimReport]) -> tuple[Sentence, ...]:
    """Return the sentences of the paper among the reports of a tier, in the order of the paper's lines."""
    cases: dict[str, list[ClaimReport]] = {}
    papers = [report for report in ordered(reports) if not report.is_control]
    for report in sorted(papers, key=lambda one: math.inf if one.line is None else one.line):
        cases.setdefault(report.claim, []).append(report)
    first: dict[tuple[str, ...], ClaimReport] = {}
    found = []
    for claim, these in cases.items():
        earlier = [next((first[key].name for key in _results(case) if key in first), "") for case in these]
        for case in these:
            for key in _results(case):
                first.setdefault(key, case)
        found.append(Sentence(claim, tuple(these), tuple(earlier) if all(earlier) else ()))
    return tuple(found)


def _results(report: ClaimReport) -> tuple[tuple[str, ...], ...]:
    """Return what cases of one result have in common: assertion and outcome, or the part that refuted them."""
    part = report.verdict.deciding_part if report.verdict else None
    refuted = ((str(report.outcome), part.describe),) if report.outcome is Outcome.REFUTED and part else ()
    return ((report.asserts, str(report.outcome)), *refuted) if report.asserts else refuted


@dataclass(frozen=True)
class Chance:
    """What chance alone may have decided, among cases that were tested.

    Attributes:
        tested: how many.
        expected: the largest expected number of cases that are wrongly supported, or wrongly refuted.
        kept: by the rate of false discoveries, how many supported and refuted cases survive Benjamini and Hochberg.
    """

    tested: int
    expected: float
    kept: dict[float, tuple[int, int]]


RATES = (0.05, 0.1)
"""Rates of false discoveries that are reported."""


def chance(reports: Sequence[ClaimReport]) -> Chance:
    """Return what chance may have decided among the cases of a tier.

    A case has two hypotheses, that the claim is false and that it is true. The p of a look counts as the share of the
    whole α that the look has spent: p times the sum of all looks' α over its own.
    """
    cases = [report for report in reports if not report.is_control and report.verdict and report.verdict.p is not None]
    values, ends = list[float](), list[Outcome | None]()
    for report in cases:
        assert report.verdict is not None
        spent = sum(look.alpha for look in report.attainable) / (report.verdict.alpha or 1.0)
        both = {Outcome.SUPPORTED: report.verdict.p, Outcome.REFUTED: report.verdict.p_refuted}
        for outcome, p in both.items():
            values.append(min(1.0, (1.0 if p is None else p) * spent))
            ends.append(outcome if report.outcome is outcome else None)
    adjusted = _benjamini_hochberg(values)
    kept = {
        rate: (
            sum(q <= rate and end is Outcome.SUPPORTED for q, end in zip(adjusted, ends, strict=True)),
            sum(q <= rate and end is Outcome.REFUTED for q, end in zip(adjusted, ends, strict=True)),
        )
        for rate in RATES
    }
    alphas = [sum(look.alpha for look in report.attainable) for report in cases]
    return Chance(len(cases), math.fsum(alphas), kept)


def _benjamini_hochberg(values: Sequence[float]) -> list[float]:
    """Return the smallest rate of false discoveries at which each of several p values is kept."""
    if not values:
        return []
    from scipy.stats import false_discovery_control  # SciPy takes long to import

    return [float(q) for q in false_discovery_control(values, method="bh")]
