"""The cells that every table of replicated numbers shows, in any format: plain texts, not yet escaped."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from evoclaims.figures.replication import Replication, counts
from evoclaims.judging.repetition import Answer, Prediction, Spread
from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import listed, number, plural
from evoclaims.report.table_cells import NONE
from evoclaims.verdicts.claim_report import ClaimReport

HEADINGS: Final = ("number", "protocol", "published", "ours", "replicates", "95% of repetitions")

PROTOCOL: Final = "the protocol"
"""The protocol itself, without a variant."""

SYMBOLS: Final = {Answer.INSIDE: "✓", Answer.OUTSIDE: "✗", Answer.UNKNOWN: "?"}
_COLOURS: Final = {
    Answer.INSIDE: Outcome.SUPPORTED,
    Answer.OUTSIDE: Outcome.REFUTED,
    Answer.UNKNOWN: Outcome.INCONCLUSIVE,
}

HOW: Final = (
    "95% of repetitions: where the mean of as many trials as ours lies in 95 of 100 repetitions of the published ones, "
    "if the error bar, which is not explained, is a standard deviation (SD), and if it is a standard error (SE); for a "
    "number without a spread, by that of our trials (our SD); for a mean at the end of its scale, how many trials are "
    "at that end (exact). A number replicates if ours is inside by every reading that its scale allows."
)
"""How to read the table."""


def cells(one: Replication) -> tuple[str, ...]:
    """Return a row, a cell per heading: "0.857 ± 0.08" is published, and "0.7742 ± 0.19 (10)" ours, of 10 trials."""
    predicted = "; ".join(map(_interval, one.repetition.predictions)) or NONE
    return (one.name, one.variant or PROTOCOL, published(one), ours(one), answer(one), predicted)


def published(one: Replication) -> str:
    """Return the published number with its error bar, such as "0.857 ± 0.08"."""
    return number(one.reported.value) + (f" ± {number(one.reported.error)}" if one.reported.error else "")


def ours(one: Replication) -> str:
    """Return our mean, standard deviation and number of trials, such as "0.7742 ± 0.19 (10)"."""
    readings = one.readings
    if not readings.values:
        return NONE
    spread = f" ± {number(float(f'{readings.deviation:.2g}'))}" if len(readings.values) > 1 else ""
    return f"{number(readings.mean)}{spread} ({len(readings.values)})"


def answer(one: Replication) -> str:
    """Return whether the number replicates, such as "✗ outside"."""
    unknown = f": {one.repetition.reason}" if one.answer is Answer.UNKNOWN and not one.repetition.predictions else ""
    return f"{SYMBOLS[one.answer]} {one.answer}{unknown}"


def colour(one: Replication) -> str:
    """Return the verdict whose colour the answer takes."""
    return _COLOURS[one.answer].name.lower()


def totals(found: Sequence[Replication]) -> list[str]:
    """Return one line for each variant, such as "the protocol: 15 inside, 20 outside, 7 cannot be said"."""
    return [
        f"{variant or PROTOCOL}: " + ", ".join(f"{count} {name}" for name, count in by_answer.items() if count)
        for variant, by_answer in counts(found).items()
    ]


def put_to_the_paper(reports: Sequence[ClaimReport]) -> list[str]:
    """Say what the assertions make of the paper's own numbers; `reports` are judged from them."""
    judged = [report for report in reports if is_decided(report)]
    if not judged:
        return []
    passing = [report.name for report in judged if report.outcome is Outcome.SUPPORTED]
    names = f" ({listed(passing, most=len(passing))})" if passing else ""
    return [
        f"The published numbers suffice for {plural(len(judged), 'assertion')} of the claims. Trials that all are at "
        f"the published means would pass {len(passing)} of them{names}.",
        *(would_not_pass(report) for report in judged if report.outcome is not Outcome.SUPPORTED),
    ]


def is_decided(report: ClaimReport) -> bool:
    """Whether a claim, judged from the paper's own numbers, is a sentence of the paper for which they suffice."""
    return "§" in report.where and report.outcome.judged


def would_not_pass(report: ClaimReport) -> str:
    """Say that the paper's own numbers do not pass a claim's assertion."""
    verdict = report.verdict
    asserted = f" ({verdict.describe})" if verdict else ""
    part = verdict.deciding_part if verdict else None
    why = part.detail if part and part.detail else report.reason
    return (
        f"{report.name}: the paper's own numbers would not pass this assertion{asserted}: by trials that all are at "
        f"the published means it is {report.outcome} ({why})."
    )


def _interval(prediction: Prediction) -> str:
    """Return an interval, such as "0.776 to 0.938 (SD: outside)"."""
    ends = f"{number(prediction.low)} to {number(prediction.high)}"
    answer = "" if prediction.answer is Answer.UNKNOWN else f": {prediction.answer}"
    if prediction.spread is Spread.NONE:
        got = "" if prediction.ours is None else f", ours {number(prediction.ours)}"
        return f"{ends} {prediction.of}{got} ({prediction.spread.short}{answer})"
    return f"{ends} ({prediction.spread.short}{answer})"
