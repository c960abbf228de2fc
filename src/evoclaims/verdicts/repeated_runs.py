"""Claims whose tests ran several times in one run of pytest: each counts once, by its last run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from evoclaims.verdicts.claim_report import ClaimReport, EarlierRun
from evoclaims.verdicts.history import key_of


def following(report: ClaimReport, last: ClaimReport | None) -> ClaimReport:
    """Return the report of a claim's newest run with the runs before it, of which `last` was the newest."""
    if last is None:
        return report
    known = (*last.earlier, EarlierRun(last.outcome, last.reason, last.p))
    own = report.earlier[len(known) :] if report.earlier[: len(known)] == known else report.earlier
    return replace(report, earlier=(*known, *own), before=last.before)


def last_runs(reports: Iterable[ClaimReport]) -> list[ClaimReport]:
    """Return one report for each claim and tier: of its last run, with the others in `earlier`.

    A report that comes twice is of one run: pytest makes several reports of a test.
    """
    last: dict[tuple[str, str], ClaimReport] = {}
    seen = set[str]()
    for report in reports:
        key, content = key_of(report), repr(report)  # as text: NaN is not equal to itself
        if content not in seen:
            seen.add(content)
            last[key] = following(report, last.get(key))
    return list(last.values())


def changed_by_repetition(report: ClaimReport) -> str:
    """Return a line about a claim whose runs ended differently; empty where they agree, or there is one."""
    outcomes = dict.fromkeys([*(run.outcome for run in report.earlier), report.outcome])
    if len(outcomes) < 2:
        return ""
    ends = " -> ".join([*(run.outcome for run in report.earlier), report.outcome])
    return f"{report.name} ({report.tier}) ran {len(report.earlier) + 1} times, {ends}: the last run counts"
