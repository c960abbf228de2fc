"""The verdicts of a run against those last accepted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from evoclaims.core.errors import UserError
from evoclaims.verdicts import history, transitions
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.history import AcceptedVerdict
from evoclaims.verdicts.transitions import Kind, Transition


@dataclass(frozen=True)
class Regression:
    """How the verdicts of a run's claims have changed.

    Attributes:
        transitions: one for each claim of the run; empty if nothing has been accepted yet.
        matched: those that make the run fail.
        accepted: the last accepted verdict of each claim.
    """

    transitions: tuple[Transition, ...]
    matched: tuple[Transition, ...]
    accepted: Mapping[tuple[str, str], AcceptedVerdict]

    @property
    def changed(self) -> dict[tuple[str, str], AcceptedVerdict]:
        """The accepted verdicts that differ from the run's, by tier and claim."""
        keys = [(one.tier, one.claim) for one in self.transitions if one.kind is Kind.CHANGED]
        return {key: self.accepted[key] for key in keys}

    def lines(self, reasons: Mapping[tuple[str, str], str]) -> list[str]:
        """Return the counts, and a line for each verdict that differs from the accepted one; empty without any.

        Changed verdicts have their `reasons` behind them, by tier and claim.
        """
        if not self.transitions:
            return []
        changes = [one for one in self.transitions if one.kind in (Kind.CHANGED, Kind.NEW_HISTORY)]
        return [
            f"against the accepted verdicts: {transitions.counts(self.transitions)}",
            *(
                f"{'REGRESSION ' * (one in self.matched)}{transitions.describe(one)}"
                + (f": {reasons[one.tier, one.claim]}" if (one.tier, one.claim) in reasons else "")
                for one in changes
            ),
        ]


def regression(folder: Path, reports: Sequence[ClaimReport], changes: str | None) -> Regression:
    """Compare the verdicts of a run with the accepted ones of the same claims.

    Args:
        folder: of the reproduction.
        reports: of the run.
        changes: the changes of verdicts to fail on (see `transitions.parse_patterns`); None for none.

    Raises:
        UserError: when the accepted verdicts are damaged, or missing although the run should fail on their changes.
    """
    path = folder / history.FILE
    patterns = transitions.parse_patterns(changes) if changes is not None else ()
    kept = history.load(path)
    accepted = transitions.accepted(kept)
    if patterns and not accepted:
        raise UserError(
            f"There are no accepted verdicts to compare with, since {path} does not exist: "
            "`evoclaims accept` writes it."
        )
    if not accepted:
        return Regression((), (), {})
    now = transitions.standings(reports)
    found = transitions.compare({key: accepted[key] for key in accepted.keys() & now.keys()}, now)
    last = {key: entries[-1] for key, entries in kept.items() if key in now}
    return Regression(found, transitions.matched(found, patterns), last)
