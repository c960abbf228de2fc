"""Lines on claims whose trials ran other code of the project's methods and tasks than is there now."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from evoclaims.core.printable import printable
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.mixed_versions import listed


def lines(reports: Sequence[ClaimReport]) -> list[str]:
    """Return a line for each method or task that was edited after trials behind claims had run, if any."""
    claims: dict[str, list[str]] = defaultdict(list)
    for report in reports:
        for name in edited(report):
            claims[name].append(f"{report.name} ({report.tier})")
    return [printable(f"{summary(name)}: {listed(names)}") for name, names in sorted(claims.items())]


def edited(report: ClaimReport) -> list[str]:
    """Return the methods and tasks that were edited after trials behind a claim had run."""
    return sorted({name for source in report.sources for name in source.edited})


def summary(name: str) -> str:
    """Return a sentence about an edited method or task, without its trials."""
    return (
        f"the code of {name} was edited after trials had run, and they still count: if it computes something else now, "
        "raise its `revision`, and they run again"
    )
