"""The cells that every table of verdicts shows for a claim, in any format: plain texts, not yet escaped."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from evoclaims.judging.design import Look, comparison_power
from evoclaims.judging.kinds.greater import Greater
from evoclaims.judging.power import RATES, event_power
from evoclaims.judging.verdict import Direction, Evidence, Outcome
from evoclaims.report.formatting import p_value, place_key, places
from evoclaims.verdicts import other_code
from evoclaims.verdicts.claim_report import CONTROL, MECHANISM, ClaimReport, Tally, Tried
from evoclaims.verdicts.history import ordered

NONE = "–"
"""Not measured."""
EFFECTS = (0.71, 0.8, 0.9)
"""A12 for which the power of a comparison is shown; the first is what ten trials a side of a paper could study."""


def in_the_papers_order(reports: Iterable[ClaimReport]) -> list[ClaimReport]:
    """Return reports in the order of the paper's sections, within one as `ordered` has them."""
    return sorted(ordered(reports), key=lambda report: place_key(places(report.where)[0]))


def verdict(report: ClaimReport) -> str:
    """Return the outcome, such as "✗ refuted"; with an asterisk if it was examined and accepted.

    Beside it stands "insensitive" if no planted fault changes it, "vacuous" if a null agent is supported as well, and
    "by reading" if another reading of the sentence ends otherwise.
    """
    return f"{report.outcome.symbol} {report.outcome}{'*' * report.as_expected}{remarks(report)}"


def remarks(report: ClaimReport) -> str:
    """Return what stands beside an outcome, such as ", insensitive"; empty if nothing does."""
    words = {
        "insensitive": report.tried is Tried.INSENSITIVE,
        "vacuous": report.is_vacuous,
        "by reading": report.depends_on_the_reading,
    }
    return "".join(f", {word}" for word, holds in words.items() if holds)


def power(report: ClaimReport) -> str:
    """Return how often undecided parts would be supported at some true rates, or effects; empty for other verdicts.

    Of a comparison: by its last look alone, and without ties, which make it harder. Of alternatives, each has its share
    of α.
    """
    verdict = report.verdict
    if verdict is None or report.outcome is not Outcome.INCONCLUSIVE or not report.attainable:
        return ""
    open_ = [part for part in verdict.evidence if part.outcome is not Outcome.SUPPORTED and part.bounds]
    rates = ", ".join(f"{rate:g}" for rate in RATES)

    def looks(part: Evidence) -> list[Look]:
        return [Look(look.n, look.alpha / part.shares) for look in report.attainable]

    def at_rates(part: Evidence) -> str:
        return ", ".join(f"{event_power(looks(part), part.bounds[0].value, rate):.2f}" for rate in RATES)

    def at_effects(part: Evidence) -> str:
        last = looks(part)[-1]
        return ", ".join(f"{comparison_power(last.n, last.alpha, a12):.2f}" for a12 in EFFECTS)

    effects, n = ", ".join(f"{a12:g}" for a12 in EFFECTS), report.attainable[-1].n
    return "; ".join(
        f"“{part.describe}” is supported with probability {at_rates(part)} at true rates of {rates}"
        if part.events
        else f"“{part.describe}” is supported by {n} trials with probability {at_effects(part)} at an A12 of {effects}"
        for part in open_
        if part.events or part.kind == Greater.kind
    )


def verdict_of_versions(report: ClaimReport) -> str:
    """Return the outcome with a dagger if trials are of mixed versions (see `other_code.lines`)."""
    return verdict(report) + other_code.MARK * other_code.is_mixed(report)


def trials(report: ClaimReport) -> str:
    """Return the number of judged trials per side."""
    return str(report.n) if report.n else NONE


def effect(report: ClaimReport) -> str:
    """Return the effect size (A12) of the part that decided."""
    part = report.verdict.deciding_part if report.verdict else None
    return NONE if part is None or part.a12 is None else f"{part.a12:.2f}"


def p(report: ClaimReport, *, attainable: bool = True) -> str:
    """Return the p value that the verdict rests on, such as "0.0054 (6e-05)", or "against 0.001 (0.0006)".

    Against an effect of the claimed size it is "against its size 0.001 (0.0006)".

    Args:
        report: of the claim.
        attainable: whether to add, in parentheses, the smallest p that the trials could have given.
    """
    decision = report.verdict.decision if report.verdict else None
    if decision is None:
        return NONE
    against = "" if decision.direction is Direction.FOR else f"{decision.direction} "
    smallest = f" ({p_value(decision.attainable_p)})" if attainable and decision.attainable_p is not None else ""
    return f"{against}{p_value(decision.p)}{smallest}"


def counts(reports: Iterable[ClaimReport]) -> dict[Tally, int]:
    """Return the number of claims by what they count as, without zeros."""
    found = Counter(report.counted_as for report in reports)
    return {tally: found[tally] for tally in Tally if found[tally]}


def counted(reports: Iterable[ClaimReport]) -> str:
    """Return how many claims count as what, such as "3 supported, 1 refuted"; empty if there are none."""
    return ", ".join(f"{count} {tally}" for tally, count in counts(reports).items())


def totals(reports: Sequence[ClaimReport]) -> str:
    """Return the same in one line, others apart: "3 supported, 1 refuted; controls: 2 supported; mechanisms: ..."."""
    papers = counted(report for report in reports if not report.is_control)
    return "; ".join(filter(None, (papers, others(reports)))) or "no verdicts"


def others(reports: Sequence[ClaimReport]) -> str:
    """Return the claims that are not the paper's: "controls: 2 supported; mechanisms: ..."; empty if there are none."""
    found = {kind: [report for report in reports if report.where == kind] for kind in (CONTROL, MECHANISM)}
    return "; ".join(f"{kind}s: {counted(those)}" for kind, those in found.items() if those)


def faults(reports: Iterable[ClaimReport]) -> str:
    """Return a line on how many verdicts planted faults change; empty if nothing is judged."""
    found = Counter(report.tried for report in reports if report.n)
    if not found:
        return ""
    if set(found) == {Tried.NOT_TRIED}:
        return "claims against planted faults: not tried"
    return "claims against planted faults: " + ", ".join(f"{found[one]} {one}" for one in Tried if found[one])
