"""All verdicts as a Markdown table: a line per sentence, a column per tier or variant; other claims below."""

from __future__ import annotations

import string
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from evoclaims.judging.verdict import Outcome
from evoclaims.report import table_cells
from evoclaims.report.formatting import plural
from evoclaims.report.markdown_text import literal, table
from evoclaims.report.table_cells import NONE, in_the_papers_order
from evoclaims.report.trial_summary import Reader
from evoclaims.verdicts.claim_report import CONTROL, MECHANISM, ClaimReport

Versions = dict[str, str]
_Rows = dict[tuple[str, str], dict[str, list[ClaimReport]]]
"""Reports of a claim and a sentence, by the heading of their column."""

_SHOWN: Final = ("python", "jax", "jaxlib")
"""Packages whose versions are shown for every trial; others only where a trial depends on them."""

HOW: Final = (
    "In parentheses, what decided: in how many of the judged trials an event holds, or the effect (A12: how often a "
    "trial of one side beats one of the other), or how many trials lie in a range; where a claim has several parts, "
    "the part that decided it, or that left it open. Then a letter for the device and the versions that the trials "
    "were made with."
)
"""How to read the table."""

NOT_RUN: Final = "*not run*: some of its trials are missing, or there is no test of it at this tier."
NOT_CHANGED: Final = f"{NONE}: the variant changes none of the claim's trials, or they have not run."


def overview(columns: Mapping[str, Sequence[ClaimReport]], sentences: Mapping[str, str], reader: Reader) -> str:
    """Return tables of the paper's claims, controls and mechanisms, and what letters for devices and versions mean.

    Args:
        columns: reports by heading.
        sentences: the paper's own by claim, such as "G1[n_parity]".
        reader: reads the trials behind the reports.
    """
    made = Environments(reader)
    papers: _Rows = {}
    others: dict[str, _Rows] = {CONTROL: {}, MECHANISM: {}}
    for heading, reports in columns.items():
        for report in in_the_papers_order(reports):
            rows = others.get(report.where, papers)
            line = rows.setdefault((report.claim, sentences[report.name]), defaultdict(list))
            line[heading].append(report)
    tables = [
        _table(*headings, columns, rows, made)
        for headings, rows in (
            (("claim", "the paper says"), papers),
            (("control", "what the benchmark checks"), others[CONTROL]),
            (("mechanism", "what a part of a method or a task does"), others[MECHANISM]),
        )
        if rows
    ]
    every = [report for reports in columns.values() for report in reports]
    missing = any(report.outcome is Outcome.NOT_RUN and not report.variant for report in every)
    says = [HOW, *([NOT_RUN] if missing else []), *([NOT_CHANGED] if any(report.variant for report in every) else [])]
    blocks = (*tables, " ".join(says), made.legend())
    return "\n\n".join(filter(None, blocks))


class Environments:
    """Letters for what trials were made on and with, given in the order of appearance."""

    def __init__(self, reader: Reader) -> None:
        """Start without any."""
        self._reader = reader
        self._known: list[tuple[str, Versions]] = []

    def letters(self, report: ClaimReport) -> str:
        """Return the letters of a report's trials, such as "A" or "A, C"."""
        found = {
            self._place(trial.origin.device, _shown(trial.origin.versions, source.versions))
            for source in report.sources
            for trial in self._reader.read(source.trials, source.installed)
        }
        return ", ".join(map(_letter, sorted(found)))

    def legend(self) -> str:
        """Return a line for each letter."""
        return "\n".join(
            f"* {_letter(place)}: {literal(device)}; {literal(', '.join(map(' '.join, sorted(versions.items()))))}"
            for place, (device, versions) in enumerate(self._known)
        )

    def _place(self, device: str, versions: Versions) -> int:
        """Return the place of the first environment that differs in nothing, after adding what it did not know."""
        for place, (known, together) in enumerate(self._known):
            if known == device and all(together.get(name, version) == version for name, version in versions.items()):
                together.update(versions)
                return place
        self._known.append((device, dict(versions)))
        return len(self._known) - 1


def _letter(place: int) -> str:
    """Return the letter of the environment at a place, counted from 0; after Z come A1 to Z1, then A2."""
    again, which = divmod(place, len(string.ascii_uppercase))
    return string.ascii_uppercase[which] + (str(again) if again else "")


def _shown(versions: Iterable[tuple[str, str]], needed: Iterable[str]) -> Versions:
    """Return the versions of Python and of what a trial depends on."""
    names = {*_SHOWN, *needed}
    known = dict(versions)
    return {name: known.get(name) or "none" for name in names}


def _table(name: str, says: str, columns: Iterable[str], rows: _Rows, made: Environments) -> str:
    """Return a table with a line for each sentence."""
    lines = [
        (literal(claim), literal(sentence), *(_cell(found[heading], made) for heading in columns))
        for (claim, sentence), found in rows.items()
    ]
    return table((name, says, *map(literal, columns)), lines)


def _cell(reports: Sequence[ClaimReport], made: Environments) -> str:
    """Return the verdicts of a claim's cases, one line for all that are alike."""
    alike: dict[str, list[str]] = defaultdict(list)
    for report in reports:
        alike[_verdict(report, made)].append(literal(report.case))
    if len(alike) == 1:
        return next(iter(alike))
    return "<br>".join(f"{', '.join(cases)}: {verdict}" for verdict, cases in alike.items()) or NONE


def _verdict(report: ClaimReport, made: Environments) -> str:
    """Return a verdict with its evidence in short, such as "**refuted** (2 of 10 trials; A)"."""
    if not report.n:
        return NONE if report.variant and report.outcome is Outcome.NOT_RUN else literal(report.outcome)
    outcome = f"**{literal(report.outcome)}**{table_cells.remarks(report)}"
    return f"{outcome} ({literal(_evidence(report))}; {made.letters(report)})"


def _evidence(report: ClaimReport) -> str:
    """Return what the part that decided has found."""
    part = report.verdict.deciding_part if report.verdict else None
    trials = plural(report.n, "trial")
    if report.verdict is None or part is None:
        return trials
    several = len(report.verdict.evidence) > 1
    what = f"{part.samples[0].label.partition(': ')[2]}: " if several and part.samples else ""
    if part.events:
        return f"{what}{sum(part.samples[0].values):g} of {trials}"
    if part.a12 is not None:
        return f"{what}A12 {part.a12:.2f}, {trials} a side"
    ends = [f"{bound.value:g}" for bound in part.bounds]
    within = f" [{', '.join(ends)}]" if len(ends) == 2 else ""
    return f"{what}{part.detail}{within}; {trials}" if part.detail else trials
