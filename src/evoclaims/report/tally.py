"""How many verdicts ended how, in a sentence: the paper's own claims apart from the controls of the benchmark."""

from __future__ import annotations

from collections.abc import Sequence

from evoclaims.report import table_cells
from evoclaims.report.formatting import plural
from evoclaims.verdicts.claim_report import ClaimReport


def tally(reports: Sequence[ClaimReport]) -> str:
    """Return the sentences, such as "Of 3 cases of the paper's sentences, 2 **supported** and 1 **refuted**."."""
    controls = [report for report in reports if report.is_control]
    papers = [report for report in reports if not report.is_control]
    sentences = []
    if papers or not controls:
        sentences.append(f"Of {plural(len(papers), 'case')} of the paper's sentences, {_counted(papers)}.")
    if controls:
        tested = "which test the benchmark itself"
        sentences.append(f"Of {plural(len(controls), 'case')} of controls, {tested}, {_counted(controls)}.")
    return " ".join(sentences)


def _counted(reports: Sequence[ClaimReport]) -> str:
    """Return how many count as what, such as "17 **supported** and 3 **not run**"."""
    counted = [f"{count} **{ended}**" for ended, count in table_cells.counts(reports).items()]
    return " and ".join(filter(None, (", ".join(counted[:-1]), counted[-1]))) if counted else "none"
