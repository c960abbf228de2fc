"""The readings of each sentence as a Markdown table, and the sentences that no claim judges."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Final

from evoclaims.paper.uncovered import Uncovered
from evoclaims.report.markdown_text import literal, table
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import ordered
from evoclaims.verdicts.readings import ReadAs

YOUNGER: Final = "†"
HOW: Final = (
    "The first reading of a sentence is the one that its claim judges; the others are judged from the same trials, and "
    f"decide nothing. {YOUNGER}: the reading is younger than the first of its trials, and may have been chosen by what "
    "they show."
)
"""How to read the table."""


def readings(reports: Iterable[ClaimReport]) -> str:
    """Return one line for each reading of a sentence, in the order of the paper's lines, with the cases' verdicts."""
    papers = [report for report in ordered(reports) if report.readings and not report.is_control]
    papers.sort(key=lambda one: math.inf if one.line is None else one.line)
    rows: dict[tuple[str, str, str], list[tuple[ClaimReport, ReadAs]]] = defaultdict(list)
    for report in papers:
        for one in report.readings:
            rows[report.claim, report.statement, one.name].append((report, one))
    shown: set[tuple[str, str]] = set()
    lines = []
    for (claim, sentence, name), found in rows.items():
        new = (claim, sentence) not in shown
        shown.add((claim, sentence))
        line = "" if found[0][0].line is None else str(found[0][0].line)
        head = (literal(claim), line, literal(sentence)) if new else ("", "", "")
        lines.append((*head, literal(name), _since(found), _verdicts(found)))
    headings = ("claim", "line", "the paper says", "read as", "since", "verdict")
    return f"{table(headings, lines)}\n\n{HOW}" if lines else "No reading is judged."


def without_claims(sentences: Sequence[Uncovered]) -> str:
    """Return a table of the sentences that no claim judges."""
    lines = [(str(one.line), literal(one.says), literal(one.because)) for one in sentences]
    return table(("line", "the paper says", "no claim, because"), lines) if lines else "Every sentence has a claim."


def _since(found: Sequence[tuple[ClaimReport, ReadAs]]) -> str:
    """Return when a reading was written, with a mark if it is younger than some case's trials."""
    since = found[0][1].since or "–"
    return f"{literal(since)} {YOUNGER}" if any(one.late for _, one in found) else literal(since)


def _verdicts(found: Sequence[tuple[ClaimReport, ReadAs]]) -> str:
    """Return a reading's verdicts, one for all cases that are alike."""
    alike: dict[str, list[str]] = defaultdict(list)
    for report, one in found:
        vacuous = ", vacuous" * (report.is_vacuous and one is report.readings[0])
        alike[f"{literal(one.outcome)}{vacuous}"].append(literal(report.case))
    if len(alike) == 1:
        return next(iter(alike))
    return "<br>".join(f"{', '.join(cases)}: {outcome}" for outcome, cases in alike.items())
