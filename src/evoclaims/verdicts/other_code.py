"""Lines on claims whose trials ran other code than is there now: of a package, or the project's methods and tasks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

from evoclaims.core.packages import installed
from evoclaims.core.printable import printable
from evoclaims.core.source_code import REGISTRATION
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.source_trials import different, in_words, versions_of

MARK: Final = "†"
"""Marks a verdict whose trials were made with mixed versions."""

MOST_NAMES: Final = 6
"""Most names that a line lists."""


def is_mixed(report: ClaimReport) -> bool:
    """Whether some package behind a claim's trials has more than one version."""
    return any(len(versions) > 1 for versions in versions_of(report.sources).values())


def lines(reports: Sequence[ClaimReport]) -> list[str]:
    """Return lines on claims judged from mixed or other versions of packages, or from code that was edited since."""
    mixed: dict[str, list[str]] = defaultdict(list)
    foreign: dict[str, list[str | None]] = defaultdict(list)
    elsewhere = []
    for report in reports:
        versions = versions_of(report.sources)
        several = [f"{name} {in_words(those)}" for name, those in versions.items() if len(those) > 1]
        if several:
            mixed[", ".join(several)].append(f"{report.name} ({report.tier})")
            continue
        here = installed(tuple(versions))
        other = {name: those for name, those in versions.items() if those and those != (here[name],)}
        if other:
            elsewhere.append(f"{report.name} ({report.tier})")
        for name, those in other.items():
            foreign[name] += those
    lines = [f"{MARK} trials of mixed versions: {what}: {listed(names)}" for what, names in mixed.items()]
    if elsewhere:
        here = installed(tuple(foreign))
        packages = (
            f"{name} {in_words(different(those))} (installed: {here[name] or 'none'})"
            for name, those in sorted(foreign.items())
        )
        lines.append(f"trials from other versions than the installed ones: {', '.join(packages)}: {listed(elsewhere)}")
    return [*map(printable, lines), *edits(reports)]


def edits(reports: Sequence[ClaimReport]) -> list[str]:
    """Return a line for each method and task that was edited after trials behind claims had run."""
    found: dict[str, list[str]] = defaultdict(list)
    for report in reports:
        for name in edited(report):
            found[name].append(f"{report.name} ({report.tier})")
    return [printable(f"{summary(name)}: {listed(names)}") for name, names in sorted(found.items())]


def listed(names: Sequence[str]) -> str:
    """Return the first names, and how many more there are."""
    rest = len(names) - MOST_NAMES
    return ", ".join(names[:MOST_NAMES]) + (f" and {rest} more" if rest > 0 else "")


def edited(report: ClaimReport) -> list[str]:
    """Return the methods and tasks that were edited after trials behind a claim had run."""
    return sorted({name for source in report.sources for name in source.edited})


def summary(name: str) -> str:
    """Return a sentence about an edited method or task, without its trials."""
    if name.startswith(REGISTRATION):
        return (
            f"{name} was edited after trials had run, and they still count: if it is another environment now, register "
            "it under a new name, and they run again"
        )
    return (
        f"the code of {name} was edited or renamed after trials had run, and they still count: if it computes "
        "something else now, raise its `revision`, and they run again"
    )
