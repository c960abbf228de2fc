"""The verdicts of a run as Markdown, for the page that a continuous integration shows of it."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from typing import Final

from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome
from evoclaims.report.terminal_table import totals
from evoclaims.verdicts import mixed_versions
from evoclaims.verdicts.claim_report import ClaimReport

_MARKS: Final = re.compile(r"([\\`*_{}\[\]()#+!|~$@:^=-])")


def run_summary(reports: Sequence[ClaimReport], notes: Sequence[str] = ()) -> str:
    """Return a table of verdicts, their totals, and further lines about them.

    Args:
        reports: of a run.
        notes: plain texts, such as changes against the accepted verdicts.
    """
    lines = ["## Claims", "", f"**{literal(totals(reports))}**", ""]
    lines += ["| claim | what is claimed | verdict | n | p | why |", "| --- | --- | --- | ---: | ---: | --- |"]
    lines += [f"| {' | '.join(_cells(report))} |" for report in sorted(reports, key=_order)]
    lines += ["", *(f"* {literal(note)}" for note in (*mixed_versions.lines(reports), *notes))]
    return "\n".join(lines).rstrip("\n") + "\n"


def literal(text: str) -> str:
    """Return a text that Markdown, and HTML within it, shows as it stands, on one line."""
    marked = _MARKS.sub(r"\\\1", printable(" ".join(text.split())))
    return html.escape(marked, quote=False).replace("www.", "www\\.")


def _cells(report: ClaimReport) -> tuple[str, ...]:
    """Return a row of the table."""
    outcome, p = Outcome(report.outcome), (report.verdict or {}).get("p")
    because = f"; looked into and accepted: {report.because}" if report.as_expected and report.because else ""
    return (
        literal(f"{report.name} ({report.tier})"),
        literal(f"{report.statement} ({report.where})"),
        f"{outcome.symbol} {literal(str(outcome))}"
        + "\\*" * report.as_expected
        + mixed_versions.MARK * mixed_versions.is_mixed(report),
        str(report.n) if report.n else "–",
        "–" if p is None else literal(f"{p:.2g}"),
        "" if outcome is Outcome.SUPPORTED and not because else literal(f"{report.reason}{because}"),
    )


def _order(report: ClaimReport) -> tuple[str, str, int, str, str]:
    """Sort as people count."""
    return report.tier, report.claim[:1], len(report.claim), report.claim, report.case
