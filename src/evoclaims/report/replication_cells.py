"""The cells that every table of replicated numbers shows, in any format: plain texts, not yet escaped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from evoclaims.figures.replication import Replication, counts, counts_by_condition
from evoclaims.judging.repetition import Agreement, Answer, Prediction, Spread
from evoclaims.judging.verdict import Outcome
from evoclaims.report.formatting import listed, literal, number, plural, table
from evoclaims.report.table_cells import NONE
from evoclaims.verdicts.claim_report import ClaimReport

HEADINGS: Final = ("number", "protocol", "published", "ours", "replicates", "95% of repetitions")

PROTOCOL: Final = "the protocol"
"""The protocol itself, without a variant."""

SYMBOLS: Final = {
    Agreement.CONSISTENT: "✓",
    Agreement.CONTRADICTED: "✗",
    Agreement.UNINFORMATIVE: "?",
    Agreement.OPEN: "-",
}
_COLOURS: Final = {
    Agreement.CONSISTENT: Outcome.SUPPORTED,
    Agreement.CONTRADICTED: Outcome.REFUTED,
    Agreement.UNINFORMATIVE: Outcome.INCONCLUSIVE,
    Agreement.OPEN: Outcome.NOT_RUN,
}

HOW: Final = (
    "95% of repetitions: where the mean of as many trials as ours lies in 95 of 100 repetitions of the published ones, "
    "if the error bar, which is not explained, is a standard deviation (SD), and if it is a standard error (SE); for a "
    "number without a spread, by that of our trials (our SD); for a mean at the end of its scale, how many trials are "
    "at that end (exact). Contradicted: ours is outside by every reading that its scale allows. Consistent: inside by "
    "every one, and shown to differ by less than the paper's own n detects with power 1/3 (two one-sided tests at "
    "0.05). Uninformative: neither; in parentheses how many trials like ours would be consistent. A curve is one "
    "condition: contradicted where a level is outside the interval that all levels share (Bonferroni), consistent "
    "where each is."
)
"""How to read the table."""


def cells(one: Replication) -> tuple[str, ...]:
    """Return a row, a cell per heading: "0.857 ± 0.08" is published, and "0.7742 ± 0.19 (10)" ours, of 10 trials."""
    predicted = "; ".join(map(_interval, one.repetition.predictions)) or NONE
    predicted += (
        f"; holds {number(one.reported.null)}, what doing nothing gets"
        if one.holds_null and one.reported.null is not None
        else ""
    )
    return (one.name, one.variant or PROTOCOL, published(one), ours(one), answer(one), predicted)


def published(one: Replication) -> str:
    """Return the published number with its error bar, such as "0.857 ± 0.08"."""
    return number(one.reported.value) + (f" ± {number(one.reported.error)}" if one.reported.error else "")


def ours(one: Replication) -> str:
    """Return our mean, standard deviation and number of trials, such as "0.7742 ± 0.19 (10)"."""
    found = one.numbers
    if not found.values:
        return NONE
    spread = f" ± {number(float(f'{found.deviation:.2g}'))}" if len(found.values) > 1 else ""
    return f"{number(found.mean)}{spread} ({len(found.values)})"


def answer(one: Replication) -> str:
    """Return whether the number replicates, such as "✗ contradicted" or "? uninformative (13)"."""
    why = f": {one.repetition.reason}" if one.repetition.reason and not one.repetition.predictions else ""
    if one.agreement is Agreement.UNINFORMATIVE and not why:
        why = " (no n)" if one.repetition.needed is None else f" ({one.repetition.needed})"
    return f"{SYMBOLS[one.agreement]} {one.agreement}{why}"


def colour(one: Replication) -> str:
    """Return the verdict whose colour the answer takes."""
    return _COLOURS[one.agreement].name.lower()


def markdown(found: Sequence[Replication]) -> str:
    """Return the published numbers beside ours, as a table."""
    return table(HEADINGS, (map(literal, cells(one)) for one in found))


def totals(found: Sequence[Replication]) -> list[str]:
    """Return one line a variant: "the protocol: 5 contradicted, 1 uninformative; by condition: 2 contradicted"."""
    conditions = counts_by_condition(found)
    return [
        f"{variant or PROTOCOL}: {_counted(numbers)}; by condition: {_counted(conditions[variant])}"
        for variant, numbers in counts(found).items()
    ]


def _counted(by_answer: Mapping[Agreement, int]) -> str:
    return ", ".join(f"{by_answer[one]} {one}" for one in Agreement if by_answer.get(one))


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
